//! Consistency of this crate's README with the code: table of transitions, table of states.

use platen_press::{State, Transition};

const README: &str = include_str!("../../README.md");

/// Returns one column of the rows of the table between two lines.
fn column(first: &str, last: &str, column: usize) -> Vec<String> {
    let table = README.lines().skip_while(|line| !line.starts_with(first));
    let rows = table.skip_while(|line| !line.starts_with("|---")).skip(1).take_while(|line| *line != last);
    let cell = |row: &str| row.split('|').nth(column).map(|cell| cell.trim().trim_matches('`').to_owned());
    rows.filter_map(cell).collect()
}

#[test]
fn transitions_of_the_table_are_those_of_the_handshake() {
    let names = Transition::ALL.map(|transition| format!("{transition:?}"));
    assert_eq!(column("<!-- transitions", "<!-- end of transitions -->", 1), names);
}

#[test]
fn states_of_the_table_are_those_of_host_state() {
    let numbers: Vec<_> = (0..State::NAMES.len()).map(|number| number.to_string()).collect();
    assert_eq!(column("| number", "", 1), numbers);
    assert_eq!(column("| number", "", 2), State::NAMES);
}

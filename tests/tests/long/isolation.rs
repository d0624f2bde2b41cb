//! Cost of a plugin in a process of its own, compared with a thread of the host: its start, and a call.

use std::time::{Duration, Instant};

use platen_engine::pipeline;
use platen_engine::plugin::{Catalogue, Isolation, Scanner};
use platen_plant::Value;

const LIMIT: Duration = Duration::from_secs(20);
const STARTS: usize = 50;
const CALLS: usize = 5000;

/// Returns median and 99th percentile, microseconds.
fn percentiles(mut times: Vec<Duration>) -> [f64; 2] {
    times.sort();
    [0.5, 0.99].map(|share| times[(times.len() as f64 * share) as usize].as_secs_f64() * 1e6)
}

#[test]
fn a_start_and_a_call_are_quick() {
    for (name, isolation) in [("process", Isolation::Process), ("in-process", Isolation::InProcess)] {
        let catalogue = Catalogue::new(Some(platen_tests::built())).isolated(isolation);
        let file = ("file", Value::Path("none.e57".into()));
        let (library, values) = pipeline::load_with(&catalogue, "faro-file", [file]).unwrap();
        let start = || {
            let start = Instant::now();
            let scanner = Scanner::create(&library, &values).unwrap();
            (start.elapsed(), scanner)
        };
        let [start_us, slowest_us] = percentiles((0..STARTS).map(|_| start().0).collect());
        let scanner = start().1;
        let call = || {
            let start = Instant::now();
            scanner.estimate(None, LIMIT).unwrap();
            start.elapsed()
        };
        let [call_us, late_us] = percentiles((0..CALLS).map(|_| call()).collect());
        println!(
            "{name}: start {:.1} ms, 99 % within {:.1} ms; call {call_us:.0} us, 99 % within {late_us:.0} us",
            start_us / 1e3,
            slowest_us / 1e3
        );
    }
}

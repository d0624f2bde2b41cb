//! Connected components of a mask inside a window, by union-find over runs of cells.

use std::ops::Range;

use platen_numerics::union_find::UnionFind;

/// Label of a cell outside of the mask.
pub(in crate::extract) const NO_LABEL: u32 = u32::MAX;

/// Labels the components of the set cells (neighbours along rows and columns), numbered by their first cell. Returns
/// the label per cell and the number of components. Margins are not set, so that columns do not run into each other.
pub(in crate::extract) fn label_components(mask: &[bool], n_rows: usize) -> (Vec<u32>, usize) {
    let mut runs: Vec<Range<usize>> = Vec::new();
    let mut sets = UnionFind::default();
    let mut before = 0..0;
    for (column, cells) in mask.chunks_exact(n_rows.max(1)).enumerate() {
        let first = runs.len();
        push_runs(cells, column * n_rows, &mut runs);
        (first..runs.len()).for_each(|_| _ = sets.push());
        let (mut i, mut j) = (before.start, first);
        while i < before.end && j < runs.len() {
            let (left_end, right_end) = (runs[i].end + n_rows, runs[j].end);
            if runs[i].start + n_rows < right_end && runs[j].start < left_end {
                sets.union(i as u32, j as u32);
            }
            if left_end <= right_end {
                i += 1;
            } else {
                j += 1;
            }
        }
        before = first..runs.len();
    }
    let mut label = vec![NO_LABEL; mask.len()];
    let mut number = vec![NO_LABEL; runs.len()];
    let mut n = 0;
    for (run, cells) in runs.into_iter().enumerate() {
        // The root is the first run of its component.
        let root = sets.find(run as u32) as usize;
        if root == run {
            number[run] = n;
            n += 1;
        }
        label[cells].fill(number[root]);
    }
    (label, n as usize)
}

/// Appends the runs of set cells of a column that starts at cell `offset`.
fn push_runs(cells: &[bool], offset: usize, runs: &mut Vec<Range<usize>>) {
    let mut at = 0;
    while let Some(start) = cells[at..].iter().position(|set| *set) {
        let start = at + start;
        at = cells[start..].iter().position(|set| !*set).map_or(cells.len(), |length| start + length);
        runs.push(offset + start..offset + at);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_are_numbered_by_their_first_cell() {
        // Columns of five rows: a fork that closes, and a separate component.
        let picture = ["## # ", "#  # ", "#### ", "    #"];
        let mask: Vec<bool> = picture.iter().flat_map(|column| column.chars().map(|c| c == '#')).collect();
        let (label, n) = label_components(&mask, 5);
        let text: String = label.iter().map(|l| char::from_digit(*l, 10).unwrap_or(' ')).collect();
        assert_eq!((n, text.as_str()), (2, "00 0 0  0 0000     1"));
    }
}

use super::*;

/// Returns the triangles of an n x n grid of vertices, and the places of the vertices.
fn grid(n: u32) -> (Vec<[u32; 3]>, Vec<[f64; 2]>) {
    let points = (0..n * n).map(|k| [f64::from(k % n), f64::from(k / n)]).collect();
    let cells = (0..n - 1).flat_map(|j| (0..n - 1).map(move |i| j * n + i));
    (cells.flat_map(|k| [[k, k + 1, k + n + 1], [k, k + n + 1, k + n]]).collect(), points)
}

fn all_free(n_nodes: usize) -> Vec<Option<u32>> {
    (0..n_nodes as u32).map(Some).collect()
}

#[test]
fn the_graph_of_two_triangles_joins_their_corners_once() {
    let graph = Graph::of_elements(&[[0, 1, 2], [2, 1, 3]], &all_free(4), 4);
    let listed: Vec<_> = (0..4).map(|i| graph.neighbours(i).to_vec()).collect();
    assert_eq!(listed, [vec![1, 2], vec![0, 2, 3], vec![0, 1, 3], vec![1, 2]]);
    let held = Graph::of_elements(&[[0, 1, 2], [2, 1, 3]], &[Some(0), None, Some(1), Some(2)], 3);
    assert_eq!(
        (0..3).map(|i| held.neighbours(i).to_vec()).collect::<Vec<_>>(),
        [vec![1], vec![0, 2], vec![1]]
    );
}

#[test]
fn the_order_names_every_node_once_and_saves_fill() {
    let (triangles, points) = grid(60);
    let n = points.len();
    let graph = Graph::of_elements(&triangles, &all_free(n), n);
    let mut order = elimination_order::nested_dissection(&graph, &points);
    let dissected = Spd::<1>::analyse(&graph, &points).unwrap().factor.len();
    // Nodes on a line cannot be dissected: the order is that of the rows, the factor a full band.
    let row_by_row: Vec<_> = (0..n).map(|k| [k as f64, 0.0]).collect();
    let banded = Spd::<1>::analyse(&graph, &row_by_row).unwrap().factor.len();
    assert!(dissected * 3 < banded * 2, "factor of {dissected} entries against {banded} of a band");
    order.sort_unstable();
    assert!(order.iter().enumerate().all(|(k, &node)| k as u32 == node));
}

#[test]
fn solving_undoes_multiplying() {
    let (triangles, points) = grid(23);
    let n = points.len();
    let graph = Graph::of_elements(&triangles, &all_free(n), n);
    let mut spd = Spd::<2>::analyse(&graph, &points).unwrap();
    let couple = |i: u32, j: u32| {
        let (low, high) = (f64::from(i.min(j)), f64::from(i.max(j)));
        // Not symmetric, so that a transposed block is detected.
        let block = [[-0.3 - low.sin() * 0.1, 0.2 * high.cos()], [0.05 * low.cos(), -0.4]];
        if i <= j { block } else { [[block[0][0], block[1][0]], [block[0][1], block[1][1]]] }
    };
    for factor in [1.0, 2.5] {
        spd.clear();
        let expected: Vec<[f64; 2]> = (0..n).map(|k| [(k as f64).sin(), (0.7 * k as f64).cos()]).collect();
        let mut rhs = vec![[0.0; 2]; n];
        let diagonal = [[4.0 * factor, 0.5], [0.5, 5.0]];
        for i in 0..n as u32 {
            spd.add(i, i, diagonal);
            let row = &mut rhs[i as usize];
            let mut multiply = |block: [[f64; 2]; 2], x: [f64; 2]| {
                (0..2).for_each(|r| row[r] += block[r][0] * x[0] + block[r][1] * x[1]);
            };
            multiply(diagonal, expected[i as usize]);
            graph.neighbours(i).iter().for_each(|&j| multiply(couple(i, j), expected[j as usize]));
            // From either end: the system stores the block once.
            let upper = graph.neighbours(i).iter().filter(|&&j| j > i);
            upper.for_each(|&j| {
                if j % 2 == 0 { spd.add(i, j, couple(i, j)) } else { spd.add(j, i, couple(j, i)) }
            });
        }
        spd.factor().unwrap();
        let mut columns = [rhs.clone(), rhs.iter().map(|b| b.map(|x| -2.0 * x)).collect()];
        spd.solve(&mut columns).unwrap();
        for (k, x) in expected.iter().enumerate() {
            for c in 0..2 {
                assert!((columns[0][k][c] - x[c]).abs() < 1e-12);
                assert!((columns[1][k][c] + 2.0 * x[c]).abs() < 1e-12);
            }
        }
    }
}

#[test]
fn what_nothing_holds_is_refused() {
    let (triangles, points) = grid(5);
    let graph = Graph::of_elements(&triangles, &all_free(25), 25);
    let mut spd = Spd::<1>::analyse(&graph, &points).unwrap();
    assert_eq!(spd.factor(), Err(SparseError::NotPositiveDefinite { unknowns: 25 }));
    for i in 0..25 {
        spd.add(i, i, [[f64::NAN]]);
    }
    assert_eq!(spd.factor(), Err(SparseError::NotPositiveDefinite { unknowns: 25 }));
}

#[test]
fn no_unknowns_have_the_empty_solution() {
    let mut spd = Spd::<1>::analyse(&Graph::of_elements::<3>(&[], &[], 0), &[]).unwrap();
    spd.factor().unwrap();
    spd.solve(&mut [Vec::new()]).unwrap();
    assert_eq!(spd.n_unknowns(), 0);
}

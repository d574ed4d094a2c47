//! The cells of a network: the shortest loops through its nodes.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::monitor::Monitor;

/// The perimeter of the cell at each of the `asked` nodes: the length of the shortest loop through it;
/// infinite where there is none.
///
/// A loop is two ways that leave the node by different branches and meet. Both ends of the branch on
/// which its middle lies are at most half of its length away, so that the search from a node (Dijkstra)
/// ends at half of the shortest loop found.
pub fn perimeters(
    nodes: usize,
    branches: &[[u32; 2]],
    lengths: &[f64],
    asked: &[u32],
    monitor: &Monitor<'_>,
) -> Result<Vec<f64>> {
    if lengths.len() != branches.len() {
        return Err(Error::parameter("lengths", lengths.len(), "must be one a branch"));
    }
    if let Some(length) = lengths.iter().find(|length| !(length.is_finite() && **length >= 0.0)) {
        return Err(Error::parameter("lengths", length, "must not be negative"));
    }
    if let Some(&node) = branches.iter().flatten().chain(asked).find(|&&n| n as usize >= nodes) {
        return Err(Error::parameter("nodes", node, format!("must be below {nodes}")));
    }
    let network = Network::of(nodes, branches, lengths);
    let find = |search: &mut Search, &node: &u32| {
        monitor.check()?;
        Ok(network.perimeter(node, search))
    };
    asked.par_iter().map_init(|| Search::of(nodes), find).collect()
}

/// The branches at each node: to which node, how far, and by which branch.
struct Network {
    starts: Vec<usize>,
    ways: Vec<(u32, f64, u32)>,
}

impl Network {
    fn of(nodes: usize, branches: &[[u32; 2]], lengths: &[f64]) -> Self {
        let mut starts = vec![0; nodes + 1];
        for &node in branches.iter().flatten() {
            starts[node as usize + 1] += 1;
        }
        for node in 0..nodes {
            starts[node + 1] += starts[node];
        }
        let mut next = starts.clone();
        let mut ways = vec![(0, 0.0, 0); 2 * branches.len()];
        for (number, (&[a, b], &length)) in branches.iter().zip(lengths).enumerate() {
            for (from, to) in [(a, b), (b, a)] {
                ways[next[from as usize]] = (to, length, number as u32);
                next[from as usize] += 1;
            }
        }
        Self { starts, ways }
    }

    fn ways(&self, node: u32) -> &[(u32, f64, u32)] {
        &self.ways[self.starts[node as usize]..self.starts[node as usize + 1]]
    }

    fn perimeter(&self, start: u32, search: &mut Search) -> f64 {
        search.clear();
        let mut best = f64::INFINITY;
        for &(to, length, branch) in self.ways(start) {
            if to == start {
                best = best.min(length);
            } else {
                search.reach(to, Reached { length, root: branch, by: branch, settled: false });
            }
        }
        while let Some(Reached { length, root, by, .. }) = search.settle()
            && 2.0 * length < best
        {
            for &(to, step, branch) in self.ways(search.last) {
                let there = search.reached[to as usize];
                if branch == by {
                    continue;
                }
                if to == start {
                    best = best.min(length + step);
                } else if !there.settled {
                    let length = length + step;
                    search.reach(to, Reached { length, root, by: branch, settled: false });
                } else if there.root != root {
                    best = best.min(length + step + there.length);
                }
            }
        }
        best
    }
}

/// How a node was reached.
#[derive(Clone, Copy)]
struct Reached {
    length: f64,
    /// The branch by which the way leaves the start.
    root: u32,
    /// The branch by which it arrives.
    by: u32,
    /// Whether no shorter way is to come.
    settled: bool,
}

const UNREACHED: Reached =
    Reached { length: f64::INFINITY, root: u32::MAX, by: u32::MAX, settled: false };

struct Search {
    reached: Vec<Reached>,
    touched: Vec<u32>,
    queue: BinaryHeap<Reverse<(u64, u32)>>,
    /// The node that was settled last.
    last: u32,
}

impl Search {
    fn of(nodes: usize) -> Self {
        let (touched, queue) = (Vec::new(), BinaryHeap::new());
        Self { reached: vec![UNREACHED; nodes], touched, queue, last: 0 }
    }

    fn clear(&mut self) {
        for node in self.touched.drain(..) {
            self.reached[node as usize] = UNREACHED;
        }
        self.queue.clear();
    }

    /// Settles the nearest node.
    fn settle(&mut self) -> Option<Reached> {
        while let Some(Reverse((_, node))) = self.queue.pop() {
            let there = &mut self.reached[node as usize];
            if !there.settled {
                there.settled = true;
                self.last = node;
                return Some(*there);
            }
        }
        None
    }

    /// Takes a way to a node if it is the shortest so far.
    fn reach(&mut self, node: u32, way: Reached) {
        let there = &mut self.reached[node as usize];
        if way.length < there.length {
            if there.root == u32::MAX {
                self.touched.push(node);
            }
            *there = way;
            // Lengths that are not negative have the order of their bits.
            self.queue.push(Reverse((way.length.to_bits(), node)));
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn found(nodes: usize, branches: &[[u32; 2]], lengths: &[f64]) -> Vec<f64> {
        let asked: Vec<u32> = (0..nodes as u32).collect();
        perimeters(nodes, branches, lengths, &asked, &Monitor::silent()).unwrap()
    }

    #[test]
    fn known_loops() {
        assert!(found(0, &[], &[]).is_empty());
        assert_eq!(found(3, &[[0, 1], [1, 2]], &[1.0, 2.0]), [f64::INFINITY; 3]);
        // A branch that returns to its node, and one that is doubled.
        assert_eq!(found(1, &[[0, 0]], &[5.0]), [5.0]);
        assert_eq!(found(2, &[[0, 1], [1, 0]], &[1.0, 2.0]), [3.0, 3.0]);
        // A triangle with a tail, which has no loop.
        let tail = found(4, &[[0, 1], [1, 2], [2, 0], [2, 3]], &[1.0, 1.0, 1.5, 9.0]);
        assert_eq!(tail, [3.5, 3.5, 3.5, f64::INFINITY]);
        // Of two cells the smaller.
        let branches = [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2]];
        assert_eq!(found(4, &branches, &[1.0, 1.0, 2.0, 2.0, 1.0]), [3.0, 3.0, 3.0, 5.0]);
    }

    #[test]
    fn bad_input_is_named() {
        let named = |branches: &[[u32; 2]], lengths: &[f64], asked: &[u32]| match perimeters(
            2,
            branches,
            lengths,
            asked,
            &Monitor::silent(),
        ) {
            Err(Error::Parameter { parameter, .. }) => parameter,
            _ => "none",
        };
        assert_eq!(named(&[[0, 1]], &[], &[0]), "lengths");
        assert_eq!(named(&[[0, 1]], &[f64::NAN], &[0]), "lengths");
        assert_eq!(named(&[[0, 2]], &[1.0], &[0]), "nodes");
        assert_eq!(named(&[[0, 1]], &[1.0], &[2]), "nodes");
    }

    /// Without a branch at the node, the way between that branch's ends: of all branches the shortest.
    fn by_removal(nodes: usize, branches: &[[u32; 2]], lengths: &[f64], node: u32) -> f64 {
        let mut best = f64::INFINITY;
        for (out, &[a, b]) in branches.iter().enumerate() {
            if a != node && b != node {
                continue;
            }
            let mut far = vec![f64::INFINITY; nodes];
            far[a as usize] = 0.0;
            for _ in 0..nodes {
                for (other, (&[c, d], &length)) in branches.iter().zip(lengths).enumerate() {
                    if other != out {
                        let [c, d] = [c as usize, d as usize];
                        let [fc, fd] = [far[c], far[d]];
                        far[c] = fc.min(fd + length);
                        far[d] = fd.min(fc + length);
                    }
                }
            }
            best = best.min(far[b as usize] + lengths[out]);
        }
        best
    }

    proptest! {
        #[test]
        fn equal_to_the_shortest_way_back(
            ends in prop::collection::vec((0..7u32, 0..7u32, 0..6u32), 0..16),
        ) {
            let branches: Vec<[u32; 2]> = ends.iter().map(|&(a, b, _)| [a, b]).collect();
            let lengths: Vec<f64> = ends.iter().map(|&(.., n)| f64::from(n)).collect();
            for (node, perimeter) in (0..).zip(found(7, &branches, &lengths)) {
                let expected = by_removal(7, &branches, &lengths, node);
                prop_assert_eq!(perimeter.to_bits(), expected.to_bits());
            }
        }
    }
}

//! How large the ball of a neighbour must be to hold that of a voxel.
//!
//! Balls hold voxels: one may lie in that of a neighbour though the real balls do not (Rémy and Thiel
//! 2002). The farthest voxel v of a ball from the neighbour at −e has the square |v|² + 2 v·e + |e|²;
//! the neighbour's must be larger.

use super::Space;
use super::steps::MIDDLE;
use crate::geometry::distance::window::Lane;

/// Largest radius in voxels for which [`Needed::of_cubes`] is made; it takes the cube of it.
const LARGEST_IN_TABLE: usize = 512;

/// Most voxels of an eighth of a ball that are listed: 7 MB, a radius of 80 voxels.
const MOST_IN_LIST: usize = 1 << 18;

/// Kinds of steps where voxels are no cubes: by the axes that they are along.
pub(super) const KINDS: usize = 7;

/// The squared distance that a neighbour must have for its ball to hold that of a voxel.
pub(super) enum Needed<T> {
    /// In cubes: by squared distance in voxels, and by how many axes the neighbour differs along.
    Cubes(Vec<[T; 3]>),
    /// By the axes that the neighbour differs along:
    Others(List),
    /// The distance of the neighbour; for larger balls, taken as real ones.
    Lengths([f32; KINDS]),
}

/// The distances between voxels that are no cubes.
pub(super) struct List {
    /// Their squares, in order.
    squares: Vec<f32>,
    /// What a neighbour's square must be if a ball holds all voxels up to there.
    needed: Vec<[f32; KINDS]>,
    /// How many squares come before each of so many that are evenly spaced.
    firsts: Vec<u32>,
    /// One by their spacing.
    per_square: f32,
}

impl<T: Lane + Default> Needed<T> {
    /// For balls up to a square.
    pub(super) fn new(space: &Space, most: f32) -> Self {
        let most_in_voxels = (most / 4.0) as usize;
        if space.cubic && most_in_voxels <= LARGEST_IN_TABLE.pow(2) {
            return Self::Cubes(Self::of_cubes(most_in_voxels));
        }
        if let Some(list) = List::new(space.size, f64::from(most)) {
            return Self::Others(list);
        }
        let mut lengths = [0.0; KINDS];
        for step in &space.steps.all[MIDDLE + 1..] {
            lengths[step.axes() - 1] = step.square.sqrt();
        }
        Self::Lengths(lengths)
    }

    /// Squares are whole numbers: one that is larger is so by one at least.
    fn of_cubes(most: usize) -> Vec<[T; 3]> {
        let mut sums = vec![[None::<usize>; 3]; most + 1];
        let root = most.isqrt();
        for a in 0..=root {
            for b in 0..=a.min((most - a * a).isqrt()) {
                for c in 0..=b.min((most - a * a - b * b).isqrt()) {
                    let of = &mut sums[a * a + b * b + c * c];
                    for (largest, sum) in of.iter_mut().zip([a, a + b, a + b + c]) {
                        *largest = (*largest).max(Some(sum));
                    }
                }
            }
        }
        let mut farthest = [0; 3];
        let mut needed = vec![[T::default(); 3]; most + 1];
        for square in 1..=most {
            for axes in 0..3 {
                if let Some(sum) = sums[square - 1][axes] {
                    farthest[axes] = farthest[axes].max(square - 1 + 2 * sum + axes + 1);
                }
                needed[square][axes] = T::from_square(4.0 * (farthest[axes] + 1) as f32);
            }
        }
        needed
    }

    /// How many kinds of steps there are.
    pub(super) const fn kinds(&self) -> usize {
        match self {
            Self::Cubes(_) => 3,
            Self::Others(_) | Self::Lengths(_) => KINDS,
        }
    }

    /// The kind of a step that is along some axes, as bits.
    pub(super) const fn kind(&self, axes: usize) -> usize {
        match self {
            Self::Cubes(_) => axes.count_ones() as usize - 1,
            Self::Others(_) | Self::Lengths(_) => axes - 1,
        }
    }

    /// Writes what is needed for each square to `rows`, one for each kind.
    pub(super) fn fill<const N: usize>(&self, squares: &[T; N], rows: &mut [[T; N]]) {
        match (self, rows) {
            (Self::Cubes(table), [one, two, three]) => {
                for i in 0..N {
                    [one[i], two[i], three[i]] = table[squares[i].whole() as usize / 4];
                }
            }
            (Self::Cubes(_), _) => (),
            (Self::Others(list), rows) => {
                for (x, square) in squares.iter().enumerate() {
                    let needed = list.needed(square.square());
                    for (row, needed) in rows.iter_mut().zip(needed) {
                        row[x] = T::from_square(*needed);
                    }
                }
            }
            (Self::Lengths(lengths), rows) => {
                for (row, length) in rows.iter_mut().zip(lengths) {
                    for (needed, square) in row.iter_mut().zip(squares) {
                        let root = square.square().sqrt() + length;
                        *needed = T::from_square(root * root * (1.0 + 4e-6));
                    }
                }
            }
        }
    }
}

impl List {
    /// None if there are too many voxels in a ball.
    fn new(size: [f64; 3], most: f64) -> Option<Self> {
        let [nz, ny, nx] = size.map(|edge| (most.sqrt() / edge) as usize + 1);
        if nz.checked_mul(ny)?.checked_mul(nx)? > 2 * MOST_IN_LIST {
            return None;
        }
        let mut voxels = Vec::new();
        for z in 0..nz {
            for y in 0..ny {
                for x in 0..nx {
                    let at = [0, 1, 2].map(|axis| [z, y, x][axis] as f64 * size[axis]);
                    let square = at.iter().map(|at| at * at).sum::<f64>();
                    if square <= most {
                        voxels.push((square, at));
                    }
                }
            }
        }
        voxels.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let mut farthest = [0.0f64; KINDS];
        let (mut squares, mut needed) = (Vec::new(), Vec::<[f32; KINDS]>::new());
        for (square, at) in voxels {
            for (kind, farthest) in farthest.iter_mut().enumerate() {
                // The neighbour is away from the voxel along the axes of the kind.
                let along = (0..3).filter(|axis| (kind + 1) >> (2 - axis) & 1 == 1);
                let from = |axis: usize| size[axis] * (size[axis] + 2.0 * at[axis]);
                *farthest = farthest.max(square + along.map(from).sum::<f64>());
            }
            let farthest = farthest.map(|farthest| (farthest * (1.0 + 4e-6)) as f32);
            match (squares.last(), needed.last_mut()) {
                // Squares that differ by rounding only are one.
                (Some(&last), Some(needed)) if square as f32 <= last * (1.0 + 2e-7) => {
                    *needed = farthest;
                }
                _ => {
                    squares.push(square as f32);
                    needed.push(farthest);
                }
            }
        }
        let per_square = squares.len() as f32 / most as f32;
        let first = |i: usize| {
            let from = i as f32 / per_square * (1.0 - 1e-5);
            squares.partition_point(|&square| square < from) as u32
        };
        let firsts = (0..=squares.len()).map(first).collect();
        Some(Self { squares, needed, firsts, per_square })
    }

    /// What is needed for the ball of a square.
    #[inline(always)]
    fn needed(&self, square: f32) -> &[f32; KINDS] {
        // The voxel outside that is nearest is not in the ball, whatever has been rounded.
        let below = square * (1.0 - 3e-7);
        let from = ((below * self.per_square) as usize).min(self.firsts.len() - 1);
        let first = self.firsts[from] as usize;
        let more = self.squares[first..].iter().take_while(|&&square| square < below).count();
        // Of no ball, what is needed does not matter.
        &self.needed[(first + more).max(1) - 1]
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::volume::Boundary;

    /// The farthest voxel of a ball from a neighbour, squared.
    fn farthest(size: [f64; 3], below: f64, along: [i32; 3]) -> f64 {
        let most = size.map(|edge| (below.sqrt() / edge) as i32 + 1);
        let square = |at: [i32; 3]| (0..3).map(|i| (f64::from(at[i]) * size[i]).powi(2)).sum();
        let mut farthest = 0.0f64;
        for z in -most[0]..=most[0] {
            for y in -most[1]..=most[1] {
                for x in -most[2]..=most[2] {
                    let from: f64 = square([z + along[0], y + along[1], x + along[2]]);
                    let near: f64 = square([z, y, x]);
                    if near < below {
                        farthest = farthest.max(from);
                    }
                }
            }
        }
        farthest
    }

    proptest! {
        #[test]
        fn what_is_needed_is_beyond_the_farthest_voxel(
            ratios in prop::array::uniform3(1.0..3.0f64),
            voxel in prop::array::uniform3(0..5i32),
            number in 0..27usize,
            cubic: bool,
        ) {
            prop_assume!(number != MIDDLE && voxel != [0; 3]);
            let size = if cubic { [1.0; 3] } else { ratios };
            let space = Space::new(size, Boundary::Open);
            // The ball that ends at a voxel, among others that may be larger.
            let at = |i: usize| f64::from(voxel[i]) * space.size[i];
            let square = (0..3).map(|i| at(i) * at(i)).sum::<f64>();
            let needed = Needed::<f32>::new(&space, 1.7 * square as f32);
            let mut rows = [[0.0f32]; KINDS];
            needed.fill(&[square as f32], &mut rows[..needed.kinds()]);
            let step = &space.steps.all[number];
            let found = f64::from(rows[needed.kind(step.axes())][0]);
            let exact = farthest(space.size, square * (1.0 - 1e-9), step.along);
            prop_assert!(found > exact, "{found} {exact}");
            // In cubes the next square is 4 farther.
            let next = if cubic { 4.0 } else { 0.0 };
            prop_assert!(found <= exact * (1.0 + 1e-5) + next, "{found} {exact}");
        }

        #[test]
        fn large_balls_are_taken_as_real_ones(ratio in 1.1..3.0f64, square in 1.0..1e6f32) {
            let space = Space::new([ratio, 1.0, 1.0], Boundary::Open);
            let needed = Needed::<f32>::new(&space, 1e8);
            prop_assert!(matches!(needed, Needed::Lengths(_)));
            let mut rows = [[0.0f32]; KINDS];
            needed.fill(&[square], &mut rows);
            let step = &space.steps.all[0];
            let exact = (square.sqrt() + step.square.sqrt()).powi(2);
            let found = rows[needed.kind(step.axes())][0];
            prop_assert!(found > exact && found < exact * 1.0001);
        }
    }
}

//! Branches of a phase taken away: their voxels, not only those of the skeleton.
//!
//! A voxel belongs to the place of the skeleton whose ball it lies deepest in (the power diagram of the
//! largest balls), so that the root of a branch stays with the strut that it stands on; what lies in no
//! ball, such as the edge of a plate, belongs to what it hangs on. Voxels go one after another from the
//! free end, and only where the topology stays.

use std::collections::HashSet;

use ndarray::{ArrayView3, ArrayViewMut3};
use rayon::prelude::*;

use super::grid::{Grid, Step};
use super::scene::Scene;
use crate::error::{Error, Result};
use crate::monitor::Monitor;
use crate::topology::labelling::Connectivity;
use crate::volume::{Boundary, Shape, index, position};

/// Voxels beyond its ball that may belong to a place: thinning ends before the tip of a branch, and
/// balls do not reach into corners.
const BEYOND: f32 = 2.0;
/// Voxels beyond the balls of a branch that may hang on it: the half width of a plate.
const EDGE: isize = 10;
/// A branch that owns more than so many times the volume of the balls along it is the edge of a plate,
/// which ends in many places and is no strut that hangs loose. Struts of a foam own 1 to 2.5 times as
/// much, the edges of plates in bone 3.5 and more.
const PLATE: f32 = 3.0;
/// Share of a branch's voxels that may have to stay for the sake of the topology; one of which more
/// stays is no strut but holds something together.
const REST: f32 = 0.25;
/// Voxels at least that make a piece of the solid large.
const FEW: usize = 100;
/// Edge of the boxes in which the places are found again.
const BOX: usize = 16;
/// A place of no branch that is to go.
pub const STAYS: i64 = -1;

/// The skeleton of a phase.
pub struct Skeleton<'a> {
    /// Places (z, y, x). Those of a branch that is to go follow each other from its free end on.
    pub places: &'a [[u32; 3]],
    /// Distance of each place to what is not the phase.
    pub radii: &'a [f32],
    /// The branch of each place, from 0 on in the order in which they are to go, or `STAYS`.
    pub branches: &'a [i64],
}

/// What becomes of a branch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Manner {
    /// It goes with all that hangs on it, if that is no plate and holds nothing together.
    Prune,
    /// It is cut in its middle, and both stumps go.
    Cut,
}

impl std::str::FromStr for Manner {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        match name {
            "prune" => Ok(Self::Prune),
            "cut" => Ok(Self::Cut),
            _ => Err(Error::parameter("manner", name, "must be 'prune' or 'cut'")),
        }
    }
}

/// Takes branches out of a phase whose voxels touch by corners. Voxels that are not free stay. Returns
/// the number of voxels that each branch lost.
///
/// Peak memory: 1 byte a voxel, 24 a place of the skeleton, 32 a voxel of the branches, and the box of
/// one branch a thread.
pub fn remove(
    mut phase: ArrayViewMut3<'_, bool>,
    skeleton: &Skeleton<'_>,
    free: Option<ArrayView3<'_, bool>>,
    manner: Manner,
    monitor: &Monitor<'_>,
) -> Result<Vec<u64>> {
    let (nz, ny, nx) = phase.dim();
    let shape = [nz, ny, nx];
    check(skeleton, free.as_ref().map(ArrayView3::dim), shape)?;
    let count = skeleton.branches.iter().max().map_or(0, |&most| (most + 1) as usize);
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); count];
    for (place, &branch) in skeleton.branches.iter().enumerate() {
        if branch != STAYS {
            members[branch as usize].push(place as u32);
        }
    }
    let scene = Scene::new(phase.view(), free, Connectivity::Corners, Boundary::Open);
    let widest = skeleton.radii.iter().fold(0.0_f32, |most, &radius| most.max(radius));
    let places = Places::of(skeleton, shape);
    let mut removal = Removal { places, skeleton, shape, widest, scene };
    let owned = |branch: &Vec<u32>| {
        monitor.check()?;
        Ok(removal.owned(branch))
    };
    let owned = members.par_iter().map(owned).collect::<Result<Vec<_>>>()?;
    let taken = owned.into_iter().zip(&members);
    let lost = taken.map(|(owned, branch)| removal.take(owned, branch, manner)).collect();
    for (voxel, at) in phase.iter_mut().zip(0..) {
        *voxel = removal.scene.phase(at);
    }
    Ok(lost)
}

fn check(skeleton: &Skeleton<'_>, free: Option<(usize, usize, usize)>, shape: Shape) -> Result<()> {
    let [z, y, x] = shape;
    if let Some(free) = free.filter(|&free| free != (z, y, x)) {
        return Err(Error::parameter("free.shape", free, "must be that of the phase"));
    }
    let n = skeleton.places.len();
    let lengths = [skeleton.radii.len(), skeleton.branches.len()];
    if lengths != [n; 2] {
        return Err(Error::parameter(
            "radii, branches",
            lengths,
            format!("must be {n}, one a place"),
        ));
    }
    let outside = |place: &&[u32; 3]| (0..3).any(|axis| place[axis] as usize >= shape[axis]);
    if let Some(place) = skeleton.places.iter().find(outside) {
        return Err(Error::parameter("places", place, format!("must be in a volume of {shape:?}")));
    }
    let longest = shape.iter().sum::<usize>() as f32;
    if let Some(radius) = skeleton.radii.iter().find(|r| !(0.0..=longest).contains(*r)) {
        return Err(Error::parameter("radii", radius, "must be from 0 to the size of the volume"));
    }
    if let Some(branch) = skeleton.branches.iter().find(|&&b| !(STAYS..n as i64).contains(&b)) {
        return Err(Error::parameter("branches", branch, format!("must be from {STAYS} to {n}")));
    }
    Ok(())
}

/// The places of a skeleton, by the boxes in which they lie.
struct Places {
    boxes: Shape,
    starts: Vec<u32>,
    sorted: Vec<u32>,
}

impl Places {
    fn of(skeleton: &Skeleton<'_>, shape: Shape) -> Self {
        let boxes = shape.map(|n| n / BOX + 1);
        let home = |place: &[u32; 3]| index(boxes, place.map(|i| i as usize / BOX));
        let mut starts = vec![0; boxes.iter().product::<usize>() + 1];
        for place in skeleton.places {
            starts[home(place) + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut sorted = vec![0; skeleton.places.len()];
        for (number, place) in (0..).zip(skeleton.places) {
            let slot = &mut next[home(place)];
            sorted[*slot as usize] = number;
            *slot += 1;
        }
        Self { boxes, starts, sorted }
    }

    /// Calls with the places in the boxes that meet a region.
    fn for_each(&self, low: [isize; 3], high: [isize; 3], mut visit: impl FnMut(u32)) {
        let edge = BOX as isize;
        let first = low.map(|i| (i.max(0) / edge) as usize);
        let last: Shape = std::array::from_fn(|axis| {
            (high[axis].max(0) / edge).min(self.boxes[axis] as isize - 1) as usize
        });
        for z in first[0]..=last[0] {
            for y in first[1]..=last[1] {
                for x in first[2]..=last[2] {
                    let at = index(self.boxes, [z, y, x]);
                    let range = self.starts[at] as usize..self.starts[at + 1] as usize;
                    for &place in &self.sorted[range] {
                        visit(place);
                    }
                }
            }
        }
    }
}

/// A voxel that belongs to a branch.
#[derive(Clone, Copy)]
struct Owned {
    at: usize,
    /// Number of the place that it lies deepest in, from the free end on.
    place: usize,
    depth: f32,
}

/// A region, and how deep each of its voxels lies in a ball: squared distance from the centre less the
/// squared radius.
struct Region {
    low: [isize; 3],
    edges: Shape,
    depth: Vec<f32>,
    place: Vec<usize>,
}

impl Region {
    fn of(skeleton: &Skeleton<'_>, places: &[u32], shape: Shape) -> Self {
        let mut low = [isize::MAX; 3];
        let mut high = [isize::MIN; 3];
        for &number in places {
            let reach = reach(skeleton.radii[number as usize]);
            for axis in 0..3 {
                let i = skeleton.places[number as usize][axis] as isize;
                let far = reach + EDGE;
                low[axis] = low[axis].min((i - far).max(0));
                high[axis] = high[axis].max((i + far + 1).min(shape[axis] as isize));
            }
        }
        let edges: Shape = std::array::from_fn(|axis| (high[axis] - low[axis]).max(0) as usize);
        let n = edges.iter().product();
        Self { low, edges, depth: vec![f32::INFINITY; n], place: vec![usize::MAX; n] }
    }

    /// Draws a ball, with the number of its place.
    fn draw(&mut self, centre: [u32; 3], radius: f32, place: usize) {
        let centre = centre.map(|i| i as isize);
        let reach = reach(radius);
        let range = |axis: usize| {
            let from = (centre[axis] - reach).max(self.low[axis]);
            let to = (centre[axis] + reach + 1).min(self.low[axis] + self.edges[axis] as isize);
            from..to
        };
        let furthest = (radius + BEYOND) * (radius + BEYOND);
        let rows = [range(0), range(1), range(2)];
        let [zs, ys, xs] = rows;
        for z in zs {
            for y in ys.clone() {
                let across = (z - centre[0]).pow(2) + (y - centre[1]).pow(2);
                let half = (furthest - across as f32).max(-1.0);
                if half < 0.0 {
                    continue;
                }
                let half = half.sqrt() as isize;
                let row = [z, y, self.low[2]];
                let row = std::array::from_fn(|axis| (row[axis] - self.low[axis]) as usize);
                let row = index(self.edges, row);
                for x in xs.start.max(centre[2] - half)..xs.end.min(centre[2] + half + 1) {
                    let square = (across + (x - centre[2]).pow(2)) as f32;
                    let i = row + (x - self.low[2]) as usize;
                    let depth = square - radius * radius;
                    if depth < self.depth[i] {
                        self.depth[i] = depth;
                        self.place[i] = place;
                    }
                }
            }
        }
    }
}

/// Whose a voxel is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Side {
    Void,
    Nobody,
    Own,
    Other,
}

/// Voxels from a place of this radius to the furthest that may belong to it, along an axis.
fn reach(radius: f32) -> isize {
    (radius + BEYOND) as isize
}

struct Removal<'a, 's> {
    places: Places,
    skeleton: &'a Skeleton<'a>,
    shape: Shape,
    /// The largest radius.
    widest: f32,
    scene: Scene<'s>,
}

impl Removal<'_, '_> {
    /// The voxels that belong to a branch, those of its free end first, of each place the outermost
    /// first.
    fn owned(&self, branch: &[u32]) -> Vec<Owned> {
        let Some(&first) = branch.first() else { return Vec::new() };
        let skeleton = self.skeleton;
        let mut own = Region::of(skeleton, branch, self.shape);
        for (number, &place) in branch.iter().enumerate() {
            own.draw(skeleton.places[place as usize], skeleton.radii[place as usize], number);
        }
        let mut others = Region::of(skeleton, branch, self.shape);
        let far = reach(self.widest);
        let low = own.low.map(|i| i - far);
        let high = std::array::from_fn(|axis| own.low[axis] + own.edges[axis] as isize + far);
        let name = skeleton.branches[first as usize];
        self.places.for_each(low, high, |place| {
            let place = place as usize;
            if skeleton.branches[place] != name {
                others.draw(skeleton.places[place], skeleton.radii[place], 0);
            }
        });
        let mut owned = Vec::new();
        for i in self.spread(&mut own, &others) {
            let at = self.at(&own, i);
            if self.scene.free(at) {
                owned.push(Owned { at, place: own.place[i], depth: own.depth[i] });
            }
        }
        owned.sort_by(|a, b| {
            a.place.cmp(&b.place).then(b.depth.total_cmp(&a.depth)).then(a.at.cmp(&b.at))
        });
        owned
    }

    /// Position in the volume of a voxel of a region.
    fn at(&self, region: &Region, i: usize) -> usize {
        let local = position(region.edges, i);
        index(self.shape, std::array::from_fn(|axis| local[axis] + region.low[axis] as usize))
    }

    /// Gives the voxels of the phase that lie in no ball to what reaches them first, in steps from voxel
    /// to voxel. Returns those that belong to the branch.
    fn spread(&self, own: &mut Region, others: &Region) -> Vec<usize> {
        let n = own.depth.len();
        let mut side = vec![Side::Void; n];
        let mut front = Vec::new();
        for (i, side) in side.iter_mut().enumerate() {
            if self.scene.phase(self.at(own, i)) {
                let [mine, theirs] = [own.depth[i], others.depth[i]];
                *side = if mine < theirs {
                    Side::Own
                } else if theirs < f32::INFINITY {
                    Side::Other
                } else {
                    Side::Nobody
                };
                if *side != Side::Nobody {
                    front.push(i);
                }
            }
        }
        let grid = Grid::new((own.edges[0], own.edges[1], own.edges[2]), Boundary::Open);
        let faces = grid.steps(1);
        let mut owned: Vec<usize> =
            front.iter().copied().filter(|&i| side[i] == Side::Own).collect();
        while !front.is_empty() {
            let mut next = Vec::new();
            for &i in &front {
                grid.for_each(i, &faces, |_, to| {
                    if side[to] == Side::Nobody {
                        side[to] = side[i];
                        own.place[to] = own.place[i];
                        own.depth[to] = own.depth[i] + 1.0;
                        next.push(to);
                    }
                });
            }
            owned.extend(next.iter().copied().filter(|&i| side[i] == Side::Own));
            front = next;
        }
        owned
    }

    /// Takes what belongs to a branch. Returns how many voxels went.
    fn take(&mut self, owned: Vec<Owned>, branch: &[u32], manner: Manner) -> u64 {
        match manner {
            Manner::Prune => self.prune(owned, branch),
            Manner::Cut => self.cut(owned, branch.len()),
        }
    }

    fn prune(&mut self, owned: Vec<Owned>, branch: &[u32]) -> u64 {
        let whole = owned.len();
        if whole as f32 > PLATE * self.round(branch) {
            return 0;
        }
        let (mut taken, left) = self.peel(owned);
        if left.len() as f32 > REST * whole as f32 || !self.take_rest(&left, whole, &mut taken) {
            for at in taken {
                self.scene.add(at);
            }
            return 0;
        }
        taken.len() as u64
    }

    /// Takes what is left of a branch for the sake of the topology, a thread to voxels beyond it, with
    /// those voxels. Returns whether that is all that hangs on it: if the thread leads from one large
    /// piece to another, it holds something together.
    fn take_rest(&mut self, left: &[Owned], whole: usize, taken: &mut Vec<usize>) -> bool {
        let most = whole.max(FEW);
        let mut seen = HashSet::new();
        for voxel in left {
            if seen.insert(voxel.at) {
                let (part, met) = self.flood(voxel.at, most, &mut seen);
                if part.len() <= most && !met {
                    // It is a part of its own that would vanish.
                    return false;
                }
            }
        }
        for voxel in left {
            self.scene.take(voxel.at);
            taken.push(voxel.at);
        }
        let mut seen = HashSet::new();
        let mut rest = left.len();
        let mut large = false;
        for voxel in left {
            let mut beside = Vec::new();
            self.scene.grid.for_each(voxel.at, &self.scene.around, |_, to| beside.push(to));
            for start in beside {
                if !self.scene.phase(start) || !seen.insert(start) {
                    continue;
                }
                let (piece, met) = self.flood(start, most, &mut seen);
                if piece.len() <= most && !met {
                    if piece.iter().any(|&at| !self.scene.free(at)) {
                        return false;
                    }
                    for &at in &piece {
                        self.scene.take(at);
                    }
                    rest += piece.len();
                    taken.extend(piece);
                } else if large && !met {
                    return false;
                } else {
                    large = true;
                }
            }
        }
        // No part, of which each has more voxels, vanishes then.
        rest <= most
    }

    /// The voxels that hang together with one, until there are more than `most`, and whether they met
    /// some that were seen before.
    fn flood(&self, start: usize, most: usize, seen: &mut HashSet<usize>) -> (Vec<usize>, bool) {
        let mut piece = vec![start];
        let mut own = HashSet::from([start]);
        let mut met = false;
        let mut next = 0;
        while next < piece.len() && piece.len() <= most {
            self.scene.grid.for_each(piece[next], &self.scene.around, |_, to| {
                if self.scene.phase(to) && own.insert(to) {
                    met |= !seen.insert(to);
                    piece.push(to);
                }
            });
            next += 1;
        }
        (piece, met)
    }

    /// The volume of a branch if it were round: a tube along its places, and a ball at its ends.
    fn round(&self, branch: &[u32]) -> f32 {
        let squares = branch.iter().map(|&place| self.skeleton.radii[place as usize].powi(2));
        let sum: f32 = squares.sum();
        let mean = (sum / branch.len() as f32).sqrt();
        std::f32::consts::PI * (sum + 4.0 / 3.0 * mean.powi(3))
    }

    fn cut(&mut self, mut owned: Vec<Owned>, places: usize) -> u64 {
        let middle = places / 2;
        let whole = owned.len();
        owned.retain(|voxel| {
            let cut = voxel.place.abs_diff(middle) <= 1;
            if cut {
                self.scene.take(voxel.at);
            }
            !cut
        });
        let cut = whole - owned.len();
        // Each stump from the cut on.
        owned.sort_by_key(|voxel| voxel.place.abs_diff(middle));
        let (taken, left) = self.peel(owned);
        (cut + taken.len()) as u64 + self.take_crumbs(&left)
    }

    /// Takes voxels without which the topology is the same, one after another, until there are none.
    /// Returns those that went and those that are left.
    fn peel(&mut self, mut owned: Vec<Owned>) -> (Vec<usize>, Vec<Owned>) {
        let mut taken = Vec::new();
        loop {
            let before = taken.len();
            owned.retain(|voxel| {
                let simple = self.scene.simple(voxel.at);
                if simple {
                    self.scene.take(voxel.at);
                    taken.push(voxel.at);
                }
                !simple
            });
            if taken.len() == before {
                return (taken, owned);
            }
        }
    }

    /// Takes those of the voxels that hang together with nothing else.
    fn take_crumbs(&mut self, voxels: &[Owned]) -> u64 {
        let steps: &[Step] = &self.scene.around;
        let grid: &Grid = &self.scene.grid;
        let mut own: Vec<usize> = voxels.iter().map(|voxel| voxel.at).collect();
        own.sort_unstable();
        let mut seen = vec![false; own.len()];
        let mut crumbs = Vec::new();
        for start in 0..own.len() {
            if seen[start] {
                continue;
            }
            seen[start] = true;
            let mut part = vec![start];
            let mut next = 0;
            let mut apart = true;
            while next < part.len() {
                grid.for_each(own[part[next]], steps, |_, to| {
                    if !self.scene.phase(to) {
                        return;
                    }
                    match own.binary_search(&to) {
                        Ok(i) if !seen[i] => {
                            seen[i] = true;
                            part.push(i);
                        }
                        Ok(_) => {}
                        Err(_) => apart = false,
                    }
                });
                next += 1;
            }
            if apart {
                crumbs.extend(part.into_iter().map(|i| own[i]));
            }
        }
        for &at in &crumbs {
            self.scene.take(at);
        }
        crumbs.len() as u64
    }
}

#[cfg(test)]
mod tests;

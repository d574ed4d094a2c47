//! Thinning to a skeleton after Lee, Kashyap and Chu (1994).
//!
//! A round takes the border voxels of the six sides in turn. Of each side, those that are simple
//! and no end are collected from the state before it; then they are looked at again one by one, and
//! removed if they still may go. Rounds end when nothing is removed.
//!
//! The strict method looks again at one subfield after another: the voxels of equal parity of z, y
//! and x, none of which touch. In C order, which the old method keeps to, a strip of two voxels is
//! eaten from its first end to its last in one pass, each voxel being simple when its turn comes.
//!
//! A voxel that may not go is settled until one of its neighbours is removed, so that a pass looks
//! only at the open voxels of the border. Planes of equal parity are independent of each other. In C
//! order they run in a wavefront: each row waits for the rows before it that it sees.

use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use ndarray::{ArrayView3, ArrayViewMut3};
use rayon::prelude::*;

use super::bit_rows::{Around, BITS, Layout, pack, unpack};
use super::simple_point::{CONNECTED, Memory, SIMPLE, Word, is_curve_end, is_surface_end};
use crate::bits::ones;
use crate::error::{Error, Result};
use crate::monitor::Monitor;

/// What a skeleton keeps of the shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Ends of curves: voxels with one neighbour.
    Curve,
    /// Ends of surfaces: voxels with void at two opposite faces (Palágyi 2008).
    Surface,
}

impl std::str::FromStr for Kind {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        match name {
            "curve" => Ok(Self::Curve),
            "surface" => Ok(Self::Surface),
            _ => Err(Error::parameter("kind", name, "must be 'curve' or 'surface'")),
        }
    }
}

/// The second look.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// By subfields, whether the voxel is simple: the topology stays, and no part vanishes.
    Strict,
    /// In C order, only whether the neighbours hang together, as other programs do: parts of even
    /// thickness may vanish, and tunnels and cavities change.
    Lee,
}

impl std::str::FromStr for Method {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        match name {
            "strict" => Ok(Self::Strict),
            "lee" => Ok(Self::Lee),
            _ => Err(Error::parameter("method", name, "must be 'strict' or 'lee'")),
        }
    }
}

/// Thins the true voxels and writes what is left into `skeleton`, which must be false. What lies
/// beyond the border is void. A volume that is one voxel thick is thinned in its plane.
///
/// Peak memory: ½ byte a voxel, and 16 or 32 MB for remembered neighbourhoods.
pub fn thin(
    solid: ArrayView3<'_, bool>,
    kind: Kind,
    method: Method,
    skeleton: ArrayViewMut3<'_, bool>,
    monitor: &Monitor<'_>,
) -> Result<()> {
    if skeleton.dim() != solid.dim() {
        return Err(Error::parameter("skeleton.shape", skeleton.dim(), "must be the volume's"));
    }
    let layout = Layout::of(solid.dim());
    let open = pack(solid, &layout, monitor)?;
    let words = open.iter().map(|&word| AtomicU64::new(word)).collect();
    let thinning = Thinning { solid: words, layout, rules: Rules::new(kind, method), monitor };
    let (nz, ny, nx) = solid.dim();
    let flat = [nz == 1, ny == 1 && method == Method::Strict, nx == 1 && method == Method::Strict];
    thinning.run(open, flat)?;
    unpack(&thinning.solid, &layout, skeleton);
    Ok(())
}

/// Which voxels may go.
struct Rules {
    kind: Kind,
    method: Method,
    simple: &'static Memory,
    connected: &'static Memory,
}

impl Rules {
    fn new(kind: Kind, method: Method) -> Self {
        // Each memory is made when it is first asked for, and only the old method needs the second.
        let connected = if method == Method::Lee { &*CONNECTED } else { &*SIMPLE };
        Self { kind, method, simple: &SIMPLE, connected }
    }

    #[inline(always)]
    fn may_go(&self, neighbours: Word) -> bool {
        let end = match self.kind {
            Kind::Curve => is_curve_end(neighbours),
            Kind::Surface => is_surface_end(neighbours),
        };
        !end && self.simple.ask(neighbours)
    }

    #[inline(always)]
    fn may_still_go(&self, neighbours: Word) -> bool {
        match self.method {
            Method::Strict => self.simple.ask(neighbours),
            Method::Lee => self.connected.ask(neighbours),
        }
    }
}

/// The sides in the order of a round: along y, x, z.
const SIDES: [Side; 6] = [
    Side { axis: 1, up: false },
    Side { axis: 1, up: true },
    Side { axis: 2, up: true },
    Side { axis: 2, up: false },
    Side { axis: 0, up: true },
    Side { axis: 0, up: false },
];

#[derive(Clone, Copy)]
struct Side {
    axis: usize,
    up: bool,
}

/// Voxels found in one pass: candidates at first, then those of them that were removed.
struct Found {
    bits: Vec<u64>,
    /// Whether a row has any.
    rows: Vec<bool>,
}

impl Found {
    fn none(layout: &Layout) -> Self {
        Self { bits: vec![0; layout.len()], rows: vec![false; layout.rows * layout.planes] }
    }
}

/// What is left to look at.
struct Open {
    /// Voxels that have not been looked at since a neighbour of theirs was removed.
    bits: Vec<u64>,
    /// Sides from which a row may have open voxels.
    sides: Vec<u8>,
}

/// Number of rows done in a plane, on a cache line of its own.
#[repr(align(64))]
struct Done(AtomicUsize);

/// Rows between two notes of how far a plane is done: a note costs a trip between two cores.
const NOTE: usize = 8;
/// The voxels of a word at even places.
const EVEN: u64 = 0x5555_5555_5555_5555;
/// Candidates for which waking the other threads pays.
const WORTH_SHARING: usize = 2048;

struct Thinning<'a> {
    solid: Vec<AtomicU64>,
    layout: Layout,
    rules: Rules,
    monitor: &'a Monitor<'a>,
}

impl Thinning<'_> {
    fn run(&self, open: Vec<u64>, flat: [bool; 3]) -> Result<()> {
        let layout = &self.layout;
        let mut open = Open { bits: open, sides: vec![0xff; layout.rows * layout.planes] };
        let mut removed = Found::none(layout);
        let mut found = Found::none(layout);
        loop {
            let mut changed = false;
            for (number, side) in SIDES.iter().enumerate().filter(|(_, s)| !flat[s.axis]) {
                let candidates = self.collect(number, *side, &removed, &mut open, &mut found)?;
                changed |= self.remove(&candidates, &mut found)?;
                std::mem::swap(&mut removed, &mut found);
            }
            if !changed {
                return Ok(());
            }
        }
    }

    /// Opens the voxels next to those removed in the last pass, and finds the candidates of a side.
    /// Returns how many each plane has.
    fn collect(
        &self,
        number: usize,
        side: Side,
        removed: &Found,
        open: &mut Open,
        found: &mut Found,
    ) -> Result<Vec<usize>> {
        let Layout { rows, words, .. } = self.layout;
        let plane = self.layout.plane();
        let planes = (found.bits[1..].par_chunks_exact_mut(plane))
            .zip(found.rows.par_chunks_exact_mut(rows))
            .zip(open.bits[1..].par_chunks_exact_mut(plane))
            .zip(open.sides.par_chunks_exact_mut(rows));
        let count = |z: usize, (((found, any), open), sides): (_, &mut [u8])| {
            let (found, any, open): (&mut [u64], &mut [bool], &mut [u64]) = (found, any, open);
            if z == 0 || z + 1 == self.layout.planes {
                return Ok(0);
            }
            self.monitor.check()?;
            let mut count = 0;
            let changed = |y: usize| {
                let flags = &removed.rows[..];
                flags[(z - 1) * rows + y] | flags[z * rows + y] | flags[(z + 1) * rows + y]
            };
            let mut near = [false, changed(0), changed(1)];
            for y in 1..rows - 1 {
                near = [near[1], near[2], changed(y + 1)];
                let row = y * words..(y + 1) * words;
                let (found, open) = (&mut found[row.clone()], &mut open[row]);
                if near[0] | near[1] | near[2] {
                    self.reopen(z, y, removed, open);
                    sides[y] = 0xff;
                }
                if any[y] {
                    found.fill(0);
                    any[y] = false;
                }
                if sides[y] >> number & 1 == 1 {
                    sides[y] &= !(1 << number);
                    let more = self.collect_row(side, self.layout.at(z, y), open, found);
                    any[y] = more > 0;
                    count += more;
                }
            }
            Ok(count)
        };
        planes.enumerate().map(|(z, parts)| count(z, parts)).collect()
    }

    /// Opens the voxels of a row that have a removed neighbour.
    fn reopen(&self, z: usize, y: usize, removed: &Found, open: &mut [u64]) {
        let words = self.layout.words;
        let mut near: [&[u64]; 9] = [&[]; 9];
        let mut count = 0;
        for z in z - 1..=z + 1 {
            for y in y - 1..=y + 1 {
                if removed.rows[z * self.layout.rows + y] {
                    let at = self.layout.at(z, y);
                    near[count] = &removed.bits[at..at + words];
                    count += 1;
                }
            }
        }
        let any = |word: usize| near[..count].iter().fold(0, |any, row| any | row[word]);
        let (mut before, mut own) = (0, any(0));
        for (word, open) in open.iter_mut().enumerate() {
            let behind = if word + 1 < words { any(word + 1) } else { 0 };
            *open |= own | own << 1 | own >> 1 | before >> (BITS - 1) | behind << (BITS - 1);
            (before, own) = (own, behind);
        }
    }

    /// Finds the candidates of a row and settles the voxels that may not go.
    fn collect_row(&self, side: Side, at: usize, open: &mut [u64], found: &mut [u64]) -> usize {
        let solid = |at: usize| self.solid[at].load(Ordering::Relaxed);
        let step = [self.layout.plane(), self.layout.words, 0][side.axis];
        let mut count = 0;
        for (at, (open, found)) in (at..).zip(open.iter_mut().zip(found)) {
            let own = solid(at);
            if own & *open == 0 {
                continue;
            }
            let beyond = match (side.axis, side.up) {
                (2, true) => own >> 1 | solid(at + 1) << (BITS - 1),
                (2, false) => own << 1 | solid(at - 1) >> (BITS - 1),
                (_, true) => solid(at + step),
                (_, false) => solid(at - step),
            };
            let border = own & *open & !beyond;
            if border != 0 {
                let around = Around::new(&self.solid, &self.layout, at);
                let mut settled = 0;
                for bit in ones(border) {
                    let stays = !self.rules.may_go(around.neighbourhood(bit));
                    settled |= u64::from(stays) << bit;
                }
                *open &= !settled;
                *found = border & !settled;
                count += found.count_ones() as usize;
            }
        }
        count
    }

    /// Removes the candidates that still may go, and takes the others out of `found`. Returns
    /// whether any was removed.
    fn remove(&self, candidates: &[usize], found: &mut Found) -> Result<bool> {
        let all: usize = candidates.iter().sum();
        if all == 0 {
            return Ok(false);
        }
        let any = match self.rules.method {
            Method::Strict => self.remove_by_subfields(candidates, found),
            Method::Lee => self.remove_in_c_order(candidates, found, all >= WORTH_SHARING),
        };
        self.monitor.check()?;
        Ok(any)
    }

    fn remove_by_subfields(&self, candidates: &[usize], found: &mut Found) -> bool {
        let any = AtomicBool::new(false);
        for parity in 0..2 {
            let planes = (found.bits[1..].par_chunks_exact_mut(self.layout.plane()))
                .zip(found.rows.par_chunks_exact_mut(self.layout.rows))
                .enumerate();
            planes.for_each(|(z, (found, rows))| {
                if z % 2 == parity && candidates[z] > 0 && self.monitor.check().is_ok() {
                    let mut removed = false;
                    for parity in 0..2 {
                        for y in (parity..rows.len()).step_by(2) {
                            removed |=
                                rows[y] && self.remove_in_row(z, y, found, rows, &[EVEN, !EVEN]);
                        }
                    }
                    if removed {
                        any.store(true, Ordering::Relaxed);
                    }
                }
            });
        }
        any.into_inner()
    }

    /// With the result of one thread that takes candidate by candidate in C order.
    fn remove_in_c_order(&self, candidates: &[usize], found: &mut Found, share: bool) -> bool {
        let rows = self.layout.rows;
        let done: Vec<Done> = (candidates.iter())
            .map(|&n| Done(AtomicUsize::new(if n == 0 { usize::MAX } else { 0 })))
            .collect();
        let planes = (found.bits[1..].chunks_exact_mut(self.layout.plane()))
            .zip(found.rows.chunks_exact_mut(rows))
            .enumerate()
            .filter(|&(z, _)| candidates[z] > 0);
        // Planes are given out in order: the one that a thread waits for is always being worked at.
        let planes = Mutex::new(planes);
        let any = AtomicBool::new(false);
        let work = || {
            loop {
                let next = planes.lock().unwrap_or_else(PoisonError::into_inner).next();
                let Some((z, (found, rows))) = next else { return };
                if self.monitor.check().is_ok() && self.remove_in_wave(z, &done, found, rows) {
                    any.store(true, Ordering::Relaxed);
                }
                done[z].0.store(usize::MAX, Ordering::Release);
            }
        };
        if share {
            // A helper that comes too late finds nothing to do, and nobody waits for it.
            rayon::scope(|scope| {
                for _ in 1..rayon::current_num_threads() {
                    scope.spawn(|_| work());
                }
                work();
            });
        } else {
            work();
        }
        any.load(Ordering::Relaxed)
    }

    fn remove_in_wave(
        &self,
        z: usize,
        done: &[Done],
        found: &mut [u64],
        rows: &mut [bool],
    ) -> bool {
        let mut any = false;
        let mut below = 0;
        for y in 0..rows.len() {
            if y.is_multiple_of(NOTE) {
                done[z].0.store(y, Ordering::Release);
            }
            if rows[y] {
                // The row sees the rows up to y + 1 of the plane below.
                let mut waited = 0;
                while below < y + 2 {
                    below = done[z - 1].0.load(Ordering::Acquire);
                    waited += 1;
                    if waited > 1000 {
                        std::thread::yield_now();
                    } else {
                        std::hint::spin_loop();
                    }
                }
                any |= self.remove_in_row(z, y, found, rows, &[u64::MAX]);
            }
        }
        any
    }

    /// Looks again at the candidates of row y of a plane, those of one mask after another.
    fn remove_in_row(
        &self,
        z: usize,
        y: usize,
        found: &mut [u64],
        rows: &mut [bool],
        masks: &[u64],
    ) -> bool {
        let words = self.layout.words;
        let found = &mut found[y * words..(y + 1) * words];
        for mask in masks {
            for (at, found) in (self.layout.at(z, y)..).zip(found.iter_mut()) {
                let candidates = *found & mask;
                if candidates == 0 {
                    continue;
                }
                let mut around = Around::new(&self.solid, &self.layout, at);
                let mut gone = 0;
                for bit in ones(candidates) {
                    if self.rules.may_still_go(around.neighbourhood(bit)) {
                        around.clear(bit);
                        gone |= 1 << bit;
                    }
                }
                let left = self.solid[at].load(Ordering::Relaxed) & !gone;
                self.solid[at].store(left, Ordering::Relaxed);
                *found = *found & !mask | gone;
            }
        }
        rows[y] = found.iter().any(|&gone| gone != 0);
        rows[y]
    }
}

#[cfg(test)]
mod tests;

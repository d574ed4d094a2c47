//! Painting blocks of a volume with balls, thickest first.

use multiversion::multiversion;
use ndarray::{ArrayView3, ArrayViewMut3, Axis, s};

use super::Space;
use super::balls::{Balls, Cells, Extent};
use crate::error::Result;
use crate::monitor::Monitor;

/// Edge of the tiles that are worked on in parallel, in voxels.
pub(super) const TILE: usize = 32;

/// Edge of the blocks whose voxels are compared with every ball that reaches them.
const BLOCK: usize = 8;

const LANES: usize = 16;

/// Cuts a volume into tiles, each with the place of its first voxel.
pub(super) fn tiles(
    out: ArrayViewMut3<'_, f32>,
    edge: usize,
) -> Vec<([usize; 3], ArrayViewMut3<'_, f32>)> {
    let mut tiles = vec![([0; 3], out)];
    for axis in 0..3 {
        let mut cut = Vec::new();
        for (mut origin, mut rest) in tiles {
            while rest.len_of(Axis(axis)) > edge {
                let (tile, others) = rest.split_at(Axis(axis), edge);
                cut.push((origin, tile));
                origin[axis] += edge;
                rest = others;
            }
            cut.push((origin, rest));
        }
        tiles = cut;
    }
    tiles
}

/// Writes the thickness of a tile.
pub(super) fn fill(
    cells: &Cells,
    phase: ArrayView3<'_, bool>,
    space: &Space,
    origin: [usize; 3],
    mut out: ArrayViewMut3<'_, f32>,
    monitor: &Monitor<'_>,
) -> Result<()> {
    monitor.check()?;
    out.fill(0.0);
    let (z, y, x) = out.dim();
    let phase = phase.slice(s![
        origin[0]..origin[0] + z,
        origin[1]..origin[1] + y,
        origin[2]..origin[2] + x
    ]);
    if phase.iter().any(|&inside| inside) {
        let balls = cells.reaching(&extent(space, origin, out.dim()));
        split(&balls, phase, space, origin, out, TILE, monitor)?;
    }
    Ok(())
}

fn extent(space: &Space, origin: [usize; 3], shape: (usize, usize, usize)) -> Extent {
    let shape = [shape.0, shape.1, shape.2];
    let place = |axis: usize, voxel: usize| (voxel as f64 * space.size[axis]) as f32;
    Extent {
        low: [0, 1, 2].map(|axis| place(axis, origin[axis])),
        high: [0, 1, 2].map(|axis| place(axis, origin[axis] + shape[axis] - 1)),
    }
}

/// Halves a block until it is small enough to paint; each part keeps the balls that reach it.
fn split(
    balls: &Balls,
    phase: ArrayView3<'_, bool>,
    space: &Space,
    origin: [usize; 3],
    out: ArrayViewMut3<'_, f32>,
    edge: usize,
    monitor: &Monitor<'_>,
) -> Result<()> {
    if edge <= BLOCK {
        Points::new(phase, space, origin).paint(balls, out);
        return Ok(());
    }
    for (offset, out) in tiles(out, edge / 2) {
        monitor.check()?;
        let (z, y, x) = out.dim();
        let [dz, dy, dx] = offset;
        let phase = phase.slice(s![dz..dz + z, dy..dy + y, dx..dx + x]);
        if phase.iter().any(|&inside| inside) {
            let origin = [0, 1, 2].map(|axis| origin[axis] + offset[axis]);
            let balls = balls.reaching(&extent(space, origin, out.dim()));
            split(&balls, phase, space, origin, out, edge / 2, monitor)?;
        }
    }
    Ok(())
}

/// Voxels of a block that are in the phase and may still wait for a ball.
struct Points {
    z: [f32; BLOCK.pow(3)],
    y: [f32; BLOCK.pow(3)],
    x: [f32; BLOCK.pow(3)],
    /// Diameter of the ball that came, 0 before.
    value: [f32; BLOCK.pow(3)],
    /// Where in the block they are.
    place: [[u8; 3]; BLOCK.pow(3)],
    len: usize,
}

impl Points {
    fn new(phase: ArrayView3<'_, bool>, space: &Space, origin: [usize; 3]) -> Self {
        let mut points = Self {
            z: [0.0; BLOCK.pow(3)],
            y: [0.0; BLOCK.pow(3)],
            x: [0.0; BLOCK.pow(3)],
            value: [0.0; BLOCK.pow(3)],
            place: [[0; 3]; BLOCK.pow(3)],
            len: 0,
        };
        let at = |axis: usize, i: usize| ((origin[axis] + i) as f64 * space.size[axis]) as f32;
        for ((z, y, x), _) in phase.indexed_iter().filter(|(_, inside)| **inside) {
            let i = points.len;
            (points.z[i], points.y[i], points.x[i]) = (at(0, z), at(1, y), at(2, x));
            points.place[i] = [z, y, x].map(|i| i as u8);
            points.len += 1;
        }
        points.pad();
        points
    }

    /// Fills the last lanes with points that no ball reaches.
    fn pad(&mut self) {
        let end = self.len.next_multiple_of(LANES).min(self.x.len());
        self.x[self.len..end].fill(f32::INFINITY);
        self.value[self.len..end].fill(1.0);
    }

    /// Gives each point the diameter of the first ball that holds it.
    fn paint(mut self, balls: &Balls, mut out: ArrayViewMut3<'_, f32>) {
        let mut waiting = self.len;
        let mut next = 0;
        while waiting > 0 && next < balls.reach.len() {
            (next, waiting) = paint_some(&mut self, balls, next, waiting);
            self.keep_waiting(&mut out);
        }
    }

    /// Writes out the points that have their ball, and forgets them.
    fn keep_waiting(&mut self, out: &mut ArrayViewMut3<'_, f32>) {
        let mut kept = 0;
        for i in 0..self.len {
            if self.value[i] > 0.0 {
                out[self.place[i].map(usize::from)] = self.value[i];
            } else {
                (self.z[kept], self.y[kept], self.x[kept]) = (self.z[i], self.y[i], self.x[i]);
                self.place[kept] = self.place[i];
                self.value[kept] = 0.0;
                kept += 1;
            }
        }
        self.len = kept;
        self.pad();
    }
}

/// Paints until at most half of the points wait. Returns the next ball and how many wait.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn paint_some(points: &mut Points, balls: &Balls, from: usize, waiting: usize) -> (usize, usize) {
    let mut waiting = waiting;
    let len = points.len.next_multiple_of(LANES).min(points.x.len());
    let (z, y, x) = (&points.z[..len], &points.y[..len], &points.x[..len]);
    let value = &mut points.value[..len];
    for ball in from..balls.reach.len() {
        let (at_z, at_y, at_x) = (balls.z[ball], balls.y[ball], balls.x[ball]);
        let (reach, diameter) = (balls.reach[ball], balls.diameter[ball]);
        let mut hits = 0;
        for i in 0..len {
            let (dz, dy, dx) = (z[i] - at_z, y[i] - at_y, x[i] - at_x);
            let inside = dz * dz + dy * dy + dx * dx < reach;
            let hit = inside && value[i] == 0.0;
            value[i] = if hit { diameter } else { value[i] };
            hits += u32::from(hit);
        }
        waiting -= hits as usize;
        if 2 * waiting <= points.len {
            return (ball + 1, waiting);
        }
    }
    (balls.reach.len(), waiting)
}

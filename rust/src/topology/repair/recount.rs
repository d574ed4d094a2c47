//! The number of voxels of a phase, restored along its surface.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::scene::Scene;
use crate::error::Result;
use crate::monitor::Monitor;
use crate::rng::Key;

/// Order among equal scores: in no direction.
const TIES: Key = Key::new(0);
/// Voxels between two looks at the monitor.
const OFTEN: usize = 1 << 12;

/// Takes the lowest scores from the surface of the phase, but not from bridges, or adds the highest
/// outside, until it has the wanted number of voxels. Only simple voxels change, one after another, so
/// that the topology stays. Returns how many voxels are missing at the end.
pub(super) fn restore(scene: &mut Scene<'_>, wanted: usize, monitor: &Monitor<'_>) -> Result<i64> {
    let size = scene.size();
    let add = size < wanted;
    let mut left = size.abs_diff(wanted);
    if left == 0 {
        return Ok(0);
    }
    let mut queue: BinaryHeap<_> = (0..scene.len())
        .filter(|&at| may_change(scene, at, add))
        .map(|at| turn(scene, at, add))
        .collect();
    let mut turns = 0;
    while left > 0
        && let Some(Reverse((.., at))) = queue.pop()
    {
        turns += 1;
        if turns % OFTEN == 0 {
            monitor.check()?;
        }
        if !may_change(scene, at, add) || !scene.simple(at) {
            continue;
        }
        if add {
            scene.add(at);
        } else {
            scene.take(at);
        }
        left -= 1;
        // Those that came to lie at the surface, and those that are simple now.
        scene.grid.for_each(at, &scene.around, |_, to| {
            if may_change(scene, to, add) {
                queue.push(turn(scene, to, add));
            }
        });
    }
    Ok(if add { left as i64 } else { -(left as i64) })
}

/// Whether a voxel may be added, or taken: it is free and at the surface.
fn may_change(scene: &Scene<'_>, at: usize, add: bool) -> bool {
    if !scene.free(at) || scene.phase(at) == add || scene.bridge(at) {
        return false;
    }
    let mut surface = false;
    scene.grid.for_each(at, &scene.faces, |_, to| surface |= scene.phase(to) == add);
    surface
}

/// When a voxel has its turn: the lowest first.
fn turn(scene: &Scene<'_>, at: usize, add: bool) -> Reverse<(u32, u64, usize)> {
    let bits = scene.score[at].to_bits();
    let rising = if bits >> 31 == 0 { bits | 1 << 31 } else { !bits };
    Reverse((if add { !rising } else { rising }, TIES.bits(at as u64), at))
}

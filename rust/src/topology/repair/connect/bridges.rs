//! Bridges between the components of a phase: the cheapest that make them one.
//!
//! The smallest component grows over the free voxels (Dijkstra) until no way to another component can
//! be cheaper than the one found, and is joined to that; then the smallest of what is left grows, and
//! so on. The cheapest way out of a component belongs to a minimum spanning tree (Borůvka), bridges
//! count as parts of what they joined, and growths stay small: the largest component never grows.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::queue::Queue;
use crate::error::Result;
use crate::monitor::Monitor;
use crate::topology::repair::scene::Scene;

/// Toll of a voxel's length at the cut, in mean distances of the scores from the cut: enough that
/// bridges are straight in flat ground, too little for one to leave a valley.
const LENGTH: f32 = 0.1;
/// Voxels between two looks at the monitor.
const OFTEN: usize = 1 << 12;

/// What it costs to pass a voxel outside the phase.
#[derive(Clone, Copy)]
pub(super) struct Toll {
    cut: f32,
    unit: f32,
}

impl Toll {
    /// From the scores of the free voxels: the cut leaves as many above as the phase has.
    pub(super) fn new(scene: &Scene<'_>) -> Self {
        let free = || (0..scene.len()).filter(|&at| scene.free(at));
        let mut scores: Vec<f32> = free().map(|at| scene.score[at]).collect();
        let inside = free().filter(|&at| scene.phase(at)).count();
        let Some(last) = scores.len().checked_sub(1) else { return Self { cut: 0.0, unit: 1.0 } };
        let place = (scores.len() - inside).min(last);
        let cut = *scores.select_nth_unstable_by(place, f32::total_cmp).1;
        let sum: f64 = free().map(|at| f64::from((scene.score[at] - cut).abs())).sum();
        let unit = (sum / scores.len() as f64) as f32;
        Self { cut, unit: if unit > 0.0 { unit } else { 1.0 } }
    }

    fn of(self, score: f32) -> f32 {
        (self.cut - score).max(0.0) / self.unit + LENGTH
    }
}

/// A voxel that the growth of this number has come to.
#[derive(Clone, Copy)]
struct Reached {
    cost: f32,
    growth: u32,
}

/// A way to another component: from a voxel of the growth to one of the phase.
#[derive(Clone, Copy)]
struct Way {
    cost: f32,
    from: usize,
    to: usize,
}

/// The growth of one component after another.
struct Growth<'a, 's> {
    scene: &'a mut Scene<'s>,
    toll: Toll,
    /// Component, from 1 on, of each voxel of the phase.
    labels: Vec<u32>,
    /// The component that a component was joined to; itself if to none.
    joined_to: Vec<u32>,
    /// Voxels of the islands, and of what was joined to them.
    islands: Vec<Vec<usize>>,
    main: u32,
    reached: Vec<Reached>,
    /// Number of the step that led to each voxel.
    steps: Vec<u8>,
    /// The growth that is going on.
    number: u32,
    frontier: Queue,
    best: Way,
    path: Vec<usize>,
    joined: usize,
}

/// Joins the labelled components to the largest. Returns the voxels of the bridges, and how many
/// components were joined to another.
pub(super) fn join(
    scene: &mut Scene<'_>,
    labels: Vec<u32>,
    largest: u32,
    toll: Toll,
    monitor: &Monitor<'_>,
) -> Result<(Vec<usize>, usize)> {
    let components = labels.iter().max().map_or(0, |&most| most as usize);
    let mut islands = vec![Vec::new(); components + 1];
    for (at, &label) in labels.iter().enumerate() {
        if label > 0 && label != largest {
            islands[label as usize].push(at);
        }
    }
    let mut growth = Growth {
        toll,
        joined_to: (0..=components as u32).collect(),
        islands,
        main: largest,
        reached: vec![Reached { cost: 0.0, growth: 0 }; labels.len()],
        steps: vec![0; labels.len()],
        number: 0,
        frontier: Queue::default(),
        best: NOWHERE,
        path: Vec::new(),
        joined: 0,
        labels,
        scene,
    };
    growth.run(monitor)?;
    Ok((growth.path, growth.joined))
}

const NOWHERE: Way = Way { cost: f32::INFINITY, from: 0, to: 0 };

impl Growth<'_, '_> {
    fn run(&mut self, monitor: &Monitor<'_>) -> Result<()> {
        let sizes = self.islands.iter().map(Vec::len).zip(0..);
        let mut queue: BinaryHeap<_> = sizes.filter(|&(size, _)| size > 0).map(Reverse).collect();
        while let Some(Reverse((size, island))) = queue.pop() {
            // It may have been joined to another, or another to it.
            if self.islands[island as usize].len() != size {
                continue;
            }
            self.grow(island, monitor)?;
            if self.best.cost < f32::INFINITY {
                let whole = self.lay(island);
                if whole != self.main {
                    queue.push(Reverse((self.islands[whole as usize].len(), whole)));
                }
            }
        }
        Ok(())
    }

    /// Finds the cheapest way from an island to anything else.
    fn grow(&mut self, island: u32, monitor: &Monitor<'_>) -> Result<()> {
        self.number += 1;
        self.best = NOWHERE;
        self.frontier.clear();
        let voxels = std::mem::take(&mut self.islands[island as usize]);
        for &at in &voxels {
            self.spread(island, at, 0.0, 0.0);
        }
        self.islands[island as usize] = voxels;
        let mut turns = 0;
        while let Some((cost, at)) = self.frontier.pop()
            && cost < self.best.cost
        {
            turns += 1;
            if turns % OFTEN == 0 {
                monitor.check()?;
            }
            // Not if a cheaper way there was found after this one.
            if cost <= self.reached[at].cost {
                self.spread(island, at, cost, self.toll.of(self.scene.score[at]));
            }
        }
        monitor.check()
    }

    /// Reaches out from a voxel to which no way can be cheaper.
    fn spread(&mut self, island: u32, from: usize, cost: f32, toll: f32) {
        let scene = &*self.scene;
        scene.grid.for_each(from, &scene.touching, |number, to| {
            let half = scene.touching[number].length / 2.0;
            if scene.phase(to) {
                let cost = cost + half * toll;
                if cost < self.best.cost && root(&self.joined_to, self.labels[to]) != island {
                    self.best = Way { cost, from, to };
                }
            } else if scene.free(to) {
                let cost = cost + half * (toll + self.toll.of(scene.score[to]));
                let there = self.reached[to];
                if there.growth != self.number || cost < there.cost {
                    self.reached[to] = Reached { cost, growth: self.number };
                    self.steps[to] = number as u8;
                    self.frontier.push(cost, to);
                }
            }
        });
    }

    /// Lays a bridge along the best way. Returns the component that the island is now part of.
    fn lay(&mut self, island: u32) -> u32 {
        let Way { mut from, to, .. } = self.best;
        let first = self.path.len();
        while !self.scene.phase(from) {
            self.scene.add_bridge(from);
            self.labels[from] = island;
            self.path.push(from);
            from = self.back(from);
        }
        self.islands[island as usize].extend_from_slice(&self.path[first..]);
        let mut whole = self.unite(island, self.labels[to]);
        for i in first..self.path.len() {
            whole = self.touch(whole, self.path[i]);
        }
        whole
    }

    /// Where the growth came from.
    fn back(&self, at: usize) -> usize {
        let Scene { grid, touching, .. } = &*self.scene;
        let step = &touching[touching.len() - 1 - usize::from(self.steps[at])];
        // A way there is a way back.
        grid.after(at, step).unwrap_or(at)
    }

    /// Joins what a bridge touches on its way.
    fn touch(&mut self, mut whole: u32, at: usize) -> u32 {
        let mut others = Vec::new();
        self.scene.grid.for_each(at, &self.scene.touching, |_, to| {
            if self.scene.phase(to) {
                others.push(self.labels[to]);
            }
        });
        for other in others {
            whole = self.unite(whole, other);
        }
        whole
    }

    /// Makes one of two components, of which the first stands for all that was joined to it. Returns
    /// the one that stands for both.
    fn unite(&mut self, one: u32, other: u32) -> u32 {
        let other = root(&self.joined_to, other);
        if one == other {
            return one;
        }
        let size = |label: u32| (label == self.main, self.islands[label as usize].len());
        let [whole, part] = if size(one) > size(other) { [one, other] } else { [other, one] };
        self.joined += 1;
        self.joined_to[part as usize] = whole;
        let voxels = std::mem::take(&mut self.islands[part as usize]);
        if whole != self.main {
            self.islands[whole as usize].extend(voxels);
        }
        whole
    }
}

/// What a component is part of: a few steps away, because the smaller is joined to the larger.
fn root(joined_to: &[u32], mut label: u32) -> u32 {
    while joined_to[label as usize] != label {
        label = joined_to[label as usize];
    }
    label
}

/// Makes the bridges along a path as thick as `width`, shell by shell, by free voxels that change
/// nothing else: no handle appears where a bridge comes near another part.
pub(super) fn thicken(
    scene: &mut Scene<'_>,
    path: &[usize],
    width: f64,
    monitor: &Monitor<'_>,
) -> Result<()> {
    for step in scene.grid.ball(width / 2.0) {
        monitor.check()?;
        for &at in path {
            if let Some(to) = scene.grid.after(at, &step)
                && scene.free(to)
                && !scene.phase(to)
                && scene.simple(to)
            {
                scene.add_bridge(to);
            }
        }
    }
    Ok(())
}

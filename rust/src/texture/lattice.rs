//! The sparse grid of windows that a pass looks at, and its relation to the grid of another pass.

use crate::volume::{Boundary, Shape};

/// Window origins along each axis; their product is the set of sites.
#[derive(Debug, Clone, PartialEq)]
pub struct Lattice {
    /// Shape of the volume that is covered.
    pub shape: Shape,
    /// Edges of the window.
    pub window: Shape,
    /// What lies beyond the border.
    pub boundary: Boundary,
    /// Window origins along (z, y, x), ascending.
    pub origins: [Vec<usize>; 3],
}

impl Lattice {
    /// Windows every `step` voxels, the first at `step - shift`; every voxel is covered.
    ///
    /// With an open boundary the outermost windows are pushed inside.
    pub fn new(
        shape: Shape,
        window: Shape,
        step: Shape,
        shift: [usize; 3],
        boundary: Boundary,
    ) -> Self {
        let origins = std::array::from_fn(|axis| {
            let (n, window, step) = (shape[axis], window[axis], step[axis]);
            let shift = shift[axis] % step;
            let mut list: Vec<usize> = match boundary {
                Boundary::Open => (0..=n.div_ceil(step))
                    .map(|k| (k * step).saturating_sub(shift))
                    .take_while(|&o| o + window < n + step)
                    .map(|o| o.min(n.saturating_sub(window)))
                    .collect(),
                Boundary::Periodic => {
                    let count = n.div_ceil(step);
                    (0..count).map(|k| (k * n / count + shift) % n).collect()
                }
            };
            list.sort_unstable();
            list.dedup();
            list
        });
        Self { shape, window, boundary, origins }
    }

    /// Number of sites along (z, y, x).
    pub fn sites(&self) -> Shape {
        std::array::from_fn(|a| self.origins[a].len())
    }

    /// Number of windows that cover each coordinate of an axis.
    pub fn coverage(&self, axis: usize) -> Vec<u32> {
        let n = self.shape[axis];
        let mut counts = vec![0; n];
        for &origin in &self.origins[axis] {
            for i in 0..self.window[axis] {
                counts[(origin + i) % n] += 1;
            }
        }
        counts
    }

    /// The same lattice on a grid of twice the resolution, for a volume of this shape.
    #[must_use]
    pub fn doubled(&self, shape: Shape) -> Self {
        Self {
            shape,
            window: self.window.map(|w| 2 * w),
            boundary: self.boundary,
            origins: std::array::from_fn(|a| self.origins[a].iter().map(|o| 2 * o).collect()),
        }
    }
}

/// A site of another lattice, seen from a site: its index along the axis and the way to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Neighbour {
    /// Index along the axis in the other lattice.
    pub index: usize,
    /// Own origin minus the neighbour's, the short way round when periodic.
    pub step: i32,
}

/// Relation of one origin to another lattice along one axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Links {
    /// The nearest site, by window centres.
    pub own: Neighbour,
    /// The sites before and after it; `own` again at an open border.
    pub beside: [Neighbour; 2],
    /// The nearest sites `reach` voxels before and after; none beyond an open border.
    pub far: [Option<Neighbour>; 2],
}

/// Relations of every origin of `to` to the lattice `from`, along one axis.
pub fn links(to: &Lattice, from: &Lattice, axis: usize, reach: usize) -> Vec<Links> {
    let n = to.shape[axis] as i32;
    let origins = &from.origins[axis];
    let count = origins.len();
    let periodic = to.boundary == Boundary::Periodic;
    let short = |d: i32| if periodic { (d + n / 2).rem_euclid(n) - n / 2 } else { d };
    // Twice the distance of window centres, so that odd windows stay integer.
    let (window, before) = (to.window[axis] as i32, from.window[axis] as i32);
    let shift = before - window;
    let nearest = |origin: i32| {
        (0..count)
            .min_by_key(|&i| {
                let d = 2 * (origin - origins[i] as i32) - shift;
                if periodic { ((d + n).rem_euclid(2 * n) - n).abs() } else { d.abs() }
            })
            .unwrap_or(0)
    };
    to.origins[axis]
        .iter()
        .map(|&origin| {
            let origin = origin as i32;
            let at =
                |index: usize| Neighbour { index, step: short(origin - origins[index] as i32) };
            let own = nearest(origin);
            let beside = if periodic {
                [(own + count - 1) % count, (own + 1) % count]
            } else {
                [own.saturating_sub(1), (own + 1).min(count - 1)]
            };
            let far = [-(reach as i32), reach as i32].map(|r| {
                let place = origin + r;
                let inside = place >= 0 && place + window <= n;
                (periodic || inside)
                    .then(|| at(nearest(if periodic { place.rem_euclid(n) } else { place })))
            });
            Links { own: at(own), beside: beside.map(at), far }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_voxel_is_covered_at_any_shift() {
        for boundary in [Boundary::Open, Boundary::Periodic] {
            for n in [5, 8, 13, 20] {
                for (window, step) in [(4, 2), (5, 3), (5, 5), (4, 1)] {
                    for shift in 0..step {
                        let l = Lattice::new([n; 3], [window; 3], [step; 3], [shift; 3], boundary);
                        assert!(
                            l.coverage(0).iter().all(|&c| c > 0),
                            "{boundary:?} {n} {window} {step} {shift} {l:?}"
                        );
                        if boundary == Boundary::Open {
                            assert!(l.origins[0].iter().all(|o| o + window <= n));
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn links_of_a_lattice_to_itself_are_the_sites_themselves() {
        for boundary in [Boundary::Open, Boundary::Periodic] {
            let l = Lattice::new([20; 3], [4; 3], [2; 3], [1, 0, 1], boundary);
            for (i, link) in links(&l, &l, 0, 6).iter().enumerate() {
                assert_eq!(link.own, Neighbour { index: i, step: 0 });
            }
        }
    }

    #[test]
    fn far_links_lie_at_the_reach_and_wrap_only_when_periodic() {
        let open = Lattice::new([20; 3], [4; 3], [2; 3], [0; 3], Boundary::Open);
        let found = links(&open, &open, 0, 6);
        assert_eq!(found[0].far[0], None);
        assert_eq!(found[0].far[1], Some(Neighbour { index: 3, step: -6 }));
        let periodic = Lattice::new([20; 3], [4; 3], [2; 3], [0; 3], Boundary::Periodic);
        let found = links(&periodic, &periodic, 0, 6);
        assert_eq!(found[0].far[0], Some(Neighbour { index: 7, step: 6 }));
        assert_eq!(found[0].beside[0], Neighbour { index: 9, step: 2 });
    }
}

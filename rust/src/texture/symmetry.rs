//! The exemplar seen under the symmetries of the cube.

use crate::volume::Shape;

/// An orientation of the exemplar: axis `a` of the oriented volume runs along the exemplar's axis
/// `axes[a]`, backwards where `flip[a]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Orientation {
    axes: [usize; 3],
    flip: [bool; 3],
}

impl Orientation {
    /// The exemplar as it is.
    pub const IDENTITY: Self = Self { axes: [0, 1, 2], flip: [false; 3] };

    /// The orientations of an image, of shape (1, y, x), that lies perpendicular to the axis `normal`:
    /// its rows along the first of the other two axes and its columns along the second, then, if it is
    /// `symmetric`, the seven other ways to lay it there.
    pub fn of_plane(normal: usize, symmetric: bool) -> Vec<Self> {
        let [first, second] = [[1, 2], [0, 2], [0, 1]][normal];
        (0..if symmetric { 8u8 } else { 1 })
            .map(|bits| {
                let (mut axes, mut flip) = ([0; 3], [false; 3]);
                (axes[first], axes[second]) = if bits & 4 == 0 { (1, 2) } else { (2, 1) };
                (flip[first], flip[second]) = (bits & 1 != 0, bits & 2 != 0);
                Self { axes, flip }
            })
            .collect()
    }

    /// The oriented view of a volume of this shape.
    pub fn view(self, shape: Shape) -> View {
        let plain = [(shape[1] * shape[2]) as isize, shape[2] as isize, 1];
        let mut view = View { shape: [0; 3], base: 0, stride: [0; 3] };
        for a in 0..3 {
            let from = self.axes[a];
            view.shape[a] = shape[from];
            view.stride[a] = plain[from];
            if self.flip[a] {
                view.base += plain[from] * (shape[from] as isize - 1);
                view.stride[a] = -plain[from];
            }
        }
        view
    }

    /// Determinant of the signed permutation is +1.
    fn is_rotation(self) -> bool {
        let [a, b, c] = self.axes;
        let even = (b + 3 - a) % 3 == 1 && (c + 3 - b) % 3 == 1;
        even == self.flip.iter().filter(|&&f| f).count().is_multiple_of(2)
    }
}

/// Strides of an oriented volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct View {
    /// Shape after orientation.
    pub shape: Shape,
    base: isize,
    /// Step in the exemplar's memory along each axis.
    pub stride: [isize; 3],
}

impl View {
    /// Position in the exemplar's memory of a voxel of the oriented volume.
    pub const fn index(&self, [z, y, x]: [usize; 3]) -> usize {
        (self.base
            + z as isize * self.stride[0]
            + y as isize * self.stride[1]
            + x as isize * self.stride[2]) as usize
    }
}

/// Which symmetric copies of the exemplar are offered beside it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Symmetry {
    /// The exemplar only.
    None,
    /// The 8 mirror images along the axes.
    Flips,
    /// The 24 rotations of the cube.
    Rotations,
    /// All 48.
    Full,
}

impl std::str::FromStr for Symmetry {
    type Err = crate::error::Error;

    fn from_str(name: &str) -> crate::error::Result<Self> {
        match name {
            "none" => Ok(Self::None),
            "flips" => Ok(Self::Flips),
            "rotations" => Ok(Self::Rotations),
            "full" => Ok(Self::Full),
            _ => Err(crate::error::Error::parameter(
                "symmetry",
                name,
                "must be 'none', 'flips', 'rotations' or 'full'",
            )),
        }
    }
}

impl Symmetry {
    /// The orientations, the identity first. With `keep`, only those that map this axis to itself
    /// (either way round), for a material with a direction.
    pub fn orientations(self, keep: Option<usize>) -> Vec<Orientation> {
        const PERMUTATIONS: [[usize; 3]; 6] =
            [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
        PERMUTATIONS
            .iter()
            .flat_map(|&axes| {
                (0..8).map(move |bits| Orientation {
                    axes,
                    flip: [bits & 4 != 0, bits & 2 != 0, bits & 1 != 0],
                })
            })
            .filter(|o| match self {
                Self::None => *o == Orientation::IDENTITY,
                Self::Flips => o.axes == [0, 1, 2],
                Self::Rotations => o.is_rotation(),
                Self::Full => true,
            })
            .filter(|o| keep.is_none_or(|axis| o.axes[axis] == axis))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::voxels;

    #[test]
    fn group_sizes() {
        let count = |s: Symmetry, keep| s.orientations(keep).len();
        assert_eq!(count(Symmetry::None, None), 1);
        assert_eq!(count(Symmetry::Flips, None), 8);
        assert_eq!(count(Symmetry::Rotations, None), 24);
        assert_eq!(count(Symmetry::Full, None), 48);
        assert_eq!(count(Symmetry::Rotations, Some(0)), 8);
        assert_eq!(count(Symmetry::Full, Some(0)), 16);
        for s in [Symmetry::None, Symmetry::Flips, Symmetry::Rotations, Symmetry::Full] {
            assert_eq!(s.orientations(None)[0], Orientation::IDENTITY);
        }
    }

    #[test]
    fn an_image_lies_across_its_axis_in_one_way_or_in_eight() {
        let shape = [1, 5, 7];
        for (normal, across) in [(0, [1, 5, 7]), (1, [5, 1, 7]), (2, [5, 7, 1])] {
            let [first] = Orientation::of_plane(normal, false)[..] else { panic!("one way") };
            let view = first.view(shape);
            assert_eq!(view.shape, across);
            // Rows along the first of the other axes, columns along the second.
            let order: Vec<usize> = (0..35)
                .map(|i| {
                    let mut at = [0; 3];
                    let [a, b] = [[1, 2], [0, 2], [0, 1]][normal];
                    (at[a], at[b]) = (i / 7, i % 7);
                    view.index(at)
                })
                .collect();
            assert!(order.into_iter().eq(0..35));
            let all = Orientation::of_plane(normal, true);
            assert_eq!((all.len(), all[0]), (8, first));
            for (i, one) in all.iter().enumerate() {
                assert_eq!(one.view(shape).shape[normal], 1);
                assert!(!all[..i].contains(one));
            }
        }
    }

    #[test]
    fn every_view_visits_every_voxel_once_and_differs_from_the_others() {
        let shape = [2, 3, 4];
        let mut seen = std::collections::HashSet::new();
        for o in Symmetry::Full.orientations(None) {
            let view = o.view(shape);
            let [nz, ny, nx] = view.shape;
            let order: Vec<usize> = (0..nz)
                .flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [z, y, x])))
                .map(|p| view.index(p))
                .collect();
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert!(sorted.into_iter().eq(0..voxels(shape)));
            assert!(seen.insert((view.shape, order)));
        }
    }
}

//! Shapes, boundary rules and the few index helpers that every kernel shares. Axes are (z, y, x).

use crate::error::{Error, Result};

/// Edge lengths (z, y, x) in voxels.
pub type Shape = [usize; 3];

/// What lies beyond the border of a volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Boundary {
    /// Nothing: kernels stop at the border.
    Open,
    /// The volume again: it tiles space.
    Periodic,
}

impl Boundary {
    /// The place before one along an axis of `n`; none beyond an open border.
    pub const fn before(self, i: usize, n: usize) -> Option<usize> {
        match self {
            Self::Open => i.checked_sub(1),
            Self::Periodic => Some((i + n - 1) % n),
        }
    }

    /// The place after one along an axis of `n`; none beyond an open border.
    pub const fn after(self, i: usize, n: usize) -> Option<usize> {
        match self {
            Self::Open if i + 1 == n => None,
            Self::Open | Self::Periodic => Some((i + 1) % n),
        }
    }
}

impl std::str::FromStr for Boundary {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        match name {
            "open" => Ok(Self::Open),
            "periodic" => Ok(Self::Periodic),
            _ => Err(Error::parameter("boundary", name, "must be 'open' or 'periodic'")),
        }
    }
}

/// Number of voxels of a shape.
pub const fn voxels(shape: Shape) -> usize {
    shape[0] * shape[1] * shape[2]
}

/// Position of (z, y, x) in C order.
pub const fn index(shape: Shape, [z, y, x]: [usize; 3]) -> usize {
    (z * shape[1] + y) * shape[2] + x
}

/// (z, y, x) of a position in C order.
pub const fn position(shape: Shape, index: usize) -> [usize; 3] {
    let row = index / shape[2];
    [row / shape[1], row % shape[1], index % shape[2]]
}

//! Where the nodes of the staggered grid are, and what is beyond a velocity.

use std::ops::Range;

use crate::bits::WORD;
use crate::transport::pore::PoreSpace;
use crate::volume::Boundary;

/// Nodes are the voxels of the pore space; with an open boundary, one more plane before the first,
/// a copy of it after the last row, which owns the velocities through the inlet. Pressure is held at
/// 0 in that plane and in the one after the last, half a voxel beyond the volume, as if its end planes
/// went on that far. The other faces of an open volume are mirrors: nothing passes them, and they do
/// not slow a flow.
#[derive(Clone, Copy)]
pub(super) struct Places<'a> {
    pub space: &'a PoreSpace,
    /// The first place of a row and the last one, and these the other way round.
    ends: [[usize; 2]; 2],
}

/// Row and place in it.
pub(super) type Place = [usize; 2];

/// What is beyond a velocity, one step along an axis.
#[derive(PartialEq, Clone, Copy)]
enum Beyond {
    /// Another velocity, after the node at this place.
    Velocity(Place),
    /// A face that is part of a wall: velocity 0 one step away.
    Edge,
    /// A wall between the two places: velocity 0 half a step away.
    Wall,
    /// The same velocity.
    Mirror,
}

/// Nodes that own a velocity.
pub(super) struct Owners<'a> {
    /// The nodes of a row, and those after them; none for those after each in the row.
    own: &'a [u64],
    after: Option<&'a [u64]>,
    /// The place of the row that a periodic border puts the first one after.
    wraps: Option<usize>,
}

impl Owners<'_> {
    /// Those of a word.
    #[inline(always)]
    pub fn word(&self, word: usize) -> u64 {
        self.own[word] & self.after(word)
    }

    /// The nodes of a word, and those after which there is one; none beyond the last word.
    #[inline(always)]
    fn either(&self, word: usize) -> u64 {
        if word < self.own.len() { self.own[word] | self.after(word) } else { 0 }
    }

    /// Those after which there is a node.
    #[inline(always)]
    fn after(&self, word: usize) -> u64 {
        if let Some(after) = self.after {
            return after.get(word).copied().unwrap_or(0);
        }
        let next = self.own.get(word + 1).map_or(0, |next| next << (WORD - 1));
        let first = match self.wraps {
            Some(last) if last / WORD == word => (self.own[0] & 1) << (last % WORD),
            _ => 0,
        };
        self.own[word] >> 1 | next | first
    }
}

/// Velocities of a row that may have a wall or a mirror beside them.
pub(super) struct Exposed<'a> {
    pub owners: Owners<'a>,
    /// The rows beside; none at a border, or where all of the row are exposed.
    beside: [Option<Owners<'a>>; 4],
    /// Those of them that are beside the flow, not before or after it.
    across: Range<usize>,
}

impl Exposed<'_> {
    /// Those of a word.
    #[inline(always)]
    pub fn word(&self, word: usize) -> u64 {
        // A wall is where there is no node beside either of the two that a velocity is between.
        let mut free = u64::MAX;
        for row in &self.beside[self.across.clone()] {
            free &= match row {
                Some(row) => row.either(word),
                None => 0,
            };
        }
        // The places before and after one in its row are beside a flow across rows.
        if self.across.len() == 2 {
            let either = self.owners.either(word);
            let before = if word > 0 { self.owners.either(word - 1) >> (WORD - 1) } else { 0 };
            let after = self.owners.either(word + 1) << (WORD - 1);
            free &= (either << 1 | before) & (either >> 1 | after);
        }
        self.owners.word(word) & !free
    }
}

impl<'a> Places<'a> {
    pub fn new(space: &'a PoreSpace) -> Self {
        let last = space.shape[2] - 1;
        Self { space, ends: [[0, last], [last, 0]] }
    }

    /// Number of rows: those of the volume, and those of the plane before it.
    pub fn rows(&self) -> usize {
        let before = if self.space.boundary == Boundary::Open { self.space.shape[1] } else { 0 };
        self.space.rows() + before
    }

    /// The row of the volume that a row is or is a copy of.
    #[inline(always)]
    fn original(&self, row: usize) -> usize {
        let rows = self.space.rows();
        if row < rows { row } else { row - rows }
    }

    /// Plane and row in it; the plane before the inlet has number 1, for it differs from that after it.
    pub fn position(&self, row: usize) -> [usize; 2] {
        let [_, n1, _] = self.space.shape;
        let at = self.original(row);
        [if self.is_before_inlet(row) { 1 } else { at / n1 }, at % n1]
    }

    /// The rows before and after another along axis 0, and along axis 1.
    #[inline(always)]
    pub fn beside(&self, row: usize) -> [Option<usize>; 4] {
        let rows = self.space.rows();
        let original = self.original(row);
        let [before, after, left, right] = self.space.rows_beside(original);
        if self.is_before_inlet(row) {
            let [left, right] = [left, right].map(|row| row.map(|row| row + rows));
            return [None, Some(original), left, right];
        }
        // Before the first plane of an open volume is that of the inlet.
        [before.or(Some(row + rows)), after, left, right]
    }

    #[inline(always)]
    pub fn is_before_inlet(&self, row: usize) -> bool {
        row >= self.space.rows()
    }

    /// The nodes of a row, bit by bit.
    #[inline(always)]
    pub fn words(&self, row: usize) -> &[u64] {
        let original = self.original(row);
        self.space.bits_of(original..original + 1).words
    }

    /// Whether there is a node at a place.
    pub fn has_node(&self, [row, x]: Place) -> bool {
        self.words(row)[x / WORD] >> (x % WORD) & 1 == 1
    }

    /// Which nodes of a row own a velocity along an axis.
    #[inline(always)]
    pub fn owners(&self, row: usize, axis: usize) -> Owners<'_> {
        let own = self.words(row);
        let last = self.space.shape[2] - 1;
        Owners {
            own,
            after: match axis {
                _ if axis > 0 && self.is_before_inlet(row) => Some(&[]),
                0 if self.before_outlet(row) => Some(own),
                0 | 1 => match self.row_beside(row, axis, true) {
                    Some(row) => Some(self.words(row)),
                    None => Some(&[]),
                },
                _ => None,
            },
            wraps: (self.space.boundary == Boundary::Periodic).then_some(last),
        }
    }

    /// Which velocities of a row along an axis may have a wall or a mirror beside them: all that have, and
    /// those at the first and the last place of rows.
    #[inline(always)]
    pub fn exposed(&self, row: usize, axis: usize) -> Exposed<'_> {
        // Before the inlet and after the outlet is a mirror along the flow, beside the inlet one across.
        let all = axis == 0 && (self.is_before_inlet(row) || self.before_outlet(row));
        let across = [2..4, 0..2, 0..4][axis].clone();
        let mut beside = [None, None, None, None];
        let rows = self.beside(row);
        for side in across.clone() {
            beside[side] = match rows[side] {
                Some(row) if !all && !self.is_before_inlet(row) => Some(self.owners(row, axis)),
                _ => None,
            };
        }
        Exposed { owners: self.owners(row, axis), beside, across }
    }

    /// The row before or after another along axis 0 or 1.
    #[inline(always)]
    pub fn row_beside(&self, row: usize, axis: usize, after: bool) -> Option<usize> {
        self.beside(row)[2 * axis + usize::from(after)]
    }

    /// The places of a row beside which a periodic border puts another, and that one.
    #[inline(always)]
    pub fn wraps(&self) -> &[[usize; 2]] {
        if self.space.boundary == Boundary::Periodic { &self.ends } else { &[] }
    }

    /// The place before or after another along an axis, if there is a node.
    pub fn place_beside(&self, [row, x]: Place, axis: usize, after: bool) -> Option<Place> {
        let to = match axis {
            2 => [row, self.space.place_beside([self.original(row), x], axis, after)?[1]],
            _ => [self.row_beside(row, axis, after)?, x],
        };
        self.has_node(to).then_some(to)
    }

    /// Whether the plane of outlet pressure follows a row along axis 0.
    fn before_outlet(&self, row: usize) -> bool {
        !self.is_before_inlet(row) && self.space.open_ends(row)[1]
    }

    /// Whether a place is at a border of an open volume.
    fn at_border(&self, [row, x]: Place, axis: usize, after: bool) -> bool {
        let [_, n1, n2] = self.space.shape;
        let (at, n) = if axis == 1 { (self.original(row) % n1, n1) } else { (x, n2) };
        self.space.boundary == Boundary::Open && at == if after { n - 1 } else { 0 }
    }

    /// Whether a node owns a velocity along an axis, through the face after it.
    pub fn has_velocity(&self, at: Place, axis: usize) -> bool {
        let inside = axis == 0 || !self.is_before_inlet(at[0]);
        inside && self.place_beside(at, axis, true).is_some()
            || axis == 0 && self.before_outlet(at[0])
    }

    /// What is beyond the velocity along `axis` after a node, before or after it along `side`.
    fn beyond(&self, at: Place, axis: usize, side: usize, after: bool) -> Beyond {
        let next = self.place_beside(at, side, after);
        if side == axis {
            // Along the flow of the velocity itself.
            return match next {
                None if !after && self.is_before_inlet(at[0]) => Beyond::Mirror,
                _ if after && axis == 0 && self.before_outlet(at[0]) => Beyond::Mirror,
                Some(next) if !after || self.has_velocity(next, axis) => Beyond::Velocity(next),
                _ => Beyond::Edge,
            };
        }
        match next {
            Some([row, _]) if axis > 0 && side == 0 && self.is_before_inlet(row) => {
                return Beyond::Mirror;
            }
            Some(next) if self.has_velocity(next, axis) => return Beyond::Velocity(next),
            None if side > 0 && self.at_border(at, side, after) => return Beyond::Mirror,
            None if side == 0 && self.before_outlet(at[0]) && after => return Beyond::Mirror,
            _ => (),
        }
        // The voxel on the other side of the face may have a neighbour where this one has none.
        let across = self.place_beside(at, axis, true);
        let beside_it = across.and_then(|across| self.place_beside(across, side, after));
        if next.is_none() && beside_it.is_none() { Beyond::Wall } else { Beyond::Edge }
    }

    pub fn viscous_diagonal(&self, at: Place, axis: usize, weights: [f32; 3]) -> f32 {
        let each = (0..6).map(|i| {
            let (side, after) = (i / 2, i % 2 == 1);
            let factor = match self.beyond(at, axis, side, after) {
                Beyond::Velocity(_) | Beyond::Edge => 1.0,
                Beyond::Mirror => 0.0,
                Beyond::Wall => wall_shear(self.width(at, axis, side, !after)),
            };
            factor * weights[side]
        });
        each.sum()
    }

    /// How far the opposite wall is from a wall, seen along a side from a velocity next to it; steps.
    fn width(&self, mut at: Place, axis: usize, side: usize, after: bool) -> f32 {
        let mut width = 1.0;
        // Beyond this the profile's curvature does not show at the wall.
        while width < 64.0 {
            match self.beyond(at, axis, side, after) {
                Beyond::Velocity(next) => at = next,
                Beyond::Wall => return width,
                Beyond::Edge => return width + 0.5,
                Beyond::Mirror => return 2.0 * width,
            }
            width += 1.0;
        }
        width
    }
}

/// Shear at a wall by (velocity half a step away / step): 2, and more for the curvature of the
/// profile between walls that are `width` steps apart.
///
/// With this factor the flow between parallel walls is h²/12 for every whole h. With 2 it is
/// h²/12 + 1/6: 3 times as much for one voxel, 13 % more for four.
fn wall_shear(width: f32) -> f32 {
    2.0 / (1.0 - 2.0 / (3.0 * width))
}

//! What a ball leaves of another.

use multiversion::multiversion;

use super::Space;
use super::ridge::{Ball, MIDDLE, step};

/// A step from the middle of a ball, along the axes of a [`Frame`].
pub(super) type Offset = [i16; 3];

/// Longest list that is kept.
const LONGEST: usize = 1 << 12;

/// Offsets that are kept at most.
const MOST: usize = 1 << 22;

/// Rows that are looked at together.
const LANES: usize = 16;

/// The axes of a volume as seen in the direction of a neighbour.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    pub axes: [usize; 3],
    pub signs: [i32; 3],
}

impl Frame {
    const PLAIN: Self = Self { axes: [0, 1, 2], signs: [1; 3] };

    /// The frame in which steps of one length are the same, which they may be where voxels are cubes.
    fn of(step: [i32; 3]) -> Self {
        let mut axes = [0, 1, 2];
        axes.sort_by_key(|&axis| -step[axis].abs());
        Self { axes, signs: axes.map(|axis| if step[axis] < 0 { -1 } else { 1 }) }
    }
}

/// Lists of what balls leave of others. Where voxels are cubes, the same squares come again and again
/// and their lists are kept.
pub(super) struct Left {
    size: [f32; 3],
    cubic: bool,
    frames: [Frame; 27],
    /// By the square of the ball, and then by how much larger that of its neighbour is and along how
    /// many axes the neighbour differs: where the list is, and one more than its length.
    kept: Vec<Vec<(u32, u32)>>,
    offsets: Vec<Offset>,
    list: Vec<Offset>,
}

impl Left {
    pub(super) fn new(space: &Space) -> Self {
        let cubic = space.is_cubic();
        let frame = |i| if cubic && i != MIDDLE { Frame::of(step(i)) } else { Frame::PLAIN };
        Self {
            size: space.size.map(|edge| edge as f32),
            cubic,
            frames: std::array::from_fn(frame),
            kept: Vec::new(),
            offsets: Vec::new(),
            list: Vec::new(),
        }
    }

    /// The voxels of a ball that do not lie in that of its neighbour.
    pub(super) fn of(&mut self, ball: &Ball) -> (&[Offset], Frame) {
        let frame = self.frames[ball.neighbour];
        let toward = frame.axes.map(|axis| step(ball.neighbour)[axis]);
        let toward = [0, 1, 2].map(|i| toward[i] * frame.signs[i]);
        if !self.cubic || ball.neighbour == MIDDLE {
            self.list_anew(ball, toward);
            return (&self.list, frame);
        }
        // Squares are multiples of 4.
        let own = (ball.reach / 4.0) as usize;
        let more = ((ball.other - ball.reach) / 4.0) as i32;
        let more = if more < 0 { -2 * more - 1 } else { 2 * more };
        let axes = toward.iter().sum::<i32>();
        let place = (3 * more + axes - 1) as usize;
        if let Some(&(start, length)) = self.kept.get(own).and_then(|kept| kept.get(place))
            && length > 0
        {
            let list = &self.offsets[start as usize..][..length as usize - 1];
            return (list, frame);
        }
        self.list_anew(ball, toward);
        if self.list.len() <= LONGEST && self.offsets.len() + self.list.len() <= MOST {
            if self.kept.len() <= own {
                self.kept.resize_with(own + 1, Vec::new);
            }
            let kept = &mut self.kept[own];
            if kept.len() <= place {
                kept.resize(place + 1, (0, 0));
            }
            kept[place] = (self.offsets.len() as u32, self.list.len() as u32 + 1);
            self.offsets.extend_from_slice(&self.list);
        }
        (&self.list, frame)
    }

    fn list_anew(&mut self, ball: &Ball, toward: [i32; 3]) {
        self.list.clear();
        let [depths, heights] = self.extents(ball, toward);
        let [_, step_y, step_x] = toward;
        for z in depths.0..=depths.1 {
            let slice = Slice {
                own: ball.reach - self.square(z),
                other: ball.other - self.square(z - toward[0]),
                shift: [step_y as f32, step_x as f32],
                size: [self.size[1], self.size[2], self.size[2].recip()],
            };
            for from in (heights.0..=heights.1).step_by(LANES) {
                let mut spans = Spans { own: [0.0; LANES], other: [0.0; LANES] };
                let mut rows = rows_left(&slice, from as f32, &mut spans);
                while rows != 0 {
                    let i = rows.trailing_zeros();
                    rows &= rows - 1;
                    let [own, other] =
                        [&spans.own, &spans.other].map(|steps| steps[i as usize] as i32);
                    let (first, last) = (step_x - other, step_x + other);
                    let y = from + i as i32;
                    let outside = (-own..=own).filter(|x| !(first..=last).contains(x));
                    self.list.extend(outside.map(|x| [z as i16, y as i16, x as i16]));
                }
            }
        }
    }

    fn square(&self, depth: i32) -> f32 {
        let distance = depth as f32 * self.size[0];
        distance * distance
    }

    /// The first and the last step along the first two axes from the middle of a ball to what is
    /// left of it.
    fn extents(&self, ball: &Ball, toward: [i32; 3]) -> [(i32, i32); 2] {
        let radius = ball.reach.sqrt();
        let slack = 1e-3 * (1.0 + radius);
        // Truncation is towards the middle, by less than a step.
        let steps = |low: f32, high: f32, axis: usize| {
            (((low - slack) / self.size[axis]) as i32, ((high + slack) / self.size[axis]) as i32)
        };
        if ball.other <= 0.0 {
            return [0, 1].map(|axis| steps(-radius, radius, axis));
        }
        // It lies in the cap that begins so far out in the direction away from the neighbour: it ends
        // at its rim, or where the ball does if that is in the cap.
        let away = [0, 1, 2].map(|axis| -toward[axis] as f32 * self.size[axis]);
        let square = away[0] * away[0] + away[1] * away[1] + away[2] * away[2];
        let length = square.sqrt();
        let begins = (ball.other - square - ball.reach) / (2.0 * length);
        let rim = (ball.reach - begins * begins).max(0.0);
        [0, 1].map(|axis| {
            let cosine = away[axis] / length;
            let rim = (rim * (1.0 - cosine * cosine).max(0.0)).sqrt();
            let low = if -radius * cosine < begins { begins * cosine - rim } else { -radius };
            let high = if radius * cosine < begins { begins * cosine + rim } else { radius };
            steps(low, high, axis)
        })
    }
}

/// A ball and that of its neighbour in a plane.
struct Slice {
    /// Squares that steps in the plane must be less than, from the middle of either.
    own: f32,
    other: f32,
    /// Where the middle of the other is.
    shift: [f32; 2],
    /// Edges of a voxel, and one by the last.
    size: [f32; 3],
}

/// The last step in each row from the middle of either ball; -1 if none lies in it.
struct Spans {
    own: [f32; LANES],
    other: [f32; LANES],
}

/// The rows from y on in which part of a ball does not lie in its neighbour's, as bits.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl+avx512dq", "x86_64+avx2"))]
fn rows_left(slice: &Slice, y: f32, spans: &mut Spans) -> u32 {
    let mut rows = 0;
    for i in 0..LANES {
        let y = y + i as f32;
        let own = last_step(slice.own, y, slice.size);
        let other = last_step(slice.other, y - slice.shift[0], slice.size);
        (spans.own[i], spans.other[i]) = (own, other);
        let left = own >= 0.0 && (own + slice.shift[1] > other || own - slice.shift[1] > other);
        rows |= u32::from(left) << i;
    }
    rows
}

#[inline(always)]
fn last_step(square: f32, y: f32, size: [f32; 3]) -> f32 {
    let off = y * size[0];
    let square = square - off * off;
    let root = if square > 0.0 { square.sqrt() } else { 0.0 };
    let steps = (root * size[2]).floor();
    let length = steps * size[1];
    if length * length < square { steps } else { steps - 1.0 }
}

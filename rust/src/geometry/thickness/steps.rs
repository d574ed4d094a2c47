//! The steps from a voxel to its neighbours, and what the ball of a neighbour leaves of its own.

/// Neighbours of a voxel and itself, in C order.
pub(super) const STEPS: usize = 27;

/// Which is the voxel itself.
pub(super) const MIDDLE: usize = 13;

/// The steps to a voxel and its neighbours, in C order.
pub(super) struct Steps {
    pub all: [Step; STEPS],
}

/// A step to a neighbour.
///
/// What the neighbour's ball leaves of a voxel's is the part beyond a plane across the step.
pub(super) struct Step {
    pub along: [i32; 3],
    /// Its length squared.
    pub square: f32,
    /// One by twice its length.
    by_twice: f32,
    /// Cosines and sines of the angles of the axes to the direction away from the neighbour.
    cosines: [f32; 3],
    sines: [f32; 3],
}

impl Steps {
    /// Steps between voxels with some edges.
    pub(super) fn new(size: [f64; 3]) -> Self {
        Self { all: std::array::from_fn(|number| Step::new(number, size)) }
    }
}

impl Step {
    fn new(number: usize, size: [f64; 3]) -> Self {
        let along = [number / 9, number / 3 % 3, number % 3].map(|i| i as i32 - 1);
        let far = [0, 1, 2].map(|axis| f64::from(along[axis]) * size[axis]);
        let square = far.iter().map(|far| far * far).sum::<f64>();
        // The voxel itself has no direction.
        let length = if number == MIDDLE { 1.0 } else { square.sqrt() };
        let cosines = far.map(|far| -far / length);
        Self {
            along,
            square: square as f32,
            by_twice: (0.5 / length) as f32,
            cosines: cosines.map(|cosine| cosine as f32),
            sines: cosines.map(|cosine| (1.0 - cosine * cosine).max(0.0).sqrt() as f32),
        }
    }

    /// Along which axes the step is, as bits.
    pub(super) fn axes(&self) -> usize {
        self.along.iter().fold(0, |axes, along| 2 * axes + usize::from(*along != 0))
    }

    /// How far from the middle of a ball, away from the neighbour, the part begins that its ball
    /// leaves, given both squares.
    #[inline(always)]
    pub(super) fn begins(&self, reach: f32, neighbour: f32) -> f32 {
        (neighbour - self.square - reach) * self.by_twice
    }

    /// Where that part ends along each axis, seen from the middle: at the rim of the plane, or where
    /// the ball does if that is in the part.
    #[inline(always)]
    pub(super) fn ends(&self, reach: f32, begins: f32) -> ([f32; 3], [f32; 3]) {
        let radius = reach.sqrt();
        let rim = (reach - begins * begins).max(0.0).sqrt();
        let (mut low, mut high) = ([-radius; 3], [radius; 3]);
        for axis in 0..3 {
            let (middle, half) = (begins * self.cosines[axis], rim * self.sines[axis]);
            let peak = radius * self.cosines[axis];
            low[axis] = if -peak < begins { middle - half } else { low[axis] };
            high[axis] = if peak < begins { middle + half } else { high[axis] };
        }
        (low, high)
    }
}

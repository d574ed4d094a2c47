//! A field of one or more channels on a grid.

use crate::error::{Error, Result};
use crate::volume::{Shape, voxels};

/// Values in 0..=255 (by convention of the engine), channel after channel, each in C order.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    shape: Shape,
    channels: usize,
    data: Vec<f32>,
}

impl Field {
    /// A field around its values.
    ///
    /// # Errors
    /// If there is not a value for every voxel and channel, or one is not finite.
    pub fn new(shape: Shape, channels: usize, data: Vec<f32>) -> Result<Self> {
        if channels == 0 || data.len() != channels * voxels(shape) {
            return Err(Error::parameter(
                "field",
                (channels, shape, data.len()),
                "must have one value a voxel and channel",
            ));
        }
        if data.iter().any(|v| !v.is_finite()) {
            return Err(Error::parameter("field", "NaN or infinite", "must be finite"));
        }
        Ok(Self { shape, channels, data })
    }

    /// A field of zeros.
    pub fn zeros(shape: Shape, channels: usize) -> Self {
        Self { shape, channels, data: vec![0.0; channels * voxels(shape)] }
    }

    /// Edge lengths (z, y, x).
    pub const fn shape(&self) -> Shape {
        self.shape
    }

    /// Number of channels.
    pub const fn channels(&self) -> usize {
        self.channels
    }

    /// Voxels of one channel.
    pub fn channel(&self, channel: usize) -> &[f32] {
        let n = voxels(self.shape);
        &self.data[channel * n..(channel + 1) * n]
    }

    /// Voxels of one channel, to change.
    pub fn channel_mut(&mut self, channel: usize) -> &mut [f32] {
        let n = voxels(self.shape);
        &mut self.data[channel * n..(channel + 1) * n]
    }

    /// All values, channel after channel, to change.
    pub fn values_mut(&mut self) -> &mut [f32] {
        &mut self.data
    }

    /// All values, channel after channel.
    pub fn into_values(self) -> Vec<f32> {
        self.data
    }
}

//! Conductances that are the same between all neighbours along an axis.

use std::ops::Range;

use half::f16;
use multiversion::multiversion;

use super::compact::widen;
use super::links::{self, Conductances, Operator, Real};
use super::pore::PoreSpace;
use crate::monitor::Monitor;

/// A conductance for each axis; inlet and outlet are half a voxel away.
pub(super) struct Even<'a> {
    pub space: &'a PoreSpace,
    /// Conductance between neighbours along each axis.
    pub weights: [f64; 3],
    /// The same in single precision.
    single: [f32; 3],
    /// How many links each voxel has along the axes: in bits 0 to 2, one to inlet or outlet counting
    /// as two, bits 3 and 4, and the rest.
    degrees: &'a [u8],
    /// Sum of the conductances for each degree.
    diagonals: Vec<f64>,
}

impl Conductances for Even<'_> {
    fn space(&self) -> &PoreSpace {
        self.space
    }

    #[inline(always)]
    fn after<T: Real>(&self, axis: usize, _: usize) -> T {
        T::either(self.single[axis], self.weights[axis])
    }

    #[inline(always)]
    fn inlet(&self, _: usize) -> f32 {
        2.0 * self.weights[0] as f32
    }

    #[inline(always)]
    fn outlet(&self, _: usize) -> f32 {
        2.0 * self.weights[0] as f32
    }
}

impl Operator for Even<'_> {
    fn gather(&self, rows: Range<usize>, values: &[f16], inflow: &mut Vec<f32>) {
        gather(self, rows, values, inflow);
    }

    #[inline(always)]
    fn diagonals(&self, voxels: Range<usize>, out: &mut Vec<f32>) {
        let degrees = self.degrees[voxels].iter();
        out.clear();
        out.extend(degrees.map(|&degree| self.diagonals[usize::from(degree)] as f32));
    }
}

#[multiversion(targets(
    "x86_64+avx512f+avx512vl+popcnt+bmi1+bmi2",
    "x86_64+avx2+popcnt+bmi1+bmi2"
))]
fn gather(even: &Even<'_>, rows: Range<usize>, values: &[f16], inflow: &mut Vec<f32>) {
    links::gather(even, rows, Some(values), inflow);
}

/// The same in double precision.
#[multiversion(targets(
    "x86_64+avx512f+avx512vl+popcnt+bmi1+bmi2",
    "x86_64+avx2+popcnt+bmi1+bmi2"
))]
fn gather_exactly(even: &Even<'_>, rows: Range<usize>, values: &[f16], inflow: &mut Vec<f64>) {
    links::gather(even, rows, Some(values), inflow);
}

impl<'a> Even<'a> {
    /// `room` has one byte a voxel.
    pub fn new(
        space: &'a PoreSpace,
        weights: [f64; 3],
        room: &'a mut [u8],
        monitor: &Monitor<'_>,
    ) -> Self {
        let with = |weights: [f64; 3], degrees: &'a [u8], diagonals| Self {
            space,
            weights,
            single: weights.map(|weight| weight as f32),
            degrees,
            diagonals,
        };
        // Links are counted as conductances that do not add up to each other.
        let counted = with([1.0, 8.0, 32.0], &[], Vec::new());
        links::all_diagonals(&counted, |sum| sum as u8, room, monitor);
        let sum = |degree: u8| {
            let counts = [degree & 7, degree >> 3 & 3, degree >> 5];
            counts.iter().zip(&weights).map(|(&n, weight)| f64::from(n) * weight).sum()
        };
        with(weights, room, (0..=u8::MAX).map(sum).collect())
    }

    /// What flows from the voxels of some rows: those of the matrix times χ.
    pub fn outflow(&self, rows: Range<usize>, chi: &[f16]) -> Vec<f64> {
        let mut flow = Vec::new();
        gather_exactly(self, rows.clone(), chi, &mut flow);
        let voxels = self.space.voxels_of(rows);
        let mut own = Vec::new();
        widen(&chi[voxels.clone()], &mut own);
        for ((flow, own), &degree) in flow.iter_mut().zip(own).zip(&self.degrees[voxels]) {
            *flow = self.diagonals[usize::from(degree)] * f64::from(own) - *flow;
        }
        flow
    }
}

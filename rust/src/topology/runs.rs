//! Rows cut into runs of voxels of a phase.

use ndarray::ArrayView3;

use super::bits::{WORD, pack};
use crate::error::{Error, Result};
use crate::monitor::Monitor;

/// Start and end (exclusive) of a run along x.
pub(super) type Run = [u32; 2];

/// The runs of consecutive planes.
pub(super) struct Slab {
    pub(super) planes: usize,
    rows_per_plane: usize,
    /// Number of the slab's first run in the whole volume.
    pub(super) first_run: usize,
    pub(super) runs: Vec<Run>,
    /// Where each row's runs begin in `runs`; one more entry than rows.
    row_starts: Vec<u32>,
}

impl Slab {
    /// Cuts planes into runs of the voxels that are `phase`.
    pub(super) fn cut(
        planes: ArrayView3<'_, bool>,
        phase: bool,
        monitor: &Monitor<'_>,
    ) -> Result<Self> {
        let (nz, ny, nx) = planes.dim();
        let mut runs: Vec<Run> = Vec::new();
        let mut row_starts = Vec::with_capacity(nz * ny + 1);
        row_starts.push(0);
        let mut copy = Vec::new();
        for plane in planes.outer_iter() {
            monitor.check()?;
            for row in plane.outer_iter() {
                if let Some(row) = row.as_slice() {
                    push_runs(row, phase, &mut runs);
                } else {
                    copy.clear();
                    copy.extend(row);
                    push_runs(&copy, phase, &mut runs);
                }
                row_starts.push(u32::try_from(runs.len()).map_err(|_| {
                    Error::parameter("shape", (nz, ny, nx), "has too many components in one slab")
                })?);
            }
        }
        Ok(Self { planes: nz, rows_per_plane: ny, first_run: 0, runs, row_starts })
    }

    /// The runs of row (z, y), and the number in the slab of the first of them.
    pub(super) fn row(&self, z: usize, y: usize) -> (&[Run], u32) {
        let row = z * self.rows_per_plane + y;
        let (start, end) = (self.row_starts[row], self.row_starts[row + 1]);
        (&self.runs[start as usize..end as usize], start)
    }

    pub(super) fn rows(&self) -> impl Iterator<Item = &[Run]> {
        self.row_starts.windows(2).map(|w| &self.runs[w[0] as usize..w[1] as usize])
    }
}

/// Appends the runs of a row, found as the set bits of (row xor row shifted by one).
fn push_runs(row: &[bool], phase: bool, runs: &mut Vec<Run>) {
    let mut open: Option<u32> = None;
    for (word, voxels) in row.chunks(WORD).enumerate() {
        let before = u64::from(open.is_some());
        let mut bits = pack(voxels);
        if !phase {
            bits = !bits & (u64::MAX >> (WORD - voxels.len()));
        }
        let mut changes = bits ^ (bits << 1 | before);
        while changes != 0 {
            let at = (WORD * word) as u32 + changes.trailing_zeros();
            changes &= changes - 1;
            open = match open {
                None => Some(at),
                Some(start) => {
                    runs.push([start, at]);
                    None
                }
            };
        }
    }
    if let Some(start) = open {
        runs.push([start, row.len() as u32]);
    }
}

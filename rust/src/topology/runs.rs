//! Rows cut into runs of voxels of a phase.

use ndarray::ArrayView3;

use crate::bits::{WORD, pack_row};
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
    /// The rows as bits.
    words: Vec<u64>,
    words_per_row: usize,
}

/// The rows of a plane, as bits and as the numbers of their runs.
#[derive(Clone, Copy)]
pub(super) struct PlaneRows<'a> {
    row_starts: &'a [u32],
    words: &'a [u64],
    words_per_row: usize,
    /// What to add to the run numbers of the slab.
    add: u32,
}

/// A row as bits, and the number of its first run.
#[derive(Clone, Copy)]
pub(super) struct RowBits<'a> {
    pub(super) words: &'a [u64],
    pub(super) first: u32,
}

impl<'a> PlaneRows<'a> {
    pub(super) fn rows(&self) -> usize {
        self.row_starts.len() - 1
    }

    /// A row; none if it has no runs.
    #[inline(always)]
    pub(super) fn row(&self, y: usize) -> Option<RowBits<'a>> {
        let first = self.row_starts[y];
        let words = &self.words[y * self.words_per_row..(y + 1) * self.words_per_row];
        (self.row_starts[y + 1] > first).then_some(RowBits { words, first: first + self.add })
    }
}

impl Slab {
    /// Cuts planes into runs of the voxels that are `phase`.
    pub(super) fn cut(
        planes: ArrayView3<'_, bool>,
        phase: bool,
        monitor: &Monitor<'_>,
    ) -> Result<Self> {
        let (nz, ny, nx) = planes.dim();
        let words_per_row = nx.div_ceil(WORD);
        let mut words = vec![0; nz * ny * words_per_row];
        let mut runs: Vec<Run> = Vec::new();
        let mut row_starts = Vec::with_capacity(nz * ny + 1);
        row_starts.push(0);
        let mut copy = Vec::new();
        let mut rest = words.as_mut_slice();
        for plane in planes.outer_iter() {
            monitor.check()?;
            for row in plane.outer_iter() {
                let (bits, after) = rest.split_at_mut(words_per_row);
                rest = after;
                if let Some(row) = row.as_slice() {
                    pack_row(row, bits);
                } else {
                    copy.clear();
                    copy.extend(row);
                    pack_row(&copy, bits);
                }
                if !phase {
                    invert(bits, nx);
                }
                push_runs(bits, nx, &mut runs);
                row_starts.push(u32::try_from(runs.len()).map_err(|_| {
                    Error::parameter("shape", (nz, ny, nx), "has too many components in one slab")
                })?);
            }
        }
        let rows_per_plane = ny;
        Ok(Self {
            planes: nz,
            rows_per_plane,
            first_run: 0,
            runs,
            row_starts,
            words,
            words_per_row,
        })
    }

    /// The rows of a plane; `add` is added to the numbers of their runs.
    pub(super) fn plane(&self, z: usize, add: u32) -> PlaneRows<'_> {
        let rows = z * self.rows_per_plane..(z + 1) * self.rows_per_plane;
        let words_per_row = self.words_per_row;
        PlaneRows {
            row_starts: &self.row_starts[rows.start..=rows.end],
            words: &self.words[rows.start * words_per_row..rows.end * words_per_row],
            words_per_row,
            add,
        }
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

/// Turns the bits of a row of `length` voxels over.
fn invert(row: &mut [u64], length: usize) {
    for word in &mut *row {
        *word = !*word;
    }
    if let Some(word) = row.last_mut() {
        *word &= u64::MAX >> ((WORD - length % WORD) % WORD);
    }
}

/// Appends the runs of a row, found as the set bits of (row xor row shifted by one).
fn push_runs(row: &[u64], length: usize, runs: &mut Vec<Run>) {
    let mut open: Option<u32> = None;
    for (word, bits) in row.iter().enumerate() {
        let before = u64::from(open.is_some());
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
        runs.push([start, length as u32]);
    }
}

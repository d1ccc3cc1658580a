//! How samples ended.

use moiregauge_report::{SampleRow, SampleStatus};

/// How many samples ended how.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SamplesDone {
    /// With numbers.
    pub ok: usize,
    /// With numbers that are doubtful.
    pub doubtful: usize,
    /// Without numbers.
    pub failed: usize,
    /// Those of them that an earlier run had done.
    pub done_before: usize,
}

impl SamplesDone {
    /// Counts of rows; those of a sample of several moirés by the worst.
    pub(super) fn of(rows: &[SampleRow]) -> Self {
        let mut done = Self::default();
        for sample in rows.chunk_by(|a, b| a.sample == b.sample) {
            let is = |status| sample.iter().any(|row| row.status == status);
            if is(SampleStatus::Failed) {
                done.failed += 1;
            } else if is(SampleStatus::Doubtful) {
                done.doubtful += 1;
            } else {
                done.ok += 1;
            }
        }
        done
    }
}

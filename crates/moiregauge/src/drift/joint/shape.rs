//! Which scan sees which unknowns, and where these stand among all.
//!
//! All scans see the shared parameters, those of a block its three phases, each its own clock; they stand in this order. A scan's
//! own numbering of the parameters it sees ("local") is: the shared ones, the three phases of its block, its clock; without
//! phases the shared ones alone.

use nalgebra::DVector;

/// Phases of a block.
pub(super) const PHASES: usize = 3;

/// Which scan sees which parameters.
#[derive(Clone, Debug)]
pub(crate) struct Shape {
    /// How many parameters all scans see; they are the first.
    pub(crate) shared: usize,
    /// The block of each scan.
    pub(crate) blocks: Vec<usize>,
    /// How many blocks have phases of their own; 0 without phases, and then there are no clocks.
    pub(crate) with_phases: usize,
}

impl Shape {
    /// All parameters: the shared ones, the phases of the blocks, the clocks.
    pub(crate) fn size(&self) -> usize {
        let clocks = if self.has_clocks() {
            self.blocks.len()
        } else {
            0
        };
        self.clocks_at() + clocks
    }

    /// The first phase of a block.
    pub(crate) fn phases_at(&self, block: usize) -> usize {
        self.shared + PHASES * block
    }

    /// The clock of the first scan.
    pub(crate) fn clocks_at(&self) -> usize {
        self.phases_at(self.with_phases)
    }

    /// Whether scans have phases and clocks.
    pub(super) fn has_clocks(&self) -> bool {
        self.with_phases > 0
    }

    /// How many parameters a scan sees.
    pub(crate) fn width(&self) -> usize {
        self.without_clock() + usize::from(self.has_clocks())
    }

    /// How many of them are no clock.
    pub(super) fn without_clock(&self) -> usize {
        if self.has_clocks() {
            self.shared + PHASES
        } else {
            self.shared
        }
    }

    /// Where a local parameter of a scan stands among all.
    pub(crate) fn place(&self, scan: usize, local: usize) -> usize {
        match local.checked_sub(self.shared) {
            None => local,
            Some(PHASES) => self.clocks_at() + scan,
            Some(phase) => self.phases_at(self.blocks[scan]) + phase,
        }
    }

    /// The local parameters of a scan.
    pub(crate) fn local(&self, scan: usize, all: &DVector<f64>) -> DVector<f64> {
        DVector::from_fn(self.width(), |i, _| all[self.place(scan, i)])
    }

    /// Adds what a scan has for its local parameters.
    pub(crate) fn scatter(&self, scan: usize, own: &DVector<f64>, all: &mut DVector<f64>) {
        for (i, value) in own.iter().enumerate() {
            all[self.place(scan, i)] += value;
        }
    }
}

//! Results with both of their uncertainties: the statistical part, and everything.

use heterostrain::lattice::Lattice;
use heterostrain::strain::TwistStrain;
use heterostrain::{Estimate, TotalEstimate};

use crate::campaign::means::{Combined, SetMean};
use crate::campaign::motion::Drift;
use crate::meaning::budget::{Budget, scanner_covariance};
use crate::settings::knobs::Settings;

impl Budget {
    /// θ of the lattice that the budget is of, rad.
    pub fn twist(&self, found: &TwistStrain) -> TotalEstimate {
        TotalEstimate::new(found.twist(), self.total().covariance[(0, 0)])
    }

    /// α, rad.
    pub fn lattice_angle(&self, found: &TwistStrain) -> TotalEstimate {
        TotalEstimate::new(found.lattice_angle(), self.total().covariance[(1, 1)])
    }

    /// Magnitude of the strain, the bias of noise removed.
    pub fn heterostrain(&self, found: &TwistStrain) -> TotalEstimate {
        TotalEstimate::new(found.heterostrain(), self.total().magnitude)
    }

    /// Both components of the strain vector.
    pub fn strain_vector(&self, found: &TwistStrain) -> [TotalEstimate; 2] {
        let (statistical, total) = (found.covariance, self.total().covariance);
        [0, 1].map(|i| {
            let at = (i + 2, i + 2);
            let part = Estimate::from_variance(found.strain_vector[i], statistical[at]);
            TotalEstimate::new(part, total[at])
        })
    }

    /// Axis of the strain in the laboratory, rad; `None` where noise alone explains the strain.
    pub fn axis_lab(&self, found: &TwistStrain) -> Option<TotalEstimate> {
        let total = self.total().axis_lab;
        found.axis_lab().map(|axis| TotalEstimate::new(axis, total))
    }

    /// The axis counted from layer 1, rad; `None` where noise alone explains the strain.
    pub fn axis_lattice(&self, found: &TwistStrain) -> Option<TotalEstimate> {
        let total = found.axis_lattice_variance(&self.total().covariance);
        found
            .axis_lattice()
            .map(|axis| TotalEstimate::new(axis, total))
    }

    /// Length of a vector (0, 1, 2 for L₁, L₂, L₃) of the lattice that the budget is of, nm.
    pub fn wavelength(&self, lattice: &Lattice, index: usize) -> TotalEstimate {
        TotalEstimate::new(lattice.wavelength(index), self.total().wavelengths[index])
    }
}

/// The same for everything that has a lattice, its twist and strain, and a budget.
macro_rules! results_with_totals {
    ($kind:ty) => {
        impl $kind {
            /// θ with its statistical and its total uncertainty, rad.
            pub fn twist(&self) -> TotalEstimate {
                self.budget.twist(&self.twist_strain)
            }

            /// Magnitude of the strain with its statistical and its total uncertainty.
            pub fn heterostrain(&self) -> TotalEstimate {
                self.budget.heterostrain(&self.twist_strain)
            }

            /// Both components of the strain vector with their statistical and total uncertainties.
            pub fn strain_vector(&self) -> [TotalEstimate; 2] {
                self.budget.strain_vector(&self.twist_strain)
            }

            /// Axis of the strain in the laboratory, rad; `None` where noise alone explains the strain.
            pub fn axis_lab(&self) -> Option<TotalEstimate> {
                self.budget.axis_lab(&self.twist_strain)
            }

            /// Length of L₁, L₂ or L₃ (0, 1, 2) with its statistical and its total uncertainty, nm.
            pub fn wavelength(&self, index: usize) -> TotalEstimate {
                self.budget.wavelength(&self.lattice, index)
            }
        }
    };
}

results_with_totals!(SetMean);
results_with_totals!(Combined);

impl Drift {
    /// Both components of the velocity, nm/s. The scanner measures it, so that its calibration is in the total;
    /// a drift that the user gave has the uncertainty that came with it.
    pub fn velocities(&self, settings: &Settings) -> [TotalEstimate; 2] {
        let scanner = scanner_covariance(&self.velocity, settings);
        [0, 1].map(|i| {
            let variance = self.covariance[(i, i)];
            let more = if self.given { 0.0 } else { scanner[(i, i)] };
            let part = Estimate::from_variance(self.velocity[i], variance);
            TotalEstimate::new(part, variance + more)
        })
    }
}

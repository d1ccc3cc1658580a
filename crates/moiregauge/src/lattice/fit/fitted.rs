//! What a fit to the pixels says.

use heterostrain::lattice::{Px, Waves};
use nalgebra::{Matrix2, Matrix3, Vector2};
use rustfft::num_complex::Complex64;
use serde::{Deserialize, Serialize};

use crate::frame::departure::Departure;
use crate::frame::image::Image;
use crate::lattice::fit::bend::Inhomogeneity;
use crate::lattice::fit::closure::Closure;
use crate::lattice::fit::left::LeftOver;
use crate::lattice::fit::{frame, waves};
use crate::numbers::exact;
use crate::numbers::three::three;
use crate::spectrum::phases::Phases;

/// A lattice fitted to the pixels of an image.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LatticeFit {
    /// The wave vectors q₁, q₂ (about 60° apart), rad per pixel along columns and rows.
    #[serde(with = "exact")]
    pub wave_vectors: Waves<Px>,
    /// Where the phases of the harmonics hold, pixels (column, row): the centre of the frame.
    #[serde(with = "exact")]
    pub centre: Vector2<f64>,
    /// From there to the mean place of the pixels that count, pixels: phases there are uncorrelated with the wave vectors.
    #[serde(with = "exact", default)]
    pub off_centre: Vector2<f64>,
    /// The harmonics, first shell first.
    pub harmonics: Vec<FittedHarmonic>,
    /// Covariance of the phases of the first three harmonics at that place, rad². Where line offsets or neighbours take
    /// up a part of a harmonic its phase is less certain than its signal and noise say.
    #[serde(with = "exact")]
    pub phase_covariance: Matrix3<f64>,
    /// Residual over noise, root mean square: 1 for white noise and a model that is complete; more
    /// where the noise is coloured or the lattice is not the same everywhere.
    #[serde(with = "exact")]
    pub goodness: f64,
    /// Standard deviation of the line offsets, units of the image; `None` where none are used.
    #[serde(with = "exact")]
    pub line_offsets: Option<f64>,
    /// Lines left out because they went wrong or are mostly missing.
    pub lines_left_out: usize,
    /// Share of the pixels whose residuals are cut off; 0.3 % for Gaussian noise.
    #[serde(with = "exact")]
    pub clipped: f64,
    /// The transform of what is left, across the lines from each of the first three harmonics: two images tell by it what noise they
    /// share.
    #[serde(default)]
    pub(crate) residual: [LeftOver; 3],
    /// How the lattice changes across the frame; `None` where the frame is too small to tell.
    pub inhomogeneity: Option<Inhomogeneity>,
    /// Whether the harmonics agree on one lattice; `None` where too few of them are strong. The
    /// covariance of `wave_vectors` is enlarged already where they do not.
    pub closure: Option<Closure>,
}

/// One harmonic of a fitted lattice.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FittedHarmonic {
    /// (h, k): the wave vector is `h q₁ + k q₂`.
    pub index: [i32; 2],
    /// A of `A cos(q·(n − centre) + φ)`, units of the image.
    #[serde(with = "exact")]
    pub amplitude: f64,
    /// φ, rad. Far from other harmonics and from line offsets its standard error is
    /// `1/(√2 · signal_to_noise)`.
    #[serde(with = "exact")]
    pub phase: f64,
    /// Amplitude over noise amplitude in one resolution cell.
    #[serde(with = "exact")]
    pub signal_to_noise: f64,
}

impl LatticeFit {
    /// Whether its harmonics do not agree on one lattice.
    pub(crate) fn disagrees(&self) -> bool {
        let closure = self.closure.as_ref();
        closure.is_some_and(|closure| closure.enlargement() > 1.0)
    }

    /// The mean place of the pixels that count, (column, row).
    pub(crate) fn middle(&self) -> Vector2<f64> {
        self.centre + self.off_centre
    }

    /// Phases of the first shell at the middle: q₁, q₂, q₂ − q₁.
    pub(crate) fn first_phases(&self) -> Phases {
        let waves = three(&self.wave_vectors.basis);
        Phases {
            values: [0, 1, 2].map(|i| self.harmonics[i].phase + waves[i].dot(&self.off_centre)),
            covariance: self.phase_covariance,
        }
    }

    /// How the lattice changes, where that is more than chance.
    pub(crate) fn change(&self) -> Option<&Inhomogeneity> {
        self.inhomogeneity.as_ref().filter(|c| c.is_significant())
    }

    /// `Σ A cos(q·(n + U − centre) + φ)` on the pixels n of `image`; U: how far from its own place a pixel is on a straight grid.
    pub(crate) fn waves(&self, image: &Image, displacement: Option<&Departure>) -> Vec<f64> {
        let waves = self.harmonics.iter().map(|harmonic| {
            let q = frame::wave(&self.wave_vectors.basis, harmonic.index);
            (q, Complex64::from_polar(harmonic.amplitude, harmonic.phase))
        });
        waves::sum(image, waves, self.centre, displacement)
    }

    /// Of the first shell.
    pub(crate) fn weakest_signal_to_noise(&self) -> f64 {
        let first = self.harmonics.iter().take(3);
        first.fold(f64::INFINITY, |least, h| least.min(h.signal_to_noise))
    }

    /// The same in pixels of which `binning` make one bin along each axis.
    pub(crate) fn in_pixels(mut self, binning: usize) -> Self {
        let size = binning as f64;
        self.wave_vectors = self.wave_vectors.mapped(&(Matrix2::identity() / size));
        self.centre = self.centre * size + Vector2::repeat((size - 1.0) / 2.0);
        self.off_centre *= size;
        for harmonic in &mut self.harmonics {
            let q = frame::wave(&self.wave_vectors.basis, harmonic.index);
            // The mean over a bin lowers the amplitude, and so it does the noise in a cell.
            harmonic.amplitude /= mean_over_bin(q.x, size) * mean_over_bin(q.y, size);
        }
        if let Some(change) = &mut self.inhomogeneity {
            change.mean /= size;
            change.noise /= size * size;
            let area = (size * size) as f32;
            change.second.values /= area;
            change.second.covariance /= area * area;
        }
        self
    }
}

/// Mean of `cos(q x)` over `size` pixels around 0.
fn mean_over_bin(q: f64, size: f64) -> f64 {
    let half = (q / 2.0).sin();
    if half.abs() < 1e-12 {
        1.0
    } else {
        (size * q / 2.0).sin() / (size * half)
    }
}

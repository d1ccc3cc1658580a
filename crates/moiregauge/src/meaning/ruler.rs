//! What a moiré means in the coordinates of the atoms of one of its layers.
//!
//! In: a lattice in nm of a ruler ([`heterostrain::strain::Ruler`]) with the covariance of moiré and atoms. Out: twist and strain of layer
//! 2 against layer 1 with their budget. Neither drift nor the calibration of the scanner is in it, and isotropic strain is measured. What
//! stays open is the strain of the ruler itself, the ratio of the constants of different layers, and how the scanner is turned.

use heterostrain::lattice::Lattice;
use heterostrain::material::{Bilayer, Material};
use heterostrain::strain::{Ruler, StrainTensor, TwistStrain};
use nalgebra::{Matrix2, Matrix4, Matrix5, Vector2, Vector4, Vector5};

use crate::drift::shares::Statistical;
use crate::meaning::budget::{Budget, Contribution, Source};
use crate::meaning::readings::Readings;
use crate::meaning::strengths::WaveStrengths;
use crate::meaning::tensor::{SenseReading, TensorReading, constants};
use crate::settings::knobs::Settings;

/// Twist and strain by a ruler, with all that is uncertain about them.
pub(crate) struct ByRuler {
    pub(crate) twist_strain: TwistStrain,
    pub(crate) tensor: TensorReading,
    pub(crate) budget: Budget,
}

impl ByRuler {
    /// Of a lattice in nm of a ruler, which is layer 1 or layer 2; `None` where it goes with no solution.
    pub(crate) fn new(
        ruler: &Ruler,
        layer: u8,
        lattice: &Lattice,
        settings: &Settings,
    ) -> Option<Self> {
        let bilayer = settings.bilayer();
        let mut all = ruler.tensors(lattice, bilayer, layer).ok()?;
        let sense = settings.twist_sense;
        let sense_contradicted = !all.iter().any(|t| sense.is_none_or(|s| s.has(t.twist)));
        if !sense_contradicted {
            all.retain(|t| sense.is_none_or(|s| s.has(t.twist)));
        }
        let best = *all.first()?;
        let open = |t: &StrainTensor| bilayer.is_equal() && best.twist > 0.0 && t.twist < 0.0;
        let opposite = all.iter().position(open).map(|at| all.remove(at));
        let context = Context {
            ruler,
            layer,
            lattice,
            settings,
        };
        let nu = bilayer.stretched.poisson_ratio;
        let known = |t: &StrainTensor| t.covariance + context.strained(t) + context.of_constants(t);
        let other = |found: StrainTensor| SenseReading {
            known: known(&found),
            found,
        };
        let twist_strain = best.uniaxial(nu);
        let tensor = TensorReading {
            known: known(&best),
            opposite: opposite.map(other),
            best,
            alternatives: all.split_off(1).into_iter().map(other).collect(),
            poisson_ratio: nu,
            other_vector: None,
            disagreement: None,
            sense_contradicted,
        };
        let contribution = |source| context.contribution(source, &best, &twist_strain);
        let statistical = Statistical {
            image: lattice.covariance,
            drift: Matrix4::zeros(),
            sensor: Matrix4::zeros(),
        };
        Some(Self {
            budget: Budget::of_ruler(layer, contribution, &statistical),
            twist_strain,
            tensor,
        })
    }

    /// All that the lattice can mean.
    pub(crate) fn readings(
        &self,
        lattice: &Lattice,
        strengths: &WaveStrengths,
        settings: &Settings,
    ) -> Readings {
        Readings {
            tensor: Some(self.tensor.clone()),
            degeneracy: None,
            ..Readings::new(
                lattice,
                &self.twist_strain,
                &self.budget,
                strengths,
                settings,
            )
        }
    }
}

struct Context<'a> {
    ruler: &'a Ruler,
    layer: u8,
    lattice: &'a Lattice,
    settings: &'a Settings,
}

impl Context<'_> {
    /// Relative strain of the ruler, one standard deviation.
    fn sigma(&self) -> f64 {
        self.settings.ruler_strain_percent / 100.0
    }

    fn strained(&self, tensor: &StrainTensor) -> Matrix5<f64> {
        tensor.error_of_strained_ruler(self.sigma())
    }

    /// The lattice constants of layers that differ: those of equal ones do not matter.
    fn of_constants(&self, tensor: &StrainTensor) -> Matrix5<f64> {
        let bilayer = self.settings.bilayer();
        if bilayer.is_equal() {
            return Matrix5::zeros();
        }
        let change = |[first, second]: &[Material; 2]| {
            let changed = Bilayer {
                reference: first,
                stretched: second,
                waves: bilayer.waves,
            };
            let (own, free) = match self.layer {
                1 => (first, bilayer.reference),
                _ => (second, bilayer.stretched),
            };
            let larger = own.lattice_constant_nm / free.lattice_constant_nm;
            let lattice = self.lattice.mapped(&(Matrix2::identity() * larger));
            let all = self.ruler.tensors(&lattice, changed, self.layer).ok()?;
            let off = |t: &StrainTensor| (t.twist - tensor.twist).abs();
            let moved = all.into_iter().min_by(|a, b| off(a).total_cmp(&off(b)))?;
            let shear = moved.shear - tensor.shear;
            let change = [
                moved.twist - tensor.twist,
                0.0,
                moved.mean - tensor.mean,
                shear.x,
                shear.y,
            ];
            Some(Vector5::from(change))
        };
        let changes = constants(bilayer);
        let changes = changes.iter().filter_map(change);
        changes.map(|change| change * change.transpose()).sum()
    }

    fn contribution(
        &self,
        source: Source,
        best: &StrainTensor,
        found: &TwistStrain,
    ) -> Contribution {
        let nu = self.settings.bilayer().stretched.poisson_ratio;
        let of_tensor = |covariance: Matrix5<f64>| {
            StrainTensor {
                covariance,
                ..*best
            }
            .uniaxial(nu)
            .covariance
        };
        let lattice = |change: Matrix2<f64>| {
            let change = Vector4::from_column_slice((change * self.lattice.basis).as_slice());
            change * change.transpose()
        };
        let (mut covariance, mut of_lattice) = (Matrix4::zeros(), Matrix4::zeros());
        match source {
            Source::Image => {
                covariance = of_tensor(best.covariance);
                of_lattice = self.lattice.covariance;
            }
            Source::RulerStrain => {
                let (s, shear) = (self.sigma(), self.sigma() / std::f64::consts::SQRT_2);
                covariance = of_tensor(self.strained(best));
                of_lattice = lattice(Matrix2::new(s, 0.0, 0.0, 0.0))
                    + lattice(Matrix2::new(0.0, 0.0, 0.0, s))
                    + lattice(Matrix2::new(0.0, shear, shear, 0.0));
            }
            Source::LatticeConstant => {
                let layers = self.settings.bilayer();
                let own = if self.layer == 1 {
                    layers.reference
                } else {
                    layers.stretched
                };
                let relative = own.lattice_constant_sigma_nm / own.lattice_constant_nm;
                covariance = of_tensor(self.of_constants(best));
                of_lattice = lattice(Matrix2::identity() * relative);
            }
            // The fast axis is what angles are counted from: axes that miss a right angle, or differ in gain, turn it.
            Source::Mismatch => {
                covariance[(1, 1)] = (self.settings.calibration.mismatch_percent / 200.0).powi(2);
            }
            Source::Orthogonality => {
                covariance[(1, 1)] =
                    (self.settings.calibration.orthogonality_mrad / 2000.0).powi(2);
            }
            Source::PoissonRatio => {
                let relative = self.settings.bilayer().stretched.poisson_ratio_sigma / (1.0 + nu);
                let e = found.strain_vector * relative;
                covariance
                    .fixed_view_mut::<2, 2>(2, 2)
                    .copy_from(&(e * e.transpose()));
            }
            _ => {}
        }
        // What turns the frame turns the axis of the strain.
        let strain = covariance.fixed_view::<2, 2>(2, 2).into_owned();
        let turned = if matches!(source, Source::Mismatch | Source::Orthogonality) {
            covariance[(1, 1)]
        } else {
            0.0
        };
        let across = Vector2::new(-found.strain_vector.y, found.strain_vector.x) * 2.0;
        let strain = strain + across * across.transpose() * turned;
        covariance.fixed_view_mut::<2, 2>(2, 2).copy_from(&strain);
        let with: Lattice = Lattice::new(self.lattice.basis, of_lattice);
        Contribution {
            covariance,
            magnitude: found.strain().magnitude_variance(&strain),
            axis_lab: found.strain().axis_variance(&strain),
            wavelengths: [0, 1, 2].map(|i| with.wavelength(i).sigma.powi(2)),
        }
    }
}

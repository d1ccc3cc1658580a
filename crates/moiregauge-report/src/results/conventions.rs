//! The conventions behind the numbers, in words, written beside them.

use heterostrain::material::Material;
use heterostrain::strain::StrainConvention;
use moiregauge::settings::Settings;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the numbers mean.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Conventions {
    /// Directions of the axes.
    pub axes: String,
    /// Units and sense of angles.
    pub angles: String,
    /// How the three vectors are named.
    pub lattice_vectors: String,
    /// What the three kinds of coordinates are.
    pub coordinates: String,
    /// What the drift velocity is the velocity of.
    pub drift: String,
    /// The equation behind twist and strain.
    pub strain: String,
    /// Which layers these are.
    pub layers: String,
    /// Which layer carries the strain.
    pub strained_layer: String,
    /// What the axis of the strain is and when it is given.
    pub strain_axis: String,
    /// What the strain vector is.
    pub strain_vector: String,
    /// What the magnitude of the strain is.
    pub heterostrain: String,
    /// What the twist does not contain: its sign, and isotropic strain.
    pub twist: String,
    /// What the strain tensor is.
    pub strain_tensor: String,
    /// What `sigma` and `sigma_total` are.
    pub sigma: String,
    /// What the budget is.
    pub budget: String,
}

impl Conventions {
    /// The conventions under the given settings.
    pub fn of(settings: &Settings) -> Self {
        let (strain, axis) = match settings.strain_convention {
            StrainConvention::RealSpace => (
                "real space: M = R(α)[R(θ)S⁻¹ − I]G; the stretch S = diag(1+ε, 1−νε) along φ acts on atomic positions, ε > 0 is tension",
                "tension",
            ),
            StrainConvention::KSpace => (
                "k space, as in arXiv 2406.08681: M = R(α)[R(θ)S − I]G; the stretch S = diag(1+ε, 1−νε) along φ acts on reciprocal vectors, ε > 0 is compression",
                "compression",
            ),
        };
        Self {
            axes: "x to the right, y up, in the frame of the position sensors".to_owned(),
            angles: "degrees, counter-clockwise from x; axes modulo 180°, lattice angles modulo 60°".to_owned(),
            lattice_vectors: "L1, L2 about 60° apart, L3 = L2 − L1; the opposites are not listed".to_owned(),
            coordinates: "nominal: pixels placed by the size the file states; sensor: by the position sensors; drift_corrected: sensor coordinates with the motion of the sample removed".to_owned(),
            drift: "velocity of the sample in the frame of the sensors".to_owned(),
            strain: strain.to_owned(),
            layers: layers(settings),
            strained_layer: "layer 2 is stretched and then turned by θ against layer 1; the moiré does not show which \
                             layer is strained".to_owned(),
            strain_axis: format!("axis of {axis}; strain_axis_lab_deg φ_lab from x, strain_axis_lattice_deg φ = φ_lab − α − θ from layer 1 of orientation α; null unless the strain is significant (p < 0.01)"),
            strain_vector: "E = (ε cos 2φ_lab, ε sin 2φ_lab) in per cent, its covariance in per cent²".to_owned(),
            heterostrain: "length of the strain vector with the noise bias removed; zero where noise alone explains it".to_owned(),
            twist: if settings.bilayer().is_equal() {
                "θ > 0 by choice: the moiré alone does not show the sign; assumes no isotropic heterostrain".to_owned()
            } else {
                "θ > 0 and ε ≥ 0 by choice, where that explains the moiré: the layers differ, and the other entries of \
                 readings.solutions fit equally well; assumes no isotropic heterostrain beside the mismatch of the \
                 lattice constants".to_owned()
            },
            strain_tensor: "readings.strain_tensor, where the orientation of a layer is known: mean ½(ε₁+ε₂) and shear \
                            part γ = ½(ε₁−ε₂) of the strain of layer 2 against layer 1, of atoms and tension positive \
                            in either form of the equation, φ the axis of ε₁ from x; splits: the same strain as \
                            (1+ε_b) diag(1+ε_u, 1−νε_u), which is possible in two ways; isotropic strains are those of \
                            layer 2".to_owned(),
            sigma: "`sigma_total`: one standard deviation with everything (publish this one): image noise, drift, \
                    sensor noise, calibration of the scanner, lattice constant and model; `sigma`: the statistical \
                    part alone, image noise, drift and sensor noise, for comparing results of one scanner and one \
                    model; `budget` has every part".to_owned(),
            budget: format!("one standard deviation for each source of error and for all together; image, drift and \
                             sensor make up sigma; the scanner is assumed to be known to {} % in gain, {} % in the \
                             ratio of x and y and {} mrad in the angle between them, to bend by {} % of its range in the frame \
                             ({} % without sensors), the lattice constant to {}, the \
                             Poisson ratio to {}, an isotropic heterostrain to be {} %; strained_layer is the \
                             difference to strain in equal parts in both layers; angles are counted from the x axis of \
                             the sensors, so a turned frame is no error", settings.calibration.gain_percent, settings.calibration.mismatch_percent, settings.calibration.orthogonality_mrad, settings.calibration.sensor_bend_percent, settings.calibration.scanner_bend_percent, constants(settings), settings.material.poisson_ratio_sigma, settings.isotropic_strain_percent),
        }
    }
}

/// `0.0001 nm`, or those of layers 1 and 2.
fn constants(settings: &Settings) -> String {
    let layers = settings.bilayer();
    let (first, second) = (
        layers.reference.lattice_constant_sigma_nm,
        layers.stretched.lattice_constant_sigma_nm,
    );
    if layers.is_equal() {
        format!("{second} nm")
    } else {
        format!("{first} nm (layer 1) and {second} nm (layer 2)")
    }
}

/// Names, constants and sources of the layers.
fn layers(settings: &Settings) -> String {
    let layers = settings.bilayer();
    let of = |m: &Material| {
        let cell = match (m.lattice_constant_b_nm, m.cell_angle_deg) {
            (Some(b), Some(angle)) => format!(", b = {b} nm, angle {angle}°"),
            _ => String::new(),
        };
        format!(
            "{} (a = {} nm{cell}, ν = {}; {})",
            m.name, m.lattice_constant_nm, m.poisson_ratio, m.source
        )
    };
    if layers.reference == layers.stretched {
        format!("both layers are {}", of(layers.stretched))
    } else {
        format!(
            "layer 1, the lower one and the reference, is {}; layer 2, on it, is {}",
            of(layers.reference),
            of(layers.stretched)
        )
    }
}

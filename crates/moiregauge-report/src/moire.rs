//! The answer of the calculator `moiregauge moire` as a document, `moiregauge/moire/1`.

use heterostrain::lattice::MoireCell;
use heterostrain::strain::TwistStrain;
use moiregauge::meaning::Readings;
use moiregauge::settings::Settings;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::results::{Conventions, ReadingsResult, TwistStrainResult};

/// nm⁻² → cm⁻².
const PER_SQUARE_CM: f64 = 1e14;

/// What a moiré is made of or means.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MoireDocument {
    /// `moiregauge/moire/1`.
    pub schema: String,
    /// `graphene`, or `graphene/hBN` for layer 2 on layer 1.
    pub layers: String,
    /// What was asked for, in words.
    pub input: String,
    /// The moiré cell.
    pub cell: CellResult,
    /// The default solution of the moiré: θ > 0 and ε ≥ 0, no isotropic strain; `null` where nothing was asked.
    pub twist_strain: Option<TwistStrainResult>,
    /// All solutions.
    pub readings: Option<ReadingsResult>,
    /// What the numbers mean.
    pub conventions: Conventions,
}

/// One cell of a moiré lattice.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CellResult {
    /// L₁, L₂ and L₂ − L₁.
    pub vectors_nm: [[f64; 2]; 3],
    /// Their lengths.
    pub wavelengths_nm: [f64; 3],
    /// `4π/(√3|K_j|)` of the wave vectors: the other meaning of "wavelength", equal without strain.
    pub k_space_wavelengths_nm: [f64; 3],
    /// Angle between L₁ and L₂.
    pub angle_deg: f64,
    /// Directions of the three vectors, counter-clockwise from x.
    pub polar_angles_deg: [f64; 3],
    /// K₁, K₂ and K₂ − K₁.
    pub wave_vectors_rad_per_nm: [[f64; 2]; 3],
    /// Area of the primitive cell.
    pub area_nm2: f64,
    /// One electron per cell, `1/A`.
    pub density_per_electron_cm2: f64,
    /// Electrons per cell at full filling: 4 for graphene (spin and valley).
    pub band_degeneracy: f64,
    /// Full filling, `g/A`.
    pub density_full_cm2: f64,
}

impl CellResult {
    /// The cell, with `degeneracy` electrons per cell at full filling.
    pub fn new(cell: &MoireCell, degeneracy: f64) -> Self {
        Self {
            vectors_nm: cell.vectors.map(Into::into),
            wavelengths_nm: cell.wavelengths(),
            k_space_wavelengths_nm: cell.k_space_wavelengths(),
            angle_deg: cell.angle().to_degrees(),
            polar_angles_deg: cell.vectors.map(|v| v.y.atan2(v.x).to_degrees()),
            wave_vectors_rad_per_nm: cell.waves.map(Into::into),
            area_nm2: cell.area,
            density_per_electron_cm2: PER_SQUARE_CM * cell.density(1.0),
            band_degeneracy: degeneracy,
            density_full_cm2: PER_SQUARE_CM * cell.density(degeneracy),
        }
    }
}

impl MoireDocument {
    /// The document; `readings` where a moiré was to be read.
    pub fn new(
        input: String,
        cell: CellResult,
        readings: Option<(&TwistStrain, &Readings)>,
        settings: &Settings,
    ) -> Self {
        Self {
            schema: "moiregauge/moire/1".to_owned(),
            layers: settings.bilayer().name(),
            input,
            cell,
            twist_strain: readings.map(|(found, _)| found.into()),
            readings: readings.map(|(_, readings)| readings.into()),
            conventions: Conventions::of(settings),
        }
    }

    /// As text, indented, with a newline at the end.
    ///
    /// # Errors
    /// None in practice: every part can be written as JSON.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        let mut text = serde_json::to_string_pretty(self)?;
        text.push('\n');
        Ok(text)
    }
}

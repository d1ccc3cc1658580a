//! The options of `moiregauge moire`.

use std::path::PathBuf;

use anyhow::bail;
use clap::ValueEnum;
use heterostrain::strain::KnownOrientation;
use moiregauge::settings::Settings;
use moiregauge_pipeline::moire::{Direction, Given, GivenLayers, MoireQuestion};

use crate::analyze::{Angle, ConventionArg, DirectionArg, SenseArg, parse_angle};
use crate::config;
use crate::numbers;

/// The moiré of two layers, or the layers behind a moiré
///
/// Forwards: layers, twist and strain give the moiré vectors, wavelengths, angles, cell area and carrier density.
/// Backwards: three wavelengths or two vectors give twist and strain, with all solutions and the effect of isotropic
/// strain. Layer 1 is the lower one and the reference; layer 2 lies on it, is stretched and then turned by the twist.
#[derive(clap::Args, Clone, Debug)]
#[command(after_long_help = "\
Examples:
  moiregauge moire --twist 1.1
  moiregauge moire --twist 1.1 --strain 0.3 --strain-axis 20 --figure cell.svg
  moiregauge moire --layers graphene/hBN --twist 0
  moiregauge moire --wavelengths 13.72,12.7,10.18 --meaning real-space --sigma 0.05
  moiregauge moire --vectors 12.9,0.4 6.1,11.5 --sigma 0.02 --lattice-angle 11.2±0.3
  moiregauge moire --list

Angles are degrees counter-clockwise from x; strains per cent.")]
pub(crate) struct MoireArgs {
    /// The layers: graphene for two equal ones, graphene/hBN for graphene (layer 2) on hBN (layer 1)
    #[arg(
        help_heading = "Layers",
        long,
        value_name = "UPPER/LOWER",
        default_value = "graphene"
    )]
    layers: String,
    /// TOML file with layers of your own, one [[layer]] table each
    #[arg(help_heading = "Layers", long, value_name = "FILE")]
    materials: Option<PathBuf>,
    /// Twist of layer 2 against layer 1, degrees
    #[arg(help_heading = "Forwards: the moiré of two layers", long, value_name = "DEG", allow_negative_numbers = true, conflicts_with_all = ["wavelengths", "vectors"], value_parser = numbers::number(numbers::ANGLE_DEG))]
    twist: Option<f64>,
    /// Uniaxial strain of layer 2, per cent: ε along the axis, −ν ε across
    #[arg(help_heading = "Forwards: the moiré of two layers", long, value_name = "PERCENT", allow_negative_numbers = true, conflicts_with_all = ["wavelengths", "vectors"], value_parser = numbers::number(numbers::STRAIN_PERCENT))]
    strain: Option<f64>,
    /// Axis of the strain, degrees, counted from the reciprocal vectors of layer 1 (φ)
    #[arg(help_heading = "Forwards: the moiré of two layers", 
        long,
        value_name = "DEG",
        allow_negative_numbers = true,
        requires = "strain", value_parser = numbers::number(numbers::ANGLE_DEG))]
    strain_axis: Option<f64>,
    /// Isotropic (biaxial) strain of layer 2, per cent, added to the uniaxial one
    #[arg(help_heading = "Forwards: the moiré of two layers", long, value_name = "PERCENT", allow_negative_numbers = true, conflicts_with_all = ["wavelengths", "vectors"], value_parser = numbers::number(numbers::STRAIN_PERCENT))]
    biaxial: Option<f64>,
    /// Orientation of layer 1, degrees. Backwards: give its standard uncertainty too, as in 11.2±0.3, to get the whole
    /// strain tensor
    #[arg(
        help_heading = "Layers",
        long,
        value_name = "DEG[±SIGMA]",
        allow_hyphen_values = true
    )]
    lattice_angle: Option<String>,
    /// Backwards: the layer that --lattice-angle belongs to
    #[arg(help_heading = "Layers", long, value_name = "1|2", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2))]
    lattice_angle_layer: u8,
    /// The vector that --lattice-angle belongs to
    #[arg(help_heading = "Layers", long, value_enum, default_value_t = DirectionArg::Atomic)]
    lattice_angle_of: DirectionArg,
    /// Backwards: orientation of the other layer with its standard uncertainty; with two equal layers one orientation
    /// leaves the sense of the twist open
    #[arg(help_heading = "Backwards: the layers behind a moiré", long, value_name = "DEG±SIGMA", allow_hyphen_values = true, value_parser = parse_angle, requires_all = ["lattice_angle", "vectors"])]
    lattice_angle_2: Option<Angle>,
    /// Backwards: the sense of the twist, if it is known
    #[arg(
        help_heading = "Backwards: the layers behind a moiré",
        long,
        value_enum,
        requires = "lattice_angle",
        conflicts_with = "twist"
    )]
    twist_sense: Option<SenseArg>,
    /// Three wavelengths, nm; --meaning has to say what they are
    #[arg(help_heading = "Backwards: the layers behind a moiré", 
        long,
        value_name = "A,B,C",
        value_delimiter = ',',
        conflicts_with = "vectors", value_parser = numbers::number(numbers::LENGTH_NM))]
    wavelengths: Vec<f64>,
    /// How the three wavelengths were measured; the two ways differ if there is strain
    #[arg(
        help_heading = "Backwards: the layers behind a moiré",
        long,
        value_enum
    )]
    meaning: Option<MeaningArg>,
    /// Two moiré vectors, nm
    #[arg(help_heading = "Backwards: the layers behind a moiré", long, num_args = 2, value_names = ["X,Y", "X,Y"], allow_hyphen_values = true)]
    vectors: Vec<String>,
    /// Standard uncertainty of each wavelength, or of each component of the vectors, nm
    #[arg(help_heading = "Backwards: the layers behind a moiré", long, value_name = "NM", default_value_t = 0.0, value_parser = numbers::number(numbers::NOT_NEGATIVE))]
    sigma: f64,
    /// Standard deviation of the isotropic strain that the layers may have, per cent
    #[arg(help_heading = "Backwards: the layers behind a moiré", long, value_name = "PERCENT", default_value_t = Settings::default().isotropic_strain_percent, value_parser = numbers::number([0.0, 10.0]))]
    isotropic_strain: f64,
    /// Form of the strain equation [default: real-space]
    #[arg(help_heading = "Layers", long, value_enum)]
    strain_convention: Option<ConventionArg>,
    /// Electrons per cell at full filling: 4 in graphene (two spins, two valleys)
    #[arg(help_heading = "Layers", long, value_name = "G", default_value_t = 4.0, value_parser = numbers::number([1e-3, 1e6]))]
    band_degeneracy: f64,
    /// Draw the cell: a name that ends in .svg or .png
    #[arg(long, value_name = "FILE")]
    pub(super) figure: Option<PathBuf>,
    /// Replace a figure that exists
    #[arg(long, requires = "figure")]
    pub(super) force: bool,
    /// Print JSON
    #[arg(long)]
    pub(super) json: bool,
    /// List the layers known by name, with their sources
    #[arg(long)]
    pub(super) list: bool,
}

/// What three wavelengths are.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum MeaningArg {
    /// Lengths of the vectors between neighbouring spots of the image: L₁, L₂ and L₂ − L₁
    RealSpace,
    /// 4π/(√3|K|) of the three spots of the Fourier transform
    KSpace,
}

impl MoireArgs {
    /// Layers, conventions and priors.
    fn settings(&self) -> anyhow::Result<Settings> {
        let own = config::own_materials(self.materials.as_deref())?;
        let (material, substrate) = config::named_layers(&self.layers, &own)?;
        let settings = Settings {
            material,
            substrate,
            lattice_angle: self.orientation()?,
            lattice_angle_2: self.lattice_angle_2.map(|Angle([angle_deg, sigma_deg])| {
                KnownOrientation {
                    angle_deg,
                    sigma_deg,
                    layer: 3 - self.lattice_angle_layer,
                    of: self.lattice_angle_of.into(),
                }
            }),
            twist_sense: self.twist_sense.map(Into::into),
            strain_convention: self
                .strain_convention
                .map_or(Settings::default().strain_convention, Into::into),
            isotropic_strain_percent: self.isotropic_strain,
            ..MoireQuestion::default().settings
        };
        config::check(&settings)?;
        Ok(settings)
    }

    fn backwards(&self) -> bool {
        !self.wavelengths.is_empty() || !self.vectors.is_empty()
    }

    /// The orientation with its uncertainty, for reading a moiré.
    fn orientation(&self) -> anyhow::Result<Option<KnownOrientation>> {
        let Some(text) = self.lattice_angle.as_ref().filter(|_| self.backwards()) else {
            return Ok(None);
        };
        let Angle([angle_deg, sigma_deg]) =
            parse_angle(text).map_err(|error| anyhow::anyhow!("--lattice-angle: {error}"))?;
        Ok(Some(KnownOrientation {
            angle_deg,
            sigma_deg,
            layer: self.lattice_angle_layer,
            of: self.lattice_angle_of.into(),
        }))
    }

    /// What is asked.
    pub(super) fn question(&self) -> anyhow::Result<MoireQuestion> {
        Ok(MoireQuestion {
            settings: self.settings()?,
            given: self.given()?,
            band_degeneracy: self.band_degeneracy,
        })
    }

    fn given(&self) -> anyhow::Result<Given> {
        if let [a, b] = self.vectors.as_slice() {
            return Ok(Given::Vectors {
                vectors_nm: [vector(a)?, vector(b)?],
                sigma_nm: self.sigma,
            });
        }
        if !self.wavelengths.is_empty() {
            let Ok(lengths_nm) = <[f64; 3]>::try_from(self.wavelengths.clone()) else {
                bail!(
                    "--wavelengths: expected three lengths in nm, as in 13.72,12.7,10.18, found {}",
                    self.wavelengths.len()
                );
            };
            let Some(meaning) = self.meaning else {
                bail!(
                    "how were the three wavelengths measured? As distances between neighbouring spots of the image: \
                     add --meaning real-space. As 4π/(√3|K|) from the spots of its Fourier transform: add --meaning \
                     k-space. The two differ if there is strain: 13.72, 12.7 and 10.18 nm give a twist of 1.190° \
                     (real-space) or 1.152° (k-space)"
                );
            };
            return Ok(Given::Wavelengths {
                lengths_nm,
                sigma_nm: self.sigma,
                k_space: matches!(meaning, MeaningArg::KSpace),
            });
        }
        let Some(twist_deg) = self.twist else {
            bail!("expected --twist, --wavelengths or --vectors; see moiregauge moire --help");
        };
        Ok(Given::Layers(GivenLayers {
            twist_deg,
            strain_percent: self.strain,
            strain_axis_deg: self.strain_axis,
            biaxial_percent: self.biaxial,
            lattice_angle: self.direction()?,
        }))
    }

    /// The orientation of layer 1 for layers that are given.
    fn direction(&self) -> anyhow::Result<Option<Direction>> {
        let Some(text) = &self.lattice_angle else {
            return Ok(None);
        };
        let plain: Option<f64> = text.trim().trim_end_matches('°').parse().ok();
        let Some(angle_deg) = numbers::within(numbers::ANGLE_DEG, plain) else {
            bail!("--lattice-angle: expected degrees from −3600 to 3600, found {text:?}");
        };
        Ok(Some(Direction {
            angle_deg,
            of: self.lattice_angle_of.into(),
        }))
    }

    /// Vectors as they were typed, with true minus signs.
    pub(super) fn vectors_in_words(&self) -> Option<String> {
        let [a, b] = self.vectors.as_slice() else {
            return None;
        };
        let plain = |v: &str| v.trim_matches(['(', ')', ' ']).replace('-', "−");
        Some(format!("vectors ({}) and ({}) nm", plain(a), plain(b)))
    }
}

/// `12.9,0.4`.
fn vector(text: &str) -> anyhow::Result<[f64; 2]> {
    // As it was printed, with brackets and true minus signs.
    let plain = text.replace('−', "-");
    let numbers: Vec<f64> = plain
        .trim_matches(['(', ')', ' '])
        .split(',')
        .filter_map(|part| part.trim().parse().ok())
        .filter_map(|x: f64| numbers::within([-1e7, 1e7], Some(x)))
        .collect();
    match numbers.as_slice() {
        &[x, y] if text.split(',').count() == 2 => Ok([x, y]),
        _ => bail!(
            "--vectors: expected two components in nm, up to 1 cm, as in 12.9,0.4, found {text:?}"
        ),
    }
}

//! The options of `moiregauge simulate` → the settings of one set.

use std::path::PathBuf;

use anyhow::Context as _;
use heterostrain::material::Material;
use moiregauge::simulate::{FirstDirection, MOST_PIXELS, Pattern, SampleFeature, Simulation, vary};

use crate::config::named_layers;
use crate::numbers;

/// Write simulated NanoScope sets together with their true values
///
/// Twisted, strained layers are scanned by a drifting, noisy instrument with position sensors. Each
/// set goes into a folder of its own: scan.000.spm, scan.001.spm … and truth.json, which holds the
/// moiré vectors, twist, strain, drift, the geometry and times of every frame, and all settings.
/// Without options the conditions are those of arXiv 2406.08681.
#[derive(clap::Args, Clone, Debug)]
// Each is a switch of its own on the command line.
#[allow(clippy::struct_excessive_bools)]
#[command(after_long_help = "\
Examples:
  moiregauge simulate --out sim                        ten scans, slow axis y, in sim/simulated
  moiregauge simulate --out sim --paper                the three sets of arXiv 2406.08681
  moiregauge simulate --out sim --name fast --scans 6 --slow x --rate 4 --drift -0.3 0.6
  moiregauge simulate --out sim --layers graphene/hBN --twist 0.8 --biaxial 0.1
  moiregauge simulate --out sim --name atoms --atoms 1 --size 5 5 --scans 2 --pixels 256
  moiregauge simulate --out sim --name flake --sample edge:share=0.6,angle=30 --sample hole:share=0.1
  moiregauge simulate --out sim --name g7 --sample grains --vary --seed 7
  moiregauge simulate --list-samples                   the classes of samples and their numbers
  moiregauge simulate --print-config > set.toml        every setting, to be edited
  moiregauge simulate --out sim --config set.toml --seed 7

Angles are counter-clockwise. The strain axis is counted from the reciprocal vectors of layer 1,
whose orientation is the lattice angle; in the laboratory it lies at the sum of both and the twist.")]
pub(crate) struct SimulateArgs {
    /// Folder for the sets; made if it does not exist
    #[arg(long, value_name = "DIR", required_unless_present_any = ["print_config", "list_samples"])]
    pub(super) out: Option<PathBuf>,
    /// Settings from a TOML file; options on the command line override them
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Print all settings as TOML and write nothing
    #[arg(long)]
    pub(super) print_config: bool,
    /// What the sample has besides a perfect lattice: edge, hole, bump, island, grains, twist-wave, walls, atoms,
    /// glitches … with numbers as in edge:share=0.6,angle=30; several at once with + or by giving the option again
    #[arg(help_heading = "Sample", long, value_name = "CLASS[:KEY=VALUE,…]", value_parser = parse_sample)]
    sample: Vec<SampleGiven>,
    /// List the classes for --sample with their numbers and write nothing
    #[arg(long)]
    pub(super) list_samples: bool,
    /// Draw at random (by --seed) twist, strain, orientation, drift, noise, size and the numbers that --sample leaves
    /// open; other options override these
    #[arg(help_heading = "Sample", long)]
    vary: bool,
    /// Replace files of the same names
    #[arg(long)]
    pub(super) force: bool,
    /// Write the three sets of arXiv 2406.08681; of the other options only --seed has an effect
    #[arg(long, conflicts_with_all = ["config", "print_config", "sample", "vary"])]
    pub(super) paper: bool,
    /// Name of the set and of its folder
    #[arg(long)]
    name: Option<String>,
    /// Seed of all noise
    #[arg(help_heading = "Drift and noise", long)]
    pub(super) seed: Option<u64>,
    /// Number of scans
    #[arg(help_heading = "Scans", long, value_parser = numbers::count(1, 9999))]
    scans: Option<usize>,
    /// Samples per line and lines, as in 512 or 512x256
    #[arg(help_heading = "Scans", long, value_name = "N[xM]", value_parser = parse_pixels)]
    pixels: Option<Pixels>,
    /// Lines per second
    #[arg(help_heading = "Scans", long, value_name = "HZ", value_parser = numbers::number(numbers::LINE_RATE_HZ))]
    rate: Option<f64>,
    /// Slow axis: y, or x for a frame turned by 90°
    #[arg(help_heading = "Scans", long, value_enum)]
    slow: Option<SlowAxis>,
    /// Direction of the first scan; the following ones alternate
    #[arg(help_heading = "Scans", long, value_enum)]
    first: Option<First>,
    /// Nominal size along the fast and the slow axis, nm
    #[arg(help_heading = "Scans", long, num_args = 2, value_names = ["FAST", "SLOW"], value_parser = numbers::number(numbers::LENGTH_NM))]
    size: Option<Vec<f64>>,
    /// Start of the first scan, s on the clock of the drift
    #[arg(help_heading = "Scans", long, value_name = "S", value_parser = numbers::number(numbers::NOT_NEGATIVE))]
    start: Option<f64>,
    /// Material of both layers
    #[arg(help_heading = "Sample", long, value_parser = parse_material)]
    material: Option<Material>,
    /// The layers: graphene for two equal ones, graphene/hBN for graphene (layer 2) on hBN (layer 1)
    #[arg(
        help_heading = "Sample",
        long,
        value_name = "UPPER/LOWER",
        conflicts_with = "material"
    )]
    layers: Option<String>,
    /// Show the atoms of this layer instead of the moiré: 1 (the lower one) or 2
    #[arg(help_heading = "Sample", long, value_name = "1|2", value_parser = clap::value_parser!(u8).range(1..=2))]
    atoms: Option<u8>,
    /// Twist, degrees
    #[arg(help_heading = "Sample", long, value_name = "DEG", allow_negative_numbers = true, value_parser = numbers::number(numbers::ANGLE_DEG))]
    twist: Option<f64>,
    /// Uniaxial strain of layer 2, per cent
    #[arg(help_heading = "Sample", long, value_name = "PERCENT", allow_negative_numbers = true, value_parser = numbers::number(numbers::STRAIN_PERCENT))]
    strain: Option<f64>,
    /// Isotropic (biaxial) strain of layer 2, added to the uniaxial one, per cent
    #[arg(help_heading = "Sample", long, value_name = "PERCENT", allow_negative_numbers = true, value_parser = numbers::number(numbers::STRAIN_PERCENT))]
    biaxial: Option<f64>,
    /// Axis of the strain, counted from layer 1, degrees
    #[arg(help_heading = "Sample", long, value_name = "DEG", allow_negative_numbers = true, value_parser = numbers::number(numbers::ANGLE_DEG))]
    strain_axis: Option<f64>,
    /// Orientation of the reciprocal vectors of layer 1, degrees
    #[arg(help_heading = "Sample", long, value_name = "DEG", allow_negative_numbers = true, value_parser = numbers::number(numbers::ANGLE_DEG))]
    lattice_angle: Option<f64>,
    /// Strength of the higher harmonics, 0 (three cosines) to below 1 (small spots)
    #[arg(help_heading = "Sample", long, value_name = "S", value_parser = numbers::number([0.0, 0.999]))]
    sharpness: Option<f64>,
    /// Drift velocity, nm/min
    #[arg(help_heading = "Drift and noise", long, num_args = 2, value_names = ["X", "Y"], allow_negative_numbers = true, value_parser = numbers::number(numbers::DRIFT))]
    drift: Option<Vec<f64>>,
    /// Change of the drift velocity, nm/min²
    #[arg(help_heading = "Drift and noise", long, num_args = 2, value_names = ["X", "Y"], allow_negative_numbers = true, value_parser = numbers::number(numbers::DRIFT))]
    acceleration: Option<Vec<f64>>,
    /// Noise of each pixel, degrees of phase (the moiré has an amplitude of 1°)
    #[arg(help_heading = "Drift and noise", long, value_name = "DEG", value_parser = numbers::number(numbers::NOT_NEGATIVE))]
    noise: Option<f64>,
    /// Noise of each line, degrees of phase
    #[arg(help_heading = "Drift and noise", long, value_name = "DEG", value_parser = numbers::number(numbers::NOT_NEGATIVE))]
    line_noise: Option<f64>,
    /// Noise of lines with a 1/f spectrum, degrees of phase
    #[arg(help_heading = "Drift and noise", long, value_name = "DEG", value_parser = numbers::number(numbers::NOT_NEGATIVE))]
    flicker: Option<f64>,
    /// Noise of the position sensors, nm
    #[arg(help_heading = "Drift and noise", long, value_name = "NM", value_parser = numbers::number(numbers::NOT_NEGATIVE))]
    sensor_noise: Option<f64>,
    /// Record no position sensors
    #[arg(help_heading = "Scans", long)]
    no_sensors: bool,
    /// Record no retrace
    #[arg(help_heading = "Scans", long)]
    no_retrace: bool,
}

/// Classes with their numbers.
#[derive(Clone, Debug)]
struct SampleGiven(Vec<SampleFeature>);

/// Samples in a line, lines in a frame.
#[derive(Clone, Copy, Debug)]
struct Pixels([usize; 2]);

#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum SlowAxis {
    X,
    Y,
}

#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum First {
    Up,
    Down,
}

impl SimulateArgs {
    /// The configuration file, if any, with the classes of the sample, and what is drawn.
    fn drawn(&self) -> anyhow::Result<Simulation> {
        let mut set = match &self.config {
            Some(path) => {
                let text = moiregauge_pipeline::read_text(path)
                    .with_context(|| format!("cannot read {}", path.display()))?;
                toml::from_str(&text).with_context(|| {
                    format!("{} does not describe a set of scans", path.display())
                })?
            }
            None => Simulation::default(),
        };
        for SampleGiven(features) in &self.sample {
            set.features.extend(features.iter().cloned());
        }
        if let Some(Pixels(pixels)) = self.pixels {
            set.raster.pixels = pixels;
        }
        if self.vary {
            let seed = self.seed.unwrap_or(set.seed);
            vary(&mut set, seed);
        }
        Ok(set)
    }

    /// The configuration file, if any, what is drawn, and the options on top.
    pub(super) fn settings(&self) -> anyhow::Result<Simulation> {
        let mut set = self.drawn()?;
        let pair = |values: &[f64]| [values[0], values[1]];
        let change = |value: Option<f64>, setting: &mut f64| {
            if let Some(value) = value {
                *setting = value;
            }
        };
        change(self.rate, &mut set.raster.line_rate_hz);
        change(self.start, &mut set.raster.start_s);
        change(self.twist, &mut set.sample.twist_deg);
        change(self.strain, &mut set.sample.strain_percent);
        change(self.biaxial, &mut set.sample.biaxial_percent);
        change(self.strain_axis, &mut set.sample.strain_axis_deg);
        change(self.lattice_angle, &mut set.sample.lattice_angle_deg);
        change(self.sharpness, &mut set.sample.sharpness);
        change(self.noise, &mut set.noise.pixel_deg);
        change(self.line_noise, &mut set.noise.line_deg);
        change(self.flicker, &mut set.noise.flicker_deg);
        change(self.sensor_noise, &mut set.noise.sensor_nm);
        if let Some(name) = &self.name {
            set.name.clone_from(name);
        }
        if let Some(seed) = self.seed {
            set.seed = seed;
        }
        if let Some(scans) = self.scans {
            set.raster.scans = scans;
        }
        if let Some(slow) = self.slow {
            set.raster.rotation_deg = match slow {
                SlowAxis::X => 90.0,
                SlowAxis::Y => 0.0,
            };
        }
        if let Some(first) = self.first {
            set.raster.first_direction = match first {
                First::Up => FirstDirection::Up,
                First::Down => FirstDirection::Down,
            };
        }
        if let Some(size) = &self.size {
            set.raster.nominal_size_nm = pair(size);
        }
        if let Some(material) = &self.material {
            set.sample.material = material.clone();
        }
        if let Some(layers) = &self.layers {
            (set.sample.material, set.sample.substrate) = named_layers(layers, &[])?;
        }
        if let Some(layer) = self.atoms {
            set.sample.pattern = if layer == 1 {
                Pattern::Layer1
            } else {
                Pattern::Layer2
            };
        }
        if let Some(drift) = &self.drift {
            set.drift.velocity_nm_per_min = pair(drift);
        }
        if let Some(acceleration) = &self.acceleration {
            set.drift.acceleration_nm_per_min2 = pair(acceleration);
        }
        set.raster.sensors &= !self.no_sensors;
        set.raster.retrace &= !self.no_retrace;
        Ok(set)
    }
}

fn parse_sample(text: &str) -> Result<SampleGiven, String> {
    SampleFeature::parse(text)
        .map(SampleGiven)
        .map_err(|error| error.to_string())
}

fn parse_pixels(text: &str) -> Result<Pixels, String> {
    let (columns, rows) = text.split_once(['x', 'X', '×']).unwrap_or((text, text));
    let number = |part: &str| {
        numbers::count(2, MOST_PIXELS)(part)
            .map_err(|expected| format!("{expected}, or two of them as in 512x256, found {text:?}"))
    };
    Ok(Pixels([number(columns)?, number(rows)?]))
}

fn parse_material(text: &str) -> Result<Material, String> {
    Material::named(text).ok_or_else(|| {
        let names: Vec<String> = Material::all().into_iter().map(|m| m.name).collect();
        format!("expected one of {}, found {text:?}", names.join(", "))
    })
}

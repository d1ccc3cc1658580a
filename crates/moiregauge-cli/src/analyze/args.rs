//! The options of `moiregauge analyze` → settings.

use std::path::PathBuf;

use anyhow::Context as _;
use clap::ValueEnum;
use heterostrain::material::Material;
use heterostrain::strain::StrainConvention;
use moiregauge::frame::Background;
use moiregauge::settings::{
    GivenDrift, Grouping, Lines, MOST_DRAWS, MOST_IMAGES, MoireLayers, Settings,
};
use moiregauge::spectrum::Method;
use moiregauge_pipeline::Job;
use moiregauge_pipeline::calibrate::ruler_from;
use moiregauge_report::results::NamedSet;
use moiregauge_report::{Choice, ColorMap};

use super::by_hand::HandArgs;
use super::orientation::OrientationArgs;
use crate::config;
use crate::input::KnownArgs;
use crate::numbers;
use crate::paths::expand;
use crate::scanner::ScannerArgs;

/// Headings of the help.
const SCANS: &str = "Which scans, and how they belong together";
const METHOD: &str = "Method";
const LAYERS: &str = "Layers";
const OUTPUT: &str = "Output";
const SCANNER: &str = "Scanner and uncertainty budget";

/// What an analysis asks, for every command that begins with one.
#[derive(clap::Args, Clone, Debug)]
// Each is a switch of its own on the command line.
#[allow(clippy::struct_excessive_bools)]
pub(crate) struct AnalyzeArgs {
    /// Scan files, folders (the scans in them, without subfolders) or names with * and ?
    #[arg(required_unless_present = "replay", value_name = "PATH")]
    pub(super) paths: Vec<PathBuf>,
    /// Folder for results.json, tables, figures and report.html
    ///
    /// It is created if it does not exist. Default with --replay: beside the folder of the document.
    #[arg(long, value_name = "DIR", required_unless_present = "replay")]
    pub(super) out: Option<PathBuf>,
    /// Repeat the run recorded in a results.json (or in a map.json, with `map`)
    ///
    /// The same files, settings and options give the same bytes. The files are found by name and content and checked
    /// first; other options are refused.
    #[arg(long, value_name = "FILE")]
    pub(super) replay: Option<PathBuf>,
    /// Folder in which --replay looks for the files; may be repeated [default: the current folder; that of the document
    /// and the one above it]
    #[arg(long, value_name = "DIR", requires = "replay")]
    pub(super) data: Vec<PathBuf>,
    /// Settings from a TOML file, a results.json or a map.json
    ///
    /// `moiregauge config` prints a file to begin with. Options on the command line override the file.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Channel that shows the moiré [default: the first usual one]
    ///
    /// The usual ones are TR Phase, TR Amplitude, Phase, … in this order; if no scan shows a lattice in one, the next is
    /// tried.
    #[arg(long, value_name = "NAME", help_heading = SCANS)]
    channel: Option<String>,
    /// Number of the image, if a file holds several images of the channel (pages, frames) [default: the first]
    #[arg(long, value_name = "N", value_parser = numbers::count(1, MOST_IMAGES), help_heading = SCANS)]
    image: Option<usize>,
    /// Line directions to use [default: both]
    #[arg(long, value_enum, help_heading = SCANS)]
    line: Option<LineArg>,
    /// Estimator of the lattice vectors [default: lattice]
    #[arg(long, value_enum, help_heading = METHOD)]
    method: Option<MethodArg>,
    /// The layers: graphene, hBN, MoS2, … [default: graphene]
    #[arg(long, value_name = "NAME", help_heading = LAYERS)]
    material: Option<String>,
    /// The layers: graphene, MoS2, graphene/hBN, …
    ///
    /// graphene stands for two equal layers, graphene/hBN for graphene (layer 2) on hBN (layer 1, the reference); names
    /// from --materials too. With --moires N: one pair for all moirés, or one for each, the largest cell first:
    /// graphene,graphene/hBN.
    #[arg(
        long,
        value_name = "UPPER/LOWER[,…]",
        value_delimiter = ',',
        conflicts_with = "material", help_heading = LAYERS
    )]
    layers: Vec<String>,
    /// TOML file with layers of your own, one [[layer]] table each (see `moiregauge config`)
    #[arg(long, value_name = "FILE", help_heading = LAYERS)]
    pub(super) materials: Option<PathBuf>,
    /// Lattice constant of the layers, nm, instead of that of the material
    #[arg(long, value_name = "NM", value_parser = numbers::number([0.01, 100.0]), help_heading = LAYERS)]
    lattice_constant: Option<f64>,
    /// Poisson ratio of the layers, instead of that of the material
    #[arg(long, value_name = "RATIO", value_parser = numbers::number([-1.0, 1.0]), help_heading = LAYERS)]
    poisson_ratio: Option<f64>,
    /// Standard uncertainty of the lattice constant, nm, for the budget [default: the material's]
    #[arg(long, value_name = "NM", value_parser = numbers::number([0.0, 10.0]), help_heading = LAYERS)]
    lattice_constant_sigma: Option<f64>,
    /// Standard uncertainty of the Poisson ratio, for the budget [default: the material's]
    #[arg(long, value_name = "RATIO", value_parser = numbers::number([0.0, 0.5]), help_heading = LAYERS)]
    poisson_ratio_sigma: Option<f64>,
    /// Form of the strain equation [default: real-space]
    #[arg(long, value_enum, help_heading = METHOD)]
    strain_convention: Option<ConventionArg>,
    /// What is subtracted from an image first [default: plane]
    #[arg(long, value_enum, help_heading = METHOD)]
    background: Option<BackgroundArg>,
    /// How files become sets [default: auto]
    #[arg(long, value_enum, help_heading = SCANS)]
    grouping: Option<GroupingArg>,
    /// Make a set by hand: all files under PATH (a folder or a file among the inputs) form the set NAME; may be repeated
    #[arg(long = "set", value_name = "NAME=PATH", help_heading = SCANS)]
    sets: Vec<String>,
    /// Show scans with these names but do not use them
    ///
    /// * stands for any characters. May be repeated.
    #[arg(long, value_name = "NAME", help_heading = SCANS)]
    exclude: Vec<String>,
    /// Leave out scans that do not fit the others (leave-one-out χ², p < 0.001 divided by the number of scans)
    #[arg(long, help_heading = SCANS)]
    exclude_outliers: bool,
    /// Standard uncertainty of the frame times in the files, s [default: 0.6]
    #[arg(long, value_name = "S", value_parser = numbers::number(numbers::TIME_S), help_heading = METHOD)]
    frame_time_sigma: Option<f64>,
    /// Number of moirés that every image shows [default: 1]
    ///
    /// Each is fitted after the others are subtracted and has its own folder of results.
    #[arg(long, value_name = "N", value_parser = numbers::count(1, 6), help_heading = SCANS)]
    moires: Option<usize>,
    /// Use only the region that all scans have in common
    #[arg(long, help_heading = SCANS)]
    overlap: bool,
    /// Use this known drift, nm/min, instead of measuring it
    #[arg(long, num_args = 2, value_names = ["X", "Y"], allow_negative_numbers = true, value_parser = numbers::number(numbers::DRIFT), help_heading = METHOD)]
    drift: Option<Vec<f64>>,
    /// Standard uncertainty of each component of --drift, nm/min
    #[arg(long, value_name = "SIGMA", requires = "drift", value_parser = numbers::number(numbers::NOT_NEGATIVE), help_heading = METHOD)]
    drift_sigma: Option<f64>,
    /// Standard uncertainty of a drift that scans do not tell, nm/min [default: 1]
    #[arg(long, value_name = "SIGMA", value_parser = numbers::number(numbers::NOT_NEGATIVE), help_heading = METHOD)]
    drift_prior: Option<f64>,
    /// Monte Carlo draws for the drift, per set [default: 10000]
    #[arg(long, value_name = "N", value_parser = numbers::count(0, MOST_DRAWS), help_heading = METHOD)]
    drift_draws: Option<usize>,
    /// Monte Carlo draws for twist and strain, per scan [default: 1000]
    #[arg(long, value_name = "N", value_parser = numbers::count(0, MOST_DRAWS), help_heading = METHOD)]
    strain_draws: Option<usize>,
    /// Seed of all random numbers [default: 1]
    #[arg(long, help_heading = METHOD)]
    seed: Option<u64>,
    /// Number of threads [default: all processors]; the results do not depend on it
    #[arg(long, value_name = "N", value_parser = numbers::count(1, 1024))]
    pub(crate) threads: Option<usize>,
    /// Colours of images
    #[arg(long, value_enum, default_value_t = ColorMapArg::Viridis, help_heading = OUTPUT)]
    colormap: ColorMapArg,
    /// An image of a larger area, taken with the same scanner: a figure marks the frames of the scans in it
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(super) survey_image: Option<PathBuf>,
    /// Numbers and tables only: no figures, no report
    #[arg(long, help_heading = OUTPUT)]
    no_report: bool,
    /// Figures as SVG only, without PNG copies
    #[arg(long, help_heading = OUTPUT)]
    no_png: bool,
    /// Write images corrected by the sensors and for the drift, on a square grid in laboratory axes,
    /// one file per scan and line: corrected.gwy makes OUT/corrected/SCAN-trace.gwy and so on; also
    /// .gsf, .npz, .zarr, .tiff, .csv
    #[arg(long, value_name = "NAME.EXT", value_delimiter = ',', help_heading = OUTPUT)]
    pub(super) export: Vec<String>,
    /// Write vectors, scans, sets and budget as Parquet too
    #[arg(long, help_heading = OUTPUT)]
    pub(super) parquet: bool,
    /// Give vectors, angles, drift, figures and exported images in laboratory axes: a frame that was scanned at an
    /// angle is turned back. This is the default; `--rotation 0` gives the axes of the image
    #[arg(long, help_heading = OUTPUT)]
    rotate_to_lab: bool,
    /// Print results.json instead of the summary
    ///
    /// With --moires a list with one entry for each moiré, the largest cell first.
    #[arg(long)]
    pub(super) json: bool,
    /// Open the report when it is written
    #[arg(long, help_heading = OUTPUT, conflicts_with = "no_report")]
    open: bool,
    /// Print nothing but errors
    #[arg(long, short)]
    pub(super) quiet: bool,
    /// Replace the results of an earlier analysis
    #[arg(long)]
    pub(super) force: bool,
    // Last, since a heading holds for all that follows.
    #[command(flatten)]
    pub(super) orientation: OrientationArgs,
    #[command(flatten)]
    pub(super) by_hand: HandArgs,
    #[command(flatten)]
    scanner: ScannerArgs,
    /// Frames that show the atoms of a layer, through the same scanner at the same scan angle, at another magnification: they
    /// calibrate the scanner. Of layer 2, or of that which --ruler names
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with = "calibration", help_heading = SCANNER)]
    ruler_from: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) known: KnownArgs,
}

impl AnalyzeArgs {
    /// The settings file, or the defaults, with the options on top.
    pub(crate) fn settings(&self) -> anyhow::Result<Settings> {
        let mut s = match &self.config {
            Some(path) => config::read(path)?,
            None => Settings::default(),
        };
        let own = config::own_materials(self.materials.as_deref())?;
        self.layers(&mut s, &own)?;
        self.orientation.apply(&mut s);
        self.by_hand.apply(&mut s)?;
        let by_user = [self.lattice_constant, self.poisson_ratio];
        if by_user.iter().any(Option::is_some) {
            anyhow::ensure!(
                s.substrate.is_none() && s.moire_layers.is_empty(),
                "--lattice-constant and --poisson-ratio are for two equal layers. Describe different layers in a file \
                 (--materials)"
            );
            s.material.source = format!("{}, changed by the user", s.material.name);
        }
        if let Some(a) = self.lattice_constant {
            s.material.lattice_constant_nm = a;
            s.layers_chosen = true;
        }
        if let Some(ratio) = self.poisson_ratio {
            s.material.poisson_ratio = ratio;
        }
        let priors = [
            (
                self.lattice_constant_sigma,
                &mut s.material.lattice_constant_sigma_nm,
            ),
            (
                self.poisson_ratio_sigma,
                &mut s.material.poisson_ratio_sigma,
            ),
        ];
        for (given, setting) in priors {
            *setting = given.unwrap_or(*setting);
        }
        s.moires = self.moires.unwrap_or(s.moires);
        self.scanner.apply(&mut s)?;
        if self.channel.is_some() {
            s.channel.clone_from(&self.channel);
        }
        s.image = self.image.or(s.image);
        if let Some(xy) = &self.drift {
            s.drift = Some(GivenDrift {
                x_nm_per_min: xy[0],
                y_nm_per_min: xy[1],
                sigma_nm_per_min: self.drift_sigma.unwrap_or(0.0),
            });
        }
        if matches!(self.method, Some(MethodArg::Paper)) {
            s = s.as_published();
        }
        s.line = self.line.map_or(s.line, Into::into);
        s.method = self.method.map_or(s.method, Into::into);
        s.strain_convention = self
            .strain_convention
            .map_or(s.strain_convention, Into::into);
        s.background = self.background.map_or(s.background, Into::into);
        s.grouping = self.grouping.map_or(s.grouping, Into::into);
        s.overlap |= self.overlap;
        s.exclude.extend(self.exclude.iter().cloned());
        s.exclude_outliers |= self.exclude_outliers;
        s.frame_time_sigma_s = self.frame_time_sigma.unwrap_or(s.frame_time_sigma_s);
        s.drift_prior_nm_per_min = self.drift_prior.unwrap_or(s.drift_prior_nm_per_min);
        s.drift_draws = self.drift_draws.unwrap_or(s.drift_draws);
        s.strain_draws = self.strain_draws.unwrap_or(s.strain_draws);
        s.seed = self.seed.unwrap_or(s.seed);
        config::check(&s)?;
        if !self.ruler_from.is_empty() {
            let files = expand(&self.ruler_from, true);
            let files = files.into_iter().map(|path| {
                path.map_err(|one| anyhow::anyhow!("--ruler-from {}: {}", one.file, one.error))
            });
            let files = files.collect::<anyhow::Result<Vec<_>>>()?;
            let job = Job::quiet(self.threads)?;
            let found = ruler_from(&files, &self.known.user_specified(), &s, &job);
            s.scanner = Some(found.context("--ruler-from")?);
        }
        Ok(s)
    }

    /// The layers: one pair for all moirés, or one for each.
    fn layers(&self, s: &mut Settings, own: &[Material]) -> anyhow::Result<()> {
        let named = self.layers.iter().chain(&self.material);
        let mut pairs = named
            .map(|name| config::named_layers(name, own))
            .collect::<anyhow::Result<Vec<_>>>()?;
        if pairs.is_empty() {
            return Ok(());
        }
        s.moire_layers.clear();
        s.layers_chosen = true;
        if pairs.len() == 1 {
            (s.material, s.substrate) = pairs.swap_remove(0);
        } else {
            let each = pairs.into_iter();
            s.moire_layers
                .extend(each.map(|(upper, lower)| MoireLayers::new(upper, lower)));
        }
        Ok(())
    }

    /// Files and folders.
    pub(crate) fn paths(&self) -> &[PathBuf] {
        &self.paths
    }

    /// Refuses what goes with one sample only.
    ///
    /// # Errors
    /// The first option of that kind.
    pub(crate) fn only_settings(&self) -> anyhow::Result<()> {
        self.refuse("is for one sample: use it with `moiregauge analyze`", &[])
    }

    /// Refuses what goes with results that are written once.
    ///
    /// # Errors
    /// The first option of that kind.
    pub(crate) fn only_numbers(&self) -> anyhow::Result<()> {
        for (option, given) in [("--out", self.out.is_some()), ("--open", self.open)] {
            anyhow::ensure!(!given, "{option} is for `moiregauge analyze`");
        }
        self.refuse("is for `moiregauge analyze`", &["--json"])
    }

    /// Refuses options that make or describe the results of one sample, but for those `allowed`.
    fn refuse(&self, why: &str, allowed: &[&str]) -> anyhow::Result<()> {
        let atomic = self.orientation.asked()?.is_some();
        for (option, given) in [
            ("--replay", self.replay.is_some()),
            ("--set", !self.sets.is_empty()),
            ("--survey-image", self.survey_image.is_some()),
            ("--export", !self.export.is_empty()),
            ("--parquet", self.parquet),
            ("--no-report", self.no_report),
            ("--no-png", self.no_png),
            ("--json", self.json),
            ("--force", self.force),
            ("--atomic", atomic),
        ] {
            anyhow::ensure!(!given || allowed.contains(&option), "{option} {why}");
        }
        Ok(())
    }

    /// The folder for results.
    pub(crate) fn out(&self) -> &std::path::Path {
        self.out.as_deref().unwrap_or(std::path::Path::new(""))
    }

    /// The image of a larger area.
    pub(crate) fn survey_image(&self) -> Option<&std::path::Path> {
        self.survey_image.as_deref()
    }

    /// The folder for results, that of a repetition where none is given.
    pub(crate) fn results_folder(&self) -> PathBuf {
        let document = self.replay.as_ref().filter(|_| self.out.is_none());
        document.map_or_else(|| self.out().to_owned(), |d| super::again::out_beside(d))
    }

    /// Whether an earlier run is to be repeated.
    pub(crate) fn is_replay(&self) -> bool {
        self.replay.is_some()
    }

    /// These options, with the folder of results, the threads and the words of others.
    pub(crate) fn with_place_of(self, other: &Self) -> Self {
        Self {
            out: Some(other.results_folder()),
            replay: other.replay.clone(),
            threads: other.threads,
            force: other.force,
            json: other.json,
            open: other.open,
            quiet: other.quiet,
            ..self
        }
    }

    /// Whether results may be written over.
    pub(crate) fn force(&self) -> bool {
        self.force
    }

    /// Shows a page that was written, if that is wanted.
    pub(crate) fn show(&self, page: &std::path::Path) {
        if !self.open {
            return;
        }
        if let Err(error) = open::that_detached(page) {
            eprintln!("note: cannot show {}: {error}", page.display());
        }
    }

    /// Whether results go to standard output as JSON.
    pub(crate) fn json(&self) -> bool {
        self.json
    }

    /// Whether words for people go to the screen.
    pub(crate) fn is_loud(&self) -> bool {
        !self.quiet && !self.json
    }

    /// The sets made by hand.
    pub(crate) fn sets(&self) -> anyhow::Result<Vec<NamedSet>> {
        let parse = |text: &String| match text.split_once('=') {
            Some((name, path)) if !name.is_empty() && !path.is_empty() => Ok(NamedSet {
                name: name.to_owned(),
                path: path.to_owned(),
            }),
            _ => anyhow::bail!("--set expects NAME=PATH, found {text:?}"),
        };
        self.sets.iter().map(parse).collect()
    }

    pub(crate) fn choice(&self) -> Choice {
        Choice {
            figures: !self.no_report,
            png: !self.no_report && !self.no_png,
            html: !self.no_report,
            colormap: match self.colormap {
                ColorMapArg::Viridis => ColorMap::Viridis,
                ColorMapArg::Grey => ColorMap::Grey,
                ColorMapArg::Nanoscope => ColorMap::Nanoscope,
                ColorMapArg::Gwyddion => ColorMap::Gwyddion,
            },
        }
    }
}

/// Colour maps of images.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum ColorMapArg {
    Viridis,
    Grey,
    /// The brown of the NanoScope software
    Nanoscope,
    /// Gwyddion's default
    Gwyddion,
}

/// The library's enums know nothing of command lines: one mirror each.
macro_rules! mirror {
    ($mirror:ident => $target:ident { $($(#[$help:meta])* $variant:ident),+ $(,)? }) => {
        #[derive(Clone, Copy, Debug, ValueEnum)]
        pub(crate) enum $mirror { $($(#[$help])* $variant),+ }
        impl From<$mirror> for $target {
            fn from(value: $mirror) -> Self {
                match value { $($mirror::$variant => Self::$variant),+ }
            }
        }
    };
}

mirror!(LineArg => Lines { Trace, Retrace, Both });
mirror!(MethodArg => Method {
    /// Harmonics fitted to the pixels, then one joint fit to all scans: errors near the Cramér–Rao bound
    Lattice,
    /// Autocorrelation divided by the overlap, sub-pixel peaks, several shells
    Autocorrelation,
    /// Peaks of the Fourier transform with a Hann window, sub-pixel, exact inverse
    Fourier,
    /// As published in arXiv 2406.08681, for comparison only: it is biased
    Paper,
});
mirror!(ConventionArg => StrainConvention {
    /// The stretch acts on atomic positions: positive is tension
    RealSpace,
    /// The stretch acts on reciprocal vectors: positive is compression
    KSpace,
});
mirror!(BackgroundArg => Background {
    Mean, Plane, Quadratic, Cubic,
    /// The mean of each line: damages harmonics whose crests run along the fast axis
    LineMean,
});
mirror!(GroupingArg => Grouping {
    /// By slow axis, line rate, size and channel
    Auto,
    /// As auto, but files of different folders are never in one set
    Folder,
    /// Every file by itself
    File,
});

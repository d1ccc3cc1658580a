//! The options of `moiregauge map`.

use anyhow::{Context as _, ensure};
use clap::{Args as _, FromArgMatches as _, ValueEnum};
use moiregauge::survey::MapMethod;
use moiregauge_pipeline::maps::MapRequest;

use super::domains::DomainArgs;
use super::hint::in_words;
use super::regions::RegionArgs;
use crate::analyze::{AnalyzeArgs, Task};
use crate::numbers;

/// Maps of twist, strain, wavelength and orientation across an image, with the error of every node
///
/// The scans are analysed first as `moiregauge analyze` does; their drift and sensors correct the maps. Local
/// wave vectors of all harmonics come from the phases under a Gaussian window; maps of scans of one place are
/// compared and averaged. Bad nodes (edges, weak signal, defects, boundaries) are
/// marked with the reason.
#[derive(clap::Args, Clone, Debug)]
#[command(after_long_help = "\
Examples:
  moiregauge map scan.000 --out maps
  moiregauge map scans/ --out maps --window 12
  moiregauge map survey.npy --out maps --size 1.5um×1.5um --step 5
  moiregauge map scan.000 --out maps --device 200nm×100nm --wanted 1.05±0.02
  moiregauge map scan.000 --out maps --region bar=10,20,80,40 --region 'flake=0,0 1um,10nm 600nm,0.8um'
  moiregauge map scan.000 --out maps --profile 'cut=0,0 100,80'
  moiregauge map small_angle.sxm --out maps --domains on --nodes bright

Written: report.html, map.zarr and map.gwy (all quantities, their errors, mask), undistorted.gwy (the image with its
lattice made straight), displacement.csv (displacement, registry of the layers), cell.csv (averaged moiré cell),
map.json (summary), figures/, and what was asked for: regions.csv, profiles.csv, devices.csv, domains.csv, nodes.csv;
columns.md explains them.")]
pub(crate) struct MapArgs {
    #[command(flatten)]
    pub(super) analyze: AnalyzeArgs,
    /// How local lattices are measured
    #[arg(help_heading = "Maps", long, value_enum, default_value_t = MapMethodArg::Demodulation)]
    map_method: MapMethodArg,
    /// Width of the Gaussian window (standard deviation), nm
    ///
    /// The resolution is 2.35 times this. Default: as wide as the lattice stays straight, at least 0.6 periods. With tiles:
    /// the side of a tile; default: 6 periods.
    #[arg(long, value_name = "NM", value_parser = numbers::number(numbers::LENGTH_NM), help_heading = "Maps")]
    window: Option<f64>,
    /// Distance of the nodes, nm [default: a third of the window, at least two pixels; a quarter of a tile]
    #[arg(long, value_name = "NM", value_parser = numbers::number(numbers::LENGTH_NM), help_heading = "Maps")]
    step: Option<f64>,
    /// Map in bands, as is always done for images of more than 20 million pixels; several files are put side by side
    #[arg(help_heading = "Maps", long)]
    in_bands: bool,
    /// Margin at the edges, in windows [default: 2, or a quarter of the frame where that is less]
    #[arg(long, value_name = "WINDOWS", value_parser = numbers::number([0.0, 10.0]), help_heading = "Maps")]
    margin: Option<f64>,
    #[command(flatten)]
    regions: RegionArgs,
    #[command(flatten)]
    domains: DomainArgs,
}

/// How local lattices are measured.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum MapMethodArg {
    /// Phases of all harmonics under a Gaussian window
    Demodulation,
    /// The fit of whole images on overlapping tiles: slower and coarser, for comparison
    Tiles,
}

impl From<MapMethodArg> for MapMethod {
    fn from(value: MapMethodArg) -> Self {
        match value {
            MapMethodArg::Demodulation => Self::Demodulation,
            MapMethodArg::Tiles => Self::Tiles,
        }
    }
}

impl MapArgs {
    /// The options of the run to be repeated, with the place and the words of this one.
    pub(super) fn again(&self, task: &Task) -> anyhow::Result<Self> {
        let no_map = "--replay: the document has no options of a map";
        let recorded = task.run.arguments.split_first();
        let (_, options) = recorded
            .filter(|(command, _)| *command == "map")
            .context(no_map)?;
        // Where results go is no part of what was asked.
        let place = ["map", "--out", "."].map(str::to_owned);
        let command = Self::augment_args(clap::Command::new("map")).allow_negative_numbers(true);
        let given = command.try_get_matches_from(place.iter().chain(options));
        let mut args = Self::from_arg_matches(&given.context(no_map)?).context(no_map)?;
        args.analyze = args.analyze.with_place_of(&self.analyze);
        Ok(args)
    }

    /// Refuses what a map has no use for, and names that are used twice.
    pub(super) fn check(&self, task: &Task) -> anyhow::Result<()> {
        ensure!(
            task.run.atomic.is_none() && task.run.export.is_empty() && !task.run.parquet,
            "--atomic, --export and --parquet belong to `moiregauge analyze`; a map does not use them"
        );
        self.request().check().map_err(in_words)?;
        ensure!(
            self.analyze.survey_image().is_none(),
            "--survey-image belongs to `moiregauge analyze`"
        );
        Ok(())
    }

    /// How many threads are wanted.
    pub(crate) fn threads(&self) -> Option<usize> {
        self.analyze.threads
    }

    /// Whether words for people go to the screen.
    pub(crate) fn is_loud(&self) -> bool {
        self.analyze.is_loud()
    }

    /// What map is wanted.
    pub(super) fn request(&self) -> MapRequest {
        MapRequest {
            method: self.map_method.into(),
            window_nm: self.window,
            step_nm: self.step,
            margin: self.margin,
            in_bands: self.in_bands,
            questions: self.regions.questions(),
            domains: self.domains.search(),
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use moiregauge_serve::map_as_options;

    use super::*;

    #[derive(Parser)]
    struct Typed {
        #[command(flatten)]
        map: MapArgs,
    }

    #[test]
    fn options_ask_for_the_same() {
        let text = r#"{
            "method": "tiles", "margin": 1.5, "window_nm": 12.25, "in_bands": true,
            "domains": {"when": "on", "nodes": "dark"},
            "questions": {
                "regions": [{"name": "bar", "corners_nm": [[0, 0], [4, -1], [0, 2]]}],
                "profiles": [{"name": "cut", "ends_nm": [[0, 0], [3, 4]]}],
                "device": {"size_nm": [40, 20], "orientations": 3}
            }
        }"#;
        let request: MapRequest = serde_json::from_str(text).unwrap();
        let typed = ["map", "scan", "--out", "out"].map(str::to_owned);
        let typed = typed.into_iter().chain(map_as_options(&request));
        assert_eq!(Typed::parse_from(typed).map.request(), request);
        assert!(map_as_options(&MapRequest::default()).is_empty());
    }
}

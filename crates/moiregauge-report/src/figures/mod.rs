//! The figures, one short file each: an analysis goes in, an SVG and its caption come out.
//!
//! A figure whose data are absent is left out and says why. Marker and colour of each lattice
//! vector, and filled symbols for up scans, open ones for down scans, are the same everywhere.

mod amplitude;
mod budget;
mod cell;
mod comparison;
mod drift;
mod error_relation;
mod layout;
mod map;
mod map_domains;
mod map_fields;
mod map_histograms;
mod map_image;
mod map_mask;
mod map_panel;
mod map_profiles;
mod map_stripes;
mod parameters;
mod pulls;
mod residuals;
mod scan;
mod sensor_line;
mod sets;
mod survey;
mod transforms;
mod twist_strain;
mod twist_wavelength;
mod velocities;
mod wavelengths;
mod wavelengths_nominal;
mod window;

pub use cell::cell as cell_figure;
pub use map::map_figures;
pub use map_stripes::stripe_figures;
pub use pulls::pulls;

use moiregauge::campaign::{Analysis, SetAnalysis};

use crate::draw::colormap::ColorMap;
use crate::draw::png;
use crate::error::ReportError;

/// A figure, or the reason why there is none.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Name for files, unique within a report, as in `set1-drift`.
    pub name: String,
    /// The set it belongs to, counted from 0; `None` for one of all sets together.
    pub set: Option<usize>,
    /// Title for people.
    pub title: &'static str,
    /// The drawing, or why it was left out.
    pub drawing: Result<Drawing, String>,
}

/// A drawn figure.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// The figure as an SVG document.
    pub svg: String,
    /// What it shows, with its conventions.
    pub caption: String,
    /// Whether it is as wide as a journal page (180 mm) and not as a column (88 mm).
    pub wide: bool,
}

impl Drawing {
    /// The figure as a PNG of 300 dots per inch.
    ///
    /// # Errors
    /// [`ReportError::Png`] if it cannot be rendered.
    pub fn png(&self) -> Result<Vec<u8>, ReportError> {
        png::render(&self.svg)
    }
}

/// What a figure is drawn from.
#[derive(Clone, Copy, Debug)]
struct Subject<'a> {
    id: &'a str,
    analysis: &'a Analysis,
    set: &'a SetAnalysis,
    map: ColorMap,
}

type Draw = fn(&Subject) -> Result<Drawing, String>;

const OF_A_SET: [(&str, &str, Draw); 15] = [
    ("scan", "Scan with intended and actual frame", scan::draw),
    ("amplitude", "Phase and amplitude", amplitude::draw),
    (
        "transforms",
        "Autocorrelation and spectrum",
        transforms::draw,
    ),
    (
        "nominal",
        "Wavelengths and naive twist: nominal against sensor",
        wavelengths_nominal::draw,
    ),
    (
        "wavelengths",
        "Wavelengths before and after drift correction",
        wavelengths::draw,
    ),
    (
        "drift",
        "Drift: distribution, fit and residual",
        drift::draw,
    ),
    (
        "twist-strain",
        "Twist and strain before and after drift correction",
        twist_strain::draw,
    ),
    (
        "parameters",
        "Distributions of twist and strain",
        parameters::draw,
    ),
    (
        "sensor-line",
        "Position sensor along one line",
        sensor_line::draw,
    ),
    (
        "residuals",
        "Residual maps of the position sensors",
        residuals::draw,
    ),
    ("velocities", "Tip velocities", velocities::draw),
    ("window", "Centre of the scanned window", window::draw),
    (
        "twist-wavelength",
        "Twist against wavelength",
        twist_wavelength::draw,
    ),
    (
        "error-relation",
        "Twist error against wavelength error",
        error_relation::draw,
    ),
    ("estimators", "Two estimators compared", comparison::draw),
];

/// Every figure of an analysis in the order of the report, drawn or with the reason why not.
pub fn figures(analysis: &Analysis, map: ColorMap) -> Vec<Figure> {
    let together = Figure {
        name: "sets".to_owned(),
        set: None,
        title: "All sets compared",
        drawing: sets::draw(analysis, "sets"),
    };
    let budget = Figure {
        name: "budget".to_owned(),
        set: None,
        title: "Uncertainty budget",
        drawing: budget::draw(analysis, "budget"),
    };
    let survey = Figure {
        name: "survey".to_owned(),
        set: None,
        title: "Survey image with the scanned frames",
        drawing: survey::draw(analysis, "survey", map),
    };
    let of_sets = analysis.sets.iter().enumerate().flat_map(|(index, set)| {
        OF_A_SET.iter().map(move |&(name, title, draw)| {
            let name = format!("set{}-{name}", index + 1);
            let subject = Subject {
                id: &name,
                analysis,
                set,
                map,
            };
            let title = if name.ends_with("-estimators") {
                comparison::title(analysis.settings.method)
            } else {
                title
            };
            Figure {
                set: Some(index),
                title,
                drawing: draw(&subject),
                name,
            }
        })
    });
    [together, budget, survey]
        .into_iter()
        .chain(of_sets)
        .collect()
}

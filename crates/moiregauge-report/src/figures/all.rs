//! Every figure of an analysis, in the order of the report.

use moiregauge::campaign::Analysis;

use super::figure::{Drawing, Figure};
use super::subject::Subject;
use super::{
    amplitude, budget, comparison, curved, drift, error_relation, parameters, residuals, scan,
    sensor_line, sets, survey, transforms, twist_strain, twist_wavelength, velocities, wavelengths,
    wavelengths_nominal, window,
};
use crate::draw::colormap::ColorMap;

type Draw = fn(&Subject) -> Result<Drawing, String>;

const OF_A_SET: [(&str, &str, Draw); 16] = [
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
    (
        "curved-grid",
        "Position sensors of a scanner that bends",
        curved::draw,
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

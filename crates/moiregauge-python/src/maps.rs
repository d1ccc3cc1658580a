//! Maps of twist and strain.

use moiregauge::domains::regime;
use moiregauge::survey::MapMethod;
use moiregauge::window::Resolution;
use moiregauge_pipeline::Job;
use moiregauge_pipeline::campaign::{Outcome, no_advice};
use moiregauge_pipeline::maps::{Mapped, NoMap, Scans, map_lattices};
use moiregauge_report::results::{Conventions, MapResults, mask_counts, quantities};
use moiregauge_report::{MapDetails, map_scan};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Deserialize;

use crate::analysis::Analysis;
use crate::arrays;
use crate::errors::{nothing, stopped, wrong};
use crate::work::work;

/// What is asked of a map.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Asked {
    method: String,
    window_nm: Option<f64>,
    step_nm: Option<f64>,
    margin: Option<f64>,
}

impl Asked {
    fn method(&self) -> PyResult<MapMethod> {
        match self.method.as_str() {
            "demodulation" => Ok(MapMethod::Demodulation),
            "tiles" => Ok(MapMethod::Tiles),
            other => Err(wrong(format!(
                "map_method: expected \"demodulation\" or \"tiles\", found {other:?}"
            ))),
        }
    }
}

/// Maps the scans of an analysis: the document, and every quantity with its unit and values.
#[pyfunction]
#[pyo3(signature = (analysis, asked, threads, progress))]
pub(crate) fn map<'py>(
    py: Python<'py>,
    analysis: &Analysis,
    asked: &str,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, Bound<'py, PyDict>)> {
    let asked: Asked = serde_json::from_str(asked).map_err(wrong)?;
    asked.method()?;
    let (document, planes) = work(py, threads, progress.as_ref(), |job| {
        let outcome = analysis.first_outcome(job)?;
        let found = mapped(analysis, &outcome, &asked, job)?;
        let planes = map_scan(&found.map).channels;
        let document = document(found, outcome, &asked);
        Ok((serde_json::to_string(&document).map_err(wrong)?, planes))
    })?;
    let all = PyDict::new(py);
    for plane in planes {
        let shape = [plane.rows, plane.columns];
        let values = arrays::values(py, plane.values(), shape)?;
        all.set_item(&plane.name, (&plane.unit, values))?;
    }
    Ok((document, all))
}

fn mapped(analysis: &Analysis, outcome: &Outcome, asked: &Asked, job: &Job) -> PyResult<Mapped> {
    let scans = Scans {
        analysis: &outcome.analysis,
        inputs: analysis.inputs(),
        known: &analysis.known(),
        advice: no_advice,
    };
    let resolution = Resolution {
        window_nm: asked.window_nm,
        step_nm: asked.step_nm,
        margin: asked.margin,
    };
    map_lattices(&scans, asked.method()?, &resolution, job).map_err(|error| match error {
        NoMap::Cancelled(_) => stopped(),
        NoMap::Nothing { failed } => nothing("no image gave a map", &failed, true),
        other => wrong(other),
    })
}

fn document(found: Mapped, outcome: Outcome, asked: &Asked) -> MapResults {
    let (map, settings) = (&found.map, outcome.analysis.settings);
    let mut provenance = outcome.provenance;
    provenance.failed.extend(found.failed);
    let [columns, rows] = [0, 1].map(|i| map.grid.step.column(i).into_owned());
    let details = MapDetails {
        regime: Some(regime(map, None)),
        ..MapDetails::default()
    };
    MapResults {
        schema: "moiregauge/map/1".to_owned(),
        provenance,
        conventions: Conventions::of(&settings),
        errors: String::new(),
        method: asked.method.clone(),
        window_nm: map.window_nm,
        resolution_nm: 2.355 * map.window_nm,
        nodes: map.grid.size,
        origin_nm: map.grid.origin.into(),
        step_nm: [columns.into(), rows.into()],
        extent_nm: map.grid.extent(),
        masks: mask_counts(map),
        quantities: quantities(map),
        whole_image: found.whole,
        stripes: None,
        images: found.images,
        agreement: found.agreement.map(Into::into),
        drift_change: found.drift_change.map(Into::into),
        details: (&details).into(),
        caveats: found.caveats.iter().map(Into::into).collect(),
        settings,
    }
}

//! A map as a scan of many channels, for the writers of Zarr, Gwyddion and NumPy files.
//!
//! Surface units: degrees, per cent, nm. Values are there wherever a lattice was found; `mask` says which of
//! them are to be believed (0). `x` and `y` of each node are channels too, since a frame may be sheared and the
//! axes of a file are not.

use moiregauge::map::{Plane, RegistryMap, TwistStrainMap};
use nalgebra::Vector2;
use spmfile::{Channel, Samples, Scan, Span};

/// What a channel shows.
#[derive(Clone, Copy)]
pub(super) enum Shown<'a> {
    Values(&'a [f32], f64),
    Classes(&'a [u8]),
    Mask,
    Position(usize),
}

/// The map as a scan of all its quantities, the registry among them where there is one; its axes run along the rows and
/// columns of nodes.
pub fn map_scan(map: &TwistStrainMap, registry: Option<&RegistryMap>) -> Scan {
    scan_of(map, shown(map, registry))
}

/// Named quantities of a map as a scan.
pub(super) fn scan_of(map: &TwistStrainMap, all: Vec<(String, &'static str, Shown)>) -> Scan {
    let channels = all
        .into_iter()
        .map(|(name, unit, shown)| channel(map, &name, unit, shown));
    scan(map, channels.collect())
}

/// The same one quantity at a time, for maps of which memory holds no second copy.
pub fn map_scans<'a>(
    map: &'a TwistStrainMap,
    registry: Option<&'a RegistryMap>,
) -> impl Iterator<Item = Scan> + 'a {
    let all = shown(map, registry).into_iter();
    all.map(|(name, unit, shown)| scan(map, vec![channel(map, &name, unit, shown)]))
}

fn shown<'a>(
    map: &'a TwistStrainMap,
    registry: Option<&'a RegistryMap>,
) -> Vec<(String, &'static str, Shown<'a>)> {
    let mut all = Vec::new();
    let degree = 1f64.to_degrees();
    let [l1, l2, l3] = &map.wavelengths;
    let mut planes: Vec<(&str, &'static str, &Plane, f64)> = vec![
        ("twist", "°", &map.twist, degree),
        ("strain", "%", &map.magnitude, 100.0),
        ("strain axis", "°", &map.axis, degree),
        ("strain vector 1", "%", &map.strain[0], 100.0),
        ("strain vector 2", "%", &map.strain[1], 100.0),
        ("lattice angle", "°", &map.lattice_angle, degree),
        ("wavelength 1", "nm", l1, 1.0),
        ("wavelength 2", "nm", l2, 1.0),
        ("wavelength 3", "nm", l3, 1.0),
        ("orientation", "°", &map.orientation, degree),
        ("displacement x", "nm", &map.displacement[0], 1.0),
        ("displacement y", "nm", &map.displacement[1], 1.0),
    ];
    if let Some(found) = registry {
        planes.push(("registry x", "nm", &found.registry[0], 1.0));
        planes.push(("registry y", "nm", &found.registry[1], 1.0));
    }
    for (name, unit, plane, factor) in planes {
        all.push((name.to_owned(), unit, Shown::Values(&plane.value, factor)));
        all.push((
            format!("{name} sigma"),
            unit,
            Shown::Values(&plane.sigma, factor),
        ));
    }
    let [twist, e1, e2] = &map.of_bends;
    let plain: [(&str, &'static str, &[f32], f64); 7] = [
        (
            "strain vector covariance",
            "%²",
            &map.strain_covariance,
            1e4,
        ),
        ("closure chi2 per dof", "", &map.closure, 1.0),
        ("curl", "rad/nm²", &map.curl, 1.0),
        ("signal to noise", "", &map.signal_to_noise, 1.0),
        ("twist bend sigma", "°", twist, degree),
        ("strain vector 1 bend sigma", "%", e1, 100.0),
        ("strain vector 2 bend sigma", "%", e2, 100.0),
    ];
    for (name, unit, values, factor) in plain {
        all.push((name.to_owned(), unit, Shown::Values(values, factor)));
    }
    if let Some(found) = registry {
        let values = Shown::Values(&found.covariance, 1.0);
        all.push(("registry covariance".to_owned(), "nm²", values));
    }
    all.push(("mask".to_owned(), "", Shown::Mask));
    if !map.grain.is_empty() {
        all.push(("grain".to_owned(), "", Shown::Classes(&map.grain)));
    }
    all.push(("position x".to_owned(), "nm", Shown::Position(0)));
    all.push(("position y".to_owned(), "nm", Shown::Position(1)));
    all
}

fn pitch(map: &TwistStrainMap) -> [f64; 2] {
    [0, 1].map(|i| map.grid.step.column(i).norm())
}

fn channel(map: &TwistStrainMap, name: &str, unit: &str, shown: Shown) -> Channel {
    let [columns, rows] = map.grid.size;
    let [along, across] = pitch(map);
    let values = match shown {
        Shown::Values(values, factor) => values.iter().map(|v| factor * f64::from(*v)).collect(),
        Shown::Classes(values) => values.iter().map(|v| f64::from(*v)).collect(),
        Shown::Mask => map.mask.iter().map(|m| f64::from(*m as u8)).collect(),
        Shown::Position(axis) => (0..map.grid.len())
            .map(|n| map.grid.place(n)[axis])
            .collect(),
    };
    Channel {
        name: name.to_owned(),
        internal_name: String::new(),
        unit: unit.to_owned(),
        line_direction: None,
        scan_line: None,
        rows,
        columns,
        width_nm: Some(along * columns as f64),
        height_nm: Some(across * rows as f64),
        span: Span::PixelEdges,
        scale: 1.0,
        offset: 0.0,
        scaling: "computed".to_owned(),
        plane_fit: None,
        samples: Samples::F64(values),
    }
}

fn scan(map: &TwistStrainMap, channels: Vec<Channel>) -> Scan {
    let [columns, rows] = map.grid.size.map(|n| n as f64);
    let step = map.grid.step;
    let centre = map.grid.origin + step * Vector2::new(columns - 1.0, rows - 1.0) / 2.0;
    let [along, across] = pitch(map);
    Scan {
        format: "moiregauge map".to_owned(),
        rotation_rad: step[(1, 0)].atan2(step[(0, 0)]),
        offset_nm: centre.into(),
        size_nm: Some([along * columns, across * rows]),
        channels,
        ..Scan::default()
    }
}

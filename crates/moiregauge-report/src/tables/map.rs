//! A map as a scan of many channels, for the writers of Zarr, Gwyddion and NumPy files.
//!
//! Surface units: degrees, per cent, nm. Values are there wherever a lattice was found; `mask` says which of
//! them are to be believed (0). `x` and `y` of each node are channels too, since a frame may be sheared and the
//! axes of a file are not.

use moiregauge::map::{Plane, TwistStrainMap};
use spmfile::{Channel, Samples, Scan, Span};

/// The map as a scan; its axes run along the rows and columns of nodes.
pub fn map_scan(map: &TwistStrainMap) -> Scan {
    let step = map.grid.step;
    let pitch = [step.column(0).norm(), step.column(1).norm()];
    let [columns, rows] = map.grid.size;
    let channel = |name: &str, unit: &str, values: Vec<f64>| Channel {
        name: name.to_owned(),
        internal_name: String::new(),
        unit: unit.to_owned(),
        line_direction: None,
        scan_line: None,
        rows,
        columns,
        width_nm: Some(pitch[0] * columns as f64),
        height_nm: Some(pitch[1] * rows as f64),
        span: Span::PixelEdges,
        scale: 1.0,
        offset: 0.0,
        scaling: "computed".to_owned(),
        plane_fit: None,
        samples: Samples::F64(values),
    };
    let mut channels = Vec::new();
    let mut plane = |name: &str, unit: &str, plane: &Plane, factor: f64| {
        let scaled = |values: &[f32]| values.iter().map(|v| factor * f64::from(*v)).collect();
        channels.push(channel(name, unit, scaled(&plane.value)));
        channels.push(channel(
            &format!("{name} sigma"),
            unit,
            scaled(&plane.sigma),
        ));
    };
    let degree = 1f64.to_degrees();
    plane("twist", "°", &map.twist, degree);
    plane("strain", "%", &map.magnitude, 100.0);
    plane("strain axis", "°", &map.axis, degree);
    plane("strain vector 1", "%", &map.strain[0], 100.0);
    plane("strain vector 2", "%", &map.strain[1], 100.0);
    plane("lattice angle", "°", &map.lattice_angle, degree);
    for (i, wavelength) in map.wavelengths.iter().enumerate() {
        plane(&format!("wavelength {}", i + 1), "nm", wavelength, 1.0);
    }
    plane("orientation", "°", &map.orientation, degree);
    for (axis, displacement) in ["x", "y"].iter().zip(&map.displacement) {
        plane(&format!("displacement {axis}"), "nm", displacement, 1.0);
    }
    let single = |values: &[f32]| values.iter().map(|v| f64::from(*v)).collect::<Vec<f64>>();
    let covariance = map.strain_covariance.iter().map(|v| 1e4 * f64::from(*v));
    channels.push(channel(
        "strain vector covariance",
        "%²",
        covariance.collect(),
    ));
    channels.push(channel("closure chi2 per dof", "", single(&map.closure)));
    channels.push(channel("curl", "rad/nm²", single(&map.curl)));
    channels.push(channel("signal to noise", "", single(&map.signal_to_noise)));
    let mask = map.mask.iter().map(|m| f64::from(*m as u8));
    channels.push(channel("mask", "", mask.collect()));
    for (axis, name) in ["position x", "position y"].into_iter().enumerate() {
        let places = (0..map.grid.len()).map(|node| map.grid.place(node)[axis]);
        channels.push(channel(name, "nm", places.collect()));
    }
    let half = nalgebra::Vector2::new(columns as f64 - 1.0, rows as f64 - 1.0) / 2.0;
    let centre = map.grid.origin + step * half;
    Scan {
        format: "moiregauge map".to_owned(),
        rotation_rad: step[(1, 0)].atan2(step[(0, 0)]),
        offset_nm: centre.into(),
        size_nm: Some([pitch[0] * columns as f64, pitch[1] * rows as f64]),
        channels,
        ..Scan::default()
    }
}

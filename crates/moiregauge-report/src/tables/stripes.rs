//! A map of stripes as a scan of many channels: only what stripes have.

use moiregauge::stripes::SampledStripes;
use spmfile::Scan;

use super::map::{Shown, scan_of};

/// The map of stripes as a scan of its quantities, as [`map_scan`](super::map_scan).
pub fn stripe_scan(stripes: &SampledStripes) -> Scan {
    let map = &stripes.map;
    let degree = 1f64.to_degrees();
    let [x, y] = &map.displacement;
    let mut all = Vec::new();
    for (name, unit, plane, factor) in [
        ("wavelength", "nm", &map.wavelengths[0], 1.0),
        ("direction", "°", &map.orientation, degree),
        ("displacement x", "nm", x, 1.0),
        ("displacement y", "nm", y, 1.0),
    ] {
        all.push((name.to_owned(), unit, Shown::Values(&plane.value, factor)));
        let sigma = Shown::Values(&plane.sigma, factor);
        all.push((format!("{name} sigma"), unit, sigma));
    }
    let plain = |name: &str| name.to_owned();
    all.extend([
        (
            plain("closure chi2 per dof"),
            "",
            Shown::Values(&map.closure, 1.0),
        ),
        (
            plain("signal to noise"),
            "",
            Shown::Values(&map.signal_to_noise, 1.0),
        ),
        (plain("stripes"), "", Shown::Classes(&stripes.pattern)),
        (plain("mask"), "", Shown::Mask),
        (plain("position x"), "nm", Shown::Position(0)),
        (plain("position y"), "nm", Shown::Position(1)),
    ]);
    scan_of(map, all)
}

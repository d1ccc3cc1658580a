//! Simulated scans without noise.

use moiregauge::simulate::Simulation;

/// Cosines, and nothing that disturbs them.
pub(crate) fn noiseless(set: &mut Simulation) {
    set.sample.sharpness = 0.0;
    set.noise.sensor_nm = 0.0;
    set.noise.pixel_deg = 0.0;
    set.noise.line_deg = 0.0;
    set.noise.flicker_deg = 0.0;
    set.noise.plane_deg = [0.0; 2];
}

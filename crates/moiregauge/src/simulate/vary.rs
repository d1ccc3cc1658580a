//! Random samples: what nobody has chosen, drawn by a seed.

use rand::RngExt as _;

use crate::numbers::rng;
use crate::simulate::feature::rounded;
use crate::simulate::scene::Scene;
use crate::simulate::settings::Simulation;

/// Ranges of what is drawn: everyday samples and noise.
const TWIST_DEG: [f64; 2] = [1.0, 1.6];
const STRAIN_PERCENT: [f64; 2] = [0.05, 0.3];
const DRIFT_NM_PER_MIN: [f64; 2] = [-1.0, 1.0];
/// Of the pixels, of the contrast.
const NOISE_DEG: [f64; 2] = [0.15, 0.5];
/// Side of the frame in moiré wavelengths.
const PERIODS: [f64; 2] = [7.0, 12.0];
/// Atoms of graphene ask for a fine raster: large twists, small frames.
const ATOMS_TWIST_DEG: [f64; 2] = [4.0, 6.0];
/// nm per pixel: 2.4 pixels between two rows of atoms.
const ATOMS_PIXEL_NM: f64 = 0.088;

/// Draws twist, strain, orientations, drift, noise, the size of the frame and all numbers of the sample that are not given.
///
/// The same seed draws the same, whatever is given. The seed of the set and that of the sample become this one.
pub fn vary(set: &mut Simulation, seed: u64) {
    set.seed = seed;
    set.sample.seed = seed;
    let mut rng = rng::stream(seed, "simulate vary", 0);
    let mut between = |[low, high]: [f64; 2]| rounded(low + (high - low) * rng.random::<f64>());
    let twist = between(TWIST_DEG);
    let large = between(ATOMS_TWIST_DEG);
    let atoms = set.features.iter().any(|f| f.class == "atoms");
    set.sample.twist_deg = if atoms { large } else { twist };
    set.sample.strain_percent = between(STRAIN_PERCENT);
    set.sample.strain_axis_deg = between([0.0, 180.0]);
    set.sample.lattice_angle_deg = between([0.0, 60.0]);
    set.sample.origin_nm = [between([-6.0, 6.0]), between([-6.0, 6.0])];
    set.drift.velocity_nm_per_min = [between(DRIFT_NM_PER_MIN), between(DRIFT_NM_PER_MIN)];
    set.noise.pixel_deg = between(NOISE_DEG);
    let periods = between(PERIODS);
    set.raster.rotation_deg = if between([0.0, 1.0]) < 0.5 { 0.0 } else { 90.0 };
    let wavelength = Scene::new(&set.sample).map_or(1.0, |scene| scene.basis.column(0).norm());
    let side = if atoms {
        ATOMS_PIXEL_NM * (set.raster.pixels[0] - 1) as f64
    } else {
        periods * wavelength
    };
    set.raster.nominal_size_nm = set.window.gain.map(|gain| rounded(side / gain));
    if set.raster.rotation_deg == 90.0 {
        set.raster.nominal_size_nm.reverse();
    }
    for (feature, index) in set.features.iter_mut().zip(1..) {
        feature.vary(&mut rng::stream(seed, "simulate vary", index));
    }
}

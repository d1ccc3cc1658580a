//! Maps by tiles: the lattice fit of whole images on overlapping tiles. Slower and coarser than demodulation,
//! and another way to the same numbers.

use heterostrain::lattice::labelled_like;
use nalgebra::{Matrix2, Vector2};
use rayon::prelude::*;

use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::lattice::find::measure;
use crate::map::nodes::{Grid, LatticeNode};
use crate::map::sample::LatticeMap;
use crate::numbers::interrupt;
use crate::settings::knobs::Settings;
use crate::spectrum::method::Method;
use crate::window::mask::Mask;
use crate::window::types::{Reference, Resolution};

/// Default side of a tile, periods. Chosen by eye.
const SIDE: f64 = 6.0;
/// Tiles along a side that overlap: nearer nodes tell the same.
const OVERLAP: f64 = 4.0;
/// A lattice that differs by more than this share from that of the whole image is another one. Chosen by eye.
const OTHER: f64 = 0.2;

/// The lattice of every tile. `still` is the geometry without drift, `geometry` the one that was measured; the window of
/// `resolution` is the side of a tile.
///
/// The slopes of a phase in a tile of side T count like `T²/4 − x²`, whose standard deviation `T/√20` stands
/// for the width of the window.
pub(crate) fn tile_map(
    image: &Image,
    geometry: &Geometry,
    still: &Geometry,
    reference: &Reference,
    resolution: &Resolution,
    settings: &Settings,
) -> Option<LatticeMap> {
    let side_nm = resolution.window_nm.unwrap_or(SIDE * reference.period());
    let step_nm = resolution.step_nm.unwrap_or(side_nm / OVERLAP);
    let pixels = |nm: f64| reference.pitch.map(|p| ((nm / p).round() as usize).max(1));
    let (side, step) = (pixels(side_nm), pixels(step_nm));
    let whole = [image.columns, image.rows];
    if side[0] > whole[0] || side[1] > whole[1] {
        return None;
    }
    let size = [0, 1].map(|i| (whole[i] - side[i]) / step[i] + 1);
    // In the middle of the frame.
    let first = [0, 1].map(|i| (whole[i] - side[i] - (size[i] - 1) * step[i]) / 2);
    let dual = still.pixel_to_nm.try_inverse()?.transpose();
    let nodes = (0..size[0] * size[1])
        .into_par_iter()
        .map(|n| {
            interrupt::check();
            let at = [n % size[0], n / size[0]];
            let corner = [0, 1].map(|i| first[i] + at[i] * step[i]);
            let tile = image.cropped(corner, side);
            let geometry = geometry.cropped(corner, side);
            node(&tile, &geometry, &dual, reference, settings)
        })
        .collect();
    let middle = [0, 1].map(|i| first[i] as f64 + 0.5 * (side[i] as f64 - 1.0));
    let steps = Matrix2::new(step[0] as f64, 0.0, 0.0, step[1] as f64);
    Some(LatticeMap {
        grid: Grid {
            size,
            origin: still.origin + still.pixel_to_nm * Vector2::from(middle),
            step: still.pixel_to_nm * steps,
        },
        window_nm: side_nm / 20f64.sqrt(),
        // Tiles follow no phases.
        gauge: None,
        bends: still.bends(),
        nodes,
    })
}

fn node(
    tile: &Image,
    geometry: &Geometry,
    dual: &Matrix2<f64>,
    reference: &Reference,
    settings: &Settings,
) -> LatticeNode {
    let nothing = LatticeNode::nothing(Mask::Weak);
    let Ok(found) = measure(tile, geometry, settings.background, Method::Lattice) else {
        return nothing;
    };
    let Some(waves) = found.pixels.waves() else {
        return nothing;
    };
    let waves = labelled_like(&waves, &reference.pair);
    let apart = (waves.basis - reference.pair).norm();
    if apart > OTHER * reference.pair.norm() {
        return nothing;
    }
    LatticeNode {
        mask: Mask::Good,
        waves: waves.in_nm(dual),
        signal_to_noise: found.signal_to_noise.powi(2),
        ..nothing
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::local::local_lattices;
    use crate::simulate::field::FieldScene;
    use heterostrain::lattice::reciprocal;

    /// Tiles and demodulation agree within their errors on an image of one lattice, and so do both with the truth.
    #[test]
    fn tiles_agree_with_demodulation() {
        let mut scene = FieldScene::hexagonal([360, 300], 15.0, 0.4);
        scene.white = 1.0;
        let image = scene.image();
        let geometry = Geometry::of_pitch([360, 300], [1.0; 2], 0.0, Vector2::zeros()).unwrap();
        let reference = Reference {
            pair: scene.pair,
            pitch: [1.0; 2],
        };
        let settings = Settings::default();
        let sides = Resolution {
            window_nm: Some(90.0),
            step_nm: Some(45.0),
            ..Resolution::default()
        };
        let tiles = tile_map(&image, &geometry, &geometry, &reference, &sides, &settings).unwrap();
        let window = Resolution {
            window_nm: Some(tiles.window_nm),
            ..Resolution::default()
        };
        let waves = local_lattices(&image, &reference, &window).unwrap();
        let demodulated = LatticeMap::new(&waves, &geometry).unwrap();
        let mean = |map: &LatticeMap| map.mean().unwrap();
        assert!((mean(&tiles) - mean(&demodulated)).norm() < 2e-3 * scene.pair.norm());
        for map in [&tiles, &demodulated] {
            let good = map.nodes.iter().filter(|n| n.mask == Mask::Good);
            let pulls: Vec<f64> = good
                .map(|n| (n.waves.basis - scene.pair).m11 / n.waves.covariance[(0, 0)].sqrt())
                .collect();
            let rms = (pulls.iter().map(|p| p * p).sum::<f64>() / pulls.len() as f64).sqrt();
            assert!(
                pulls.len() > 20 && (0.7..1.3).contains(&rms),
                "{} {rms}",
                pulls.len()
            );
        }
        assert!(reciprocal(&scene.pair).is_some());
    }
}

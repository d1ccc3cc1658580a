//! Displacement, undistorted image and averaged cell against lattices whose phases are known at every point.

use std::f64::consts::TAU;

use nalgebra::{Matrix2, Matrix4, Vector2};

use crate::frame::background::Background;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::lattice::measure;
use crate::map::cell::mean_cell;
use crate::map::combine::combine;
use crate::map::followed::Followed;
use crate::map::sample::LatticeMap;
use crate::map::tests::{map_of, map_of_image, rms};
use crate::map::undistorted::{Undistorted, undistorted};
use crate::simulate::field::FieldScene;
use crate::spectrum::method::Method;
use crate::window::mask::Mask;

/// Pixels of 1 nm, a sheared frame would do as well.
fn geometry(size: [usize; 2]) -> Geometry {
    Geometry {
        size,
        pixel_to_nm: Matrix2::identity(),
        origin: Vector2::zeros(),
        covariance: Matrix4::zeros(),
        from_sensors: false,
        departure: None,
    }
}

fn lattices(scene: &FieldScene, window: Option<f64>) -> LatticeMap {
    LatticeMap::new(&map_of(scene, window), &geometry(scene.size)).unwrap()
}

/// A lattice of 24 periods whose wave vectors change by ± `share` across the frame.
fn bent(share: f64, white: f64, seed: u64) -> FieldScene {
    let mut scene = FieldScene::rippled(512, 24.0, share);
    scene.harmonics.push(([1, 1], 0.3));
    scene.harmonics.push(([2, -1], 0.2));
    scene.harmonics.push(([-1, 2], 0.25));
    (scene.white, scene.seed) = (white, seed);
    scene
}

/// Phases by displacement, mean lattice and node are those of the pattern, to the errors that are stated: χ² of two phases
/// at each node, absolutely, without a constant of its own.
#[test]
fn displacements_have_the_errors_that_are_stated() {
    for (share, white) in [(0.0, 0.8), (0.05, 0.8), (0.1, 1.5)] {
        let (mut chi2, mut nodes) = (0.0, 0);
        for seed in 0..6 {
            let scene = bent(share, white, 40 + seed);
            let (sum, count) = misses(&scene, &lattices(&scene, None));
            (chi2, nodes) = (chi2 + sum, nodes + count);
        }
        let per_number = chi2 / (2.0 * f64::from(nodes));
        println!("share {share}, noise {white}: χ² per number {per_number:.3}, {nodes} nodes");
        assert!((0.8..1.25).contains(&per_number), "{share}: {per_number}");
    }
}

/// χ² of the phases against those of the scene, and the number of nodes.
fn misses(scene: &FieldScene, map: &LatticeMap) -> (f64, u32) {
    let gauge = map.gauge.unwrap();
    assert!(gauge.bright);
    let (mut chi2, mut nodes) = (0.0, 0);
    for (n, node) in map.nodes.iter().enumerate() {
        if node.mask != Mask::Good || !node.displacement.x.is_finite() {
            continue;
        }
        let at = map.grid.place(n);
        let phases = gauge.waves.tr_mul(&(at - node.displacement - gauge.node));
        let miss = (phases - scene.phases(at)).map(|p| p - TAU * (p / TAU).round());
        let covariance = gauge.waves.transpose() * node.displacement_covariance * gauge.waves;
        chi2 += (miss.transpose() * covariance.try_inverse().unwrap() * miss)[0];
        nodes += 1;
    }
    (chi2, nodes)
}

/// Frames of other parts of a pattern are averaged against one mean lattice: displacements are right in what they share and beyond
/// it, without a step where one frame ends. A frame that shares nothing has none.
#[test]
fn frames_have_their_displacements_in_one_gauge() {
    let mut maps = Vec::new();
    for (seed, corner) in [(1, [0, 0]), (2, [120, 60]), (3, [60, 150])] {
        let scene = bent(0.05, 0.8, seed);
        let cut = scene.image().cropped(corner, [352, 352]);
        let place = Geometry {
            origin: Vector2::from(corner.map(|c| c as f64)),
            ..geometry([352, 352])
        };
        maps.push(LatticeMap::new(&map_of_image(&cut, &scene.pair, None), &place).unwrap());
    }
    let scene = bent(0.05, 0.8, 1);
    let (together, _) = combine(&maps.iter().collect::<Vec<_>>()).unwrap();
    let (chi2, nodes) = misses(&scene, &together);
    let per_number = chi2 / (2.0 * f64::from(nodes));
    let alone = misses(&scene, &maps[0]).1;
    println!("together: χ² per number {per_number:.3}, {nodes} nodes, {alone} of the first");
    assert!((0.8..1.3).contains(&per_number), "{per_number}");
    let good = together.nodes.iter().filter(|n| n.mask == Mask::Good);
    let (mut known, mut all) = (0, 0);
    for node in good {
        all += 1;
        known += usize::from(node.displacement.x.is_finite());
    }
    assert!(known * 10 > all * 9, "{known} of {all}");
    // Neighbours differ by what the lattice changes, not by a period.
    let columns = together.grid.size[0];
    for (n, pair) in together.nodes.windows(2).enumerate() {
        let step = pair[1].displacement - pair[0].displacement;
        assert!((n + 1) % columns == 0 || !(step.norm() > 2.0), "{step}");
    }
    let mut far = maps[1].clone();
    far.move_by(Vector2::new(2000.0, 0.0));
    let (side_by_side, _) = combine(&[&maps[0], &far]).unwrap();
    let beyond = |n: &usize| side_by_side.grid.place(*n).x > 1000.0;
    let mut there = (0..side_by_side.nodes.len()).filter(beyond);
    assert!(there.all(|n| side_by_side.nodes[n].displacement.x.is_nan()));
}

/// The largest square in the middle of an image without missing pixels.
fn middle(shown: &Undistorted) -> Image {
    let image = &shown.image;
    let (c, r) = (image.columns / 2, image.rows / 2);
    let whole = |half: usize| {
        let cut = image.cropped([c - half, r - half], [2 * half, 2 * half]);
        cut.values.iter().all(|v| v.is_finite()).then_some(cut)
    };
    (1..c.min(r)).rev().find_map(whole).unwrap()
}

/// An undistorted image shows the mean lattice, and that everywhere: a fit finds its wave vectors and no change across the
/// frame, where it found the image itself bent.
#[test]
fn undistorted_images_show_the_mean_lattice_everywhere() {
    let mut pulls = Vec::new();
    for seed in 0..4 {
        let scene = bent(0.05, 0.6, 60 + seed);
        let map = lattices(&scene, None);
        let followed = Followed::new(&map).unwrap();
        let shown = undistorted(&scene.image(), &geometry(scene.size), &followed).unwrap();
        assert!((0.5..1.0).contains(&shown.known), "{}", shown.known);
        let cut = middle(&shown);
        assert!(cut.columns > 300, "{}", cut.columns);
        let pitch = shown.pitch;
        let square = geometry([cut.columns, cut.rows]);
        let found = measure(&cut, &square, Background::Plane, Method::Lattice).unwrap();
        let fit = found.fit.unwrap();
        let change = fit.inhomogeneity.unwrap();
        assert!(change.chi_squared < change.threshold, "{change:?}");
        // Names may differ: each measured wave against the integer combination next to it.
        let mean = map.gauge.unwrap().waves * pitch;
        let names = (mean.try_inverse().unwrap() * fit.wave_vectors.basis).map(f64::round);
        let error = fit.wave_vectors.basis - mean * names;
        for i in 0..4 {
            pulls.push(error[i] / fit.wave_vectors.covariance[(i, i)].sqrt());
        }
        // The map of it: no spread of local wave vectors beyond noise.
        let again = map_of_image(&cut, &(mean * names), Some(map.window_nm / pitch));
        let local = crate::map::tests::good(&again)
            .map(|(node, _)| (node.pair - mean * names)[0] / node.covariance[(0, 0)].sqrt());
        let before = crate::map::tests::good(&map_of(&scene, Some(map.window_nm)))
            .map(|(node, _)| (node.pair - mean)[0] / node.covariance[(0, 0)].sqrt())
            .collect::<Vec<_>>();
        let local: Vec<f64> = local.collect();
        println!(
            "local {} of {}, before {}",
            rms(&local),
            local.len(),
            rms(&before)
        );
        assert!(rms(&local) < 1.0 && rms(&before) > 3.0);
    }
    println!("pulls {pulls:?}");
    assert!(rms(&pulls) < 1.3, "{pulls:?}");
}

/// Mean of `cos(2π(h x + k y) )` over a bin.
fn over_bin([h, k]: [i32; 2], share: Vector2<f64>, bins: usize) -> f64 {
    let sinc = |n: i32| {
        let x = std::f64::consts::PI * f64::from(n) / bins as f64;
        if n == 0 { 1.0 } else { x.sin() / x }
    };
    (TAU * (f64::from(h) * share.x + f64::from(k) * share.y)).cos() * sinc(h) * sinc(k)
}

/// The averaged cell is the cell of the pattern, within its errors, where the lattice bends; by one lattice for all it is not.
#[test]
fn averaged_cells_are_those_of_the_pattern() {
    let (mut chi2, mut bins, mut smeared) = (0.0, 0.0, 0.0);
    for seed in 0..4 {
        let scene = bent(0.05, 0.8, 80 + seed);
        let map = lattices(&scene, None);
        let followed = Followed::new(&map).unwrap();
        let cell = mean_cell(&scene.image(), &geometry(scene.size), &followed).unwrap();
        // In shares of the vectors of the cell the waves of the scene are whole numbers.
        let names = (scene.pair.tr_mul(&cell.vectors) / TAU).map(f64::round);
        let truth = |share: Vector2<f64>| -> f64 {
            let of = |&([h, k], amplitude): &([i32; 2], f64)| {
                let index = names.tr_mul(&Vector2::new(f64::from(h), f64::from(k)));
                amplitude * over_bin([index.x as i32, index.y as i32], share, cell.bins)
            };
            scene.harmonics.iter().map(of).sum()
        };
        for bin in 0..cell.mean.len() {
            let miss = cell.mean[bin] - truth(cell.share(bin));
            chi2 += (miss / cell.sigma[bin]).powi(2);
            bins += 1.0;
        }
        // The same without displacements.
        let mut rigid = map.clone();
        rigid.nodes.iter_mut().for_each(|n| n.displacement *= 0.0);
        let rigid = Followed::new(&rigid).unwrap();
        let flat = mean_cell(&scene.image(), &geometry(scene.size), &rigid).unwrap();
        let contrast = |c: &crate::map::cell::MeanCell| rms(&c.mean);
        smeared += contrast(&flat) / contrast(&cell) / 4.0;
        let pixels: u32 = cell.pixels.iter().sum();
        assert!(cell.all_cells > 250 && pixels > 100_000, "{pixels}");
    }
    println!(
        "χ² {:.3} per bin, contrast of one lattice for all {smeared:.3}",
        chi2 / bins
    );
    assert!((0.9..1.15).contains(&(chi2 / bins)), "{}", chi2 / bins);
    assert!(smeared < 0.85, "{smeared}");
}

use heterostrain::lattice::Lattice;
use heterostrain::material::Material;
use heterostrain::strain::{StrainConvention, moire_lattice, twist_strain};
use nalgebra::{Matrix2, Matrix4, Vector2};

use super::*;
use crate::frame::geometry::Geometry;
use crate::region::tests::made;
use crate::simulate::domains::DomainScene;
use crate::window::mask::Mask;

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

/// Triangular domains with a cell that changes by a third across the frame.
fn scene(seed: u64) -> DomainScene {
    let mut scene = DomainScene::hexagonal([420, 380], 44.0, 0.2);
    scene.ripples = vec![
        (Vector2::new(0.008, 0.003), 0.4, Vector2::new(9.0, 4.0)),
        (Vector2::new(-0.004, 0.009), 1.3, Vector2::new(-3.0, 8.0)),
    ];
    scene.white = 0.35;
    scene.seed = seed;
    scene
}

fn found(scene: &DomainScene) -> FoundNodes {
    find_nodes(&scene.image(), &scene.lattice, [1.0; 2], Contrast::Auto).unwrap()
}

fn mesh_of(scene: &DomainScene, found: &FoundNodes) -> Mesh {
    let places: Vec<Vector2<f64>> = found.nodes.iter().map(|n| n.place).collect();
    Mesh::new(&places, &scene.lattice)
}

/// Each found node with the true one nearest to it.
fn matched(scene: &DomainScene, found: &FoundNodes) -> Vec<(FoundNode, Vector2<f64>)> {
    let truth = scene.nodes();
    let nearest = |at: Vector2<f64>| {
        let near = truth.iter().map(|t| t.1);
        near.min_by(|a, b| (a - at).norm().total_cmp(&(b - at).norm()))
    };
    found
        .nodes
        .iter()
        .filter_map(|n| Some((*n, nearest(n.place)?)))
        .collect()
}

/// Places over their errors, the offset that all share taken off.
fn pulls(pairs: &[(FoundNode, Vector2<f64>)]) -> Vec<f64> {
    let offset: Vector2<f64> =
        pairs.iter().map(|(n, t)| n.place - t).sum::<Vector2<f64>>() / pairs.len() as f64;
    pairs
        .iter()
        .flat_map(|(n, t)| {
            let error = n.place - t - offset;
            [0, 1].map(|i| error[i] / n.covariance[(i, i)].sqrt())
        })
        .collect()
}

/// Over seeds, places scatter about the true ones by their errors, bright or dark, in white noise and with
/// offsets of lines; all nodes well within the frame are found and no others.
#[test]
fn places_have_honest_errors() {
    for (line, sign) in [(0.0, 1.0), (0.5, 1.0), (0.0, -1.0)] {
        let (mut all, mut within) = (Vec::new(), 0);
        for seed in 0..6 {
            let mut scene = scene(seed);
            scene.line = line;
            let mut image = scene.image();
            for value in &mut image.values {
                *value *= sign;
            }
            let found = find_nodes(&image, &scene.lattice, [1.0; 2], Contrast::Auto).unwrap();
            let contrast = if sign > 0.0 {
                Contrast::Bright
            } else {
                Contrast::Dark
            };
            assert_eq!(found.contrast, contrast);
            assert!(found.contrast_is_clear);
            assert_eq!(found.line_offsets, line > 0.0);
            let pairs = matched(&scene, &found);
            for (node, truth) in &pairs {
                assert!((node.place - truth).norm() < 4.0, "{} {truth}", node.place);
            }
            let inner = scene
                .nodes()
                .into_iter()
                .filter(|(_, p)| p.x > 16.0 && p.x < 403.0 && p.y > 16.0 && p.y < 363.0);
            for (_, place) in inner {
                assert!(pairs.iter().any(|(_, t)| *t == place), "{place}");
            }
            let pulls = pulls(&pairs);
            within += pulls.iter().filter(|p| p.abs() < 1.0).count();
            all.extend(pulls);
        }
        let share = within as f64 / all.len() as f64;
        let size = rms(&all);
        assert!(
            (0.85..1.2).contains(&size),
            "line {line}, sign {sign}: {size}, {share}"
        );
        assert!(
            (0.62..0.75).contains(&share),
            "line {line}, sign {sign}: {share}"
        );
    }
}

/// The mesh of a distorted lattice is whole: every inner node has six neighbours, indices are those of the
/// simulation up to a choice of names.
#[test]
fn the_mesh_knows_every_index() {
    let scene = scene(3);
    let found = found(&scene);
    let mesh = mesh_of(&scene, &found);
    assert!(mesh.missing.is_empty() && mesh.extra.is_empty() && mesh.dislocations.is_empty());
    let truth = scene.nodes();
    let mut offset = None;
    for (node, index) in found.nodes.iter().zip(&mesh.indices) {
        let Some(index) = index else { continue };
        let near = |t: &&([i32; 2], Vector2<f64>)| (t.1 - node.place).norm() < 4.0;
        let (own, _) = truth.iter().find(near).unwrap();
        let apart = [own[0] - index[0], own[1] - index[1]];
        assert_eq!(*offset.get_or_insert(apart), apart);
    }
    // Euler: a disc of V nodes and B of them on its rim has 2V − B − 2 triangles.
    let used = mesh.indices.iter().flatten().count();
    assert!(
        mesh.triangles.len() > used,
        "{} {used}",
        mesh.triangles.len()
    );
}

/// Removed nodes are told, at their places, and nothing else is.
#[test]
fn missing_nodes_are_flagged() {
    let mut scene = scene(5);
    let whole = scene.nodes();
    scene.missing = vec![[1, -1], [-2, 1], [-2, 2]];
    let found = found(&scene);
    let mesh = mesh_of(&scene, &found);
    assert_eq!(mesh.missing.len(), 3);
    assert!(mesh.dislocations.is_empty());
    for index in &scene.missing {
        let place = whole.iter().find(|n| n.0 == *index).unwrap().1;
        let near = |p: &&Vector2<f64>| (*p - place).norm() < 5.0;
        assert!(
            mesh.missing.iter().any(|p| near(&p)),
            "{place}: {:?}",
            mesh.missing
        );
    }
}

/// A dislocation has its Burgers vector and its place.
#[test]
fn dislocations_have_burgers_vectors() {
    let mut scene = scene(2);
    scene.ripples.clear();
    let core = Vector2::new(205.0, 190.0);
    scene.dislocation = Some(core);
    let found = found(&scene);
    let mesh = mesh_of(&scene, &found);
    assert_eq!(mesh.dislocations.len(), 1, "{:?}", mesh.dislocations);
    let dislocation = mesh.dislocations[0];
    assert!((dislocation.place - core).norm() < 60.0);
    assert_eq!(dislocation.burgers.map(i32::abs), [1, 0]);
    assert!(mesh.missing.is_empty());
}

/// A speck between nodes is no node of the lattice: the mesh has a hole there and says so.
#[test]
fn a_speck_is_extra() {
    let scene = scene(4);
    let mut places: Vec<Vector2<f64>> = scene.nodes().into_iter().map(|n| n.1).collect();
    let [a, b, c] =
        [[0, 0], [1, 0], [0, 1]].map(|i| scene.nodes().into_iter().find(|n| n.0 == i).unwrap().1);
    places.push((a + b + c) / 3.0);
    let mesh = Mesh::new(&places, &scene.lattice);
    assert_eq!(mesh.extra, [places.len() - 1]);
    assert!(mesh.dislocations.is_empty() && mesh.missing.is_empty());
}

/// Twist and strain of every triangle, through a sheared geometry, against those of the true nodes.
#[test]
fn triangles_have_the_twist_of_their_nodes() {
    let geometry = Geometry {
        size: [420, 380],
        pixel_to_nm: Matrix2::new(1.7, -0.2, 0.15, 1.8),
        origin: Vector2::new(3.0, -8.0),
        covariance: Matrix4::zeros(),
        from_sensors: true,
        departure: None,
    };
    let (material, convention) = (Material::graphene(), StrainConvention::RealSpace);
    let (mut twists, mut strains, mut cells) = (Vec::new(), Vec::new(), 0);
    for seed in 10..14 {
        let scene = scene(seed);
        let found = found(&scene);
        let mesh = mesh_of(&scene, &found);
        let map = DomainMap::new(&found, &mesh, &geometry, &material, convention)
            .unwrap()
            .unwrap();
        let truth: Vec<Vector2<f64>> = matched(&scene, &found)
            .iter()
            .map(|(_, t)| geometry.origin + geometry.pixel_to_nm * t)
            .collect();
        for cell in &map.cells {
            let found = cell.twist_strain.unwrap();
            // Two true edges are lattice vectors; the general solution finds the names by itself.
            let [a, b, c] = cell.nodes.map(|n| truth[n]);
            let exact = Lattice::new(Matrix2::from_columns(&[b - a, c - a]), Matrix4::identity());
            let exact = twist_strain(&exact, &material, convention).unwrap();
            twists.push((found.twist - exact.twist) / found.twist().sigma);
            for i in 0..2 {
                let sigma = found.strain().covariance[(i, i)].sqrt();
                strains.push((found.strain_vector[i] - exact.strain_vector[i]) / sigma);
            }
            cells += 1;
            assert!(found.twist.to_degrees() < 0.4);
        }
    }
    assert!(cells > 300, "{cells}");
    assert!((0.85..1.2).contains(&rms(&twists)), "{}", rms(&twists));
    assert!((0.85..1.2).contains(&rms(&strains)), "{}", rms(&strains));
}

/// Layers of known twist and strain: their moiré by the strain equation, drawn with nodes and walls, gives both back
/// in every triangle within its errors, and in the mean of all of them.
#[test]
fn triangles_of_known_layers_have_their_twist_and_strain() {
    let (material, convention) = (Material::graphene(), StrainConvention::RealSpace);
    let (twist, strain, axis, angle) = (0.25f64.to_radians(), 8e-4, 0.5, 0.2);
    let basis = moire_lattice(twist, strain, axis, angle, &material, convention).unwrap();
    let pitch = 1.4;
    let geometry = Geometry {
        size: [400, 380],
        pixel_to_nm: Matrix2::identity() * pitch,
        origin: Vector2::zeros(),
        covariance: Matrix4::zeros(),
        from_sensors: false,
        departure: None,
    };
    let lab = 2.0 * (axis + angle + twist);
    let truth = strain * Vector2::new(lab.cos(), lab.sin());
    let (mut twists, mut strains, mut mean) = (Vec::new(), Vec::new(), 0.0);
    for seed in 0..4 {
        let mut scene = DomainScene::hexagonal([400, 380], 40.0, 0.0);
        scene.lattice = basis / pitch;
        (scene.white, scene.seed) = (0.3, seed);
        let found = find_nodes(&scene.image(), &scene.lattice, [pitch; 2], Contrast::Auto).unwrap();
        let mesh = mesh_of(&scene, &found);
        let map = DomainMap::new(&found, &mesh, &geometry, &material, convention)
            .unwrap()
            .unwrap();
        for cell in &map.cells {
            let found = cell.twist_strain.unwrap();
            twists.push((found.twist - twist) / found.twist().sigma);
            mean += found.twist / twist - 1.0;
            for i in 0..2 {
                let sigma = found.strain().covariance[(i, i)].sqrt();
                strains.push((found.strain_vector[i] - truth[i]) / sigma);
            }
        }
    }
    assert!(twists.len() > 200, "{}", twists.len());
    assert!((mean / twists.len() as f64).abs() < 2e-3);
    assert!((0.85..1.2).contains(&rms(&twists)), "{}", rms(&twists));
    assert!((0.85..1.2).contains(&rms(&strains)), "{}", rms(&strains));
}

/// Noise alone has no mesh.
#[test]
fn noise_has_no_nodes() {
    let mut scene = scene(1);
    (scene.node[0], scene.wall[0], scene.white) = (0.0, 0.0, 1.0);
    let found = find_nodes(&scene.image(), &scene.lattice, [1.0; 2], Contrast::Auto);
    let triangles = found.map_or(0, |f| mesh_of(&scene, &f).triangles.len());
    assert!(triangles < 12, "{triangles}");
}

/// Which regime applies, case by case: the map is a constant twist, the triangles those of a simulated image.
#[test]
fn the_regime_has_its_reasons() {
    let scene = scene(3);
    let found = found(&scene);
    let geometry = |pitch: f64| Geometry {
        size: [420, 380],
        pixel_to_nm: Matrix2::identity() * pitch,
        origin: Vector2::zeros(),
        covariance: Matrix4::zeros(),
        from_sensors: false,
        departure: None,
    };
    let (material, convention) = (Material::graphene(), StrainConvention::RealSpace);
    let domains = |pitch: f64, found: &FoundNodes| {
        let mesh = mesh_of(&scene, found);
        DomainMap::new(found, &mesh, &geometry(pitch), &material, convention)
            .unwrap()
            .unwrap()
    };
    let map = |degrees: f64| made(|_| degrees.to_radians(), 1e-6);
    let plain = regime(&map(1.2), None);
    assert_eq!(plain.choice, RegimeChoice::Phases);
    assert!(!plain.in_doubt && plain.blurred == 0.0 && plain.variation.is_nan());
    // A small twist: triangles if there are any that tell something.
    let alone = regime(&map(0.3), None);
    assert!(alone.in_doubt && alone.choice == RegimeChoice::Phases);
    let small = regime(&map(0.3), Some(&domains(2.0, &found)));
    assert_eq!(small.choice, RegimeChoice::Domains);
    assert!(
        small.reasons[0].contains("below 0.5°"),
        "{:?}",
        small.reasons
    );
    let mut blunt = found.clone();
    for node in &mut blunt.nodes {
        node.covariance = Matrix2::identity() * 100.0;
    }
    let noisy = regime(&map(0.3), Some(&domains(2.0, &blunt)));
    assert!(noisy.in_doubt && noisy.choice == RegimeChoice::Phases);
    assert!(noisy.reasons.iter().any(|r| r.contains("uncertain")));
    // Wide windows on a lattice that changes by a third across the frame; 44 pixels of 0.27 nm: 1.2°.
    let mut wide = map(1.2);
    (wide.grid.step, wide.window_nm) = (wide.grid.step * 20.0, 120.0);
    let changing = regime(&wide, Some(&domains(0.27, &found)));
    assert_eq!(changing.choice, RegimeChoice::Domains);
    assert!(changing.reasons[0].contains("over the width of the window"));
    let narrow = regime(&map(1.2), Some(&domains(0.27, &found)));
    assert_eq!(narrow.choice, RegimeChoice::Phases, "{:?}", narrow.reasons);
    // Nodes that are bent, and no good node at all.
    let mut bent = map(1.2);
    for node in 0..bent.mask.len() {
        bent.mask[node] = if node % 2 == 0 {
            Mask::Bent
        } else {
            Mask::Good
        };
    }
    assert!(regime(&bent, None).in_doubt);
    bent.mask.fill(Mask::Margin);
    let none = regime(&bent, Some(&domains(0.27, &found)));
    assert!(none.choice == RegimeChoice::Domains && none.blurred.is_nan());
}

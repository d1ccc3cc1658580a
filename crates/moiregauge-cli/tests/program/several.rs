//! Several moirés in one image, from files to one folder of results each.

use std::path::Path;

use moiregauge::simulate::{Simulation, Simulator};
use spmfile::Samples;

use crate::common::{analyze, estimate, number, results, run, small_set, succeed};

const TWISTS: [f64; 2] = [1.1, 1.9];

/// Four frames whose phase channels hold the moirés of two samples in one scanner frame.
pub(crate) fn two_moires(folder: &Path) {
    let simulators = [0, 1].map(|i| {
        let mut settings = Simulation::default();
        settings.raster.pixels = [192; 2];
        settings.raster.scans = 4;
        settings.raster.nominal_size_nm = [90.0; 2];
        settings.sample.twist_deg = TWISTS[i];
        settings.sample.lattice_angle_deg += 11.0 * i as f64;
        if i == 1 {
            // One detector, one noise.
            settings.noise.pixel_deg = 0.0;
            settings.noise.line_deg = 0.0;
            settings.noise.flicker_deg = 0.0;
            settings.noise.plane_deg = [0.0; 2];
        }
        Simulator::new(settings).expect("a simulation")
    });
    std::fs::create_dir_all(folder).unwrap();
    for index in 0..simulators[0].frames() {
        let mut scan = simulators[0].frame(index);
        let other = simulators[1].frame(index);
        for (channel, other) in scan.channels.iter_mut().zip(&other.channels) {
            if channel.name != "TR Phase" {
                continue;
            }
            let (Samples::I32(sum), Samples::I32(add)) = (&mut channel.samples, &other.samples)
            else {
                panic!("the simulator makes 32-bit counts");
            };
            for (sum, add) in sum.iter_mut().zip(add) {
                *sum = sum.saturating_add(*add);
            }
        }
        let bytes = spmfile::nanoscope::write(&scan).expect("a NanoScope file");
        std::fs::write(folder.join(Simulator::file_name(index)), bytes).unwrap();
    }
}

#[test]
fn two_moires_have_two_results() {
    let folder = tempfile::tempdir().unwrap();
    let (scans, out) = (folder.path().join("scans"), folder.path().join("out"));
    two_moires(&scans);
    let said = succeed(analyze(&scans, &out).args(["--moires", "2"]));
    assert!(said.stdout.contains("moiré 2 of 2"), "{}", said.stdout);
    // The larger cell, which is that of the smaller twist, comes first.
    for (n, twist) in TWISTS.into_iter().enumerate() {
        let results = results(&out.join(format!("moire-{}", n + 1)));
        let (value, sigma) = estimate(&results, "/sets/0/mean/twist_deg");
        assert!((value - twist).abs() < 3.5 * sigma, "{value} ± {sigma}");
        assert!(sigma < 0.002, "{sigma}");
        assert_eq!(number(&results, "/settings/moires"), 2.0);
    }
    // Layers of each moiré: the second is read as that of graphene on hBN, the first as before.
    let other = folder.path().join("layers");
    let said = succeed(analyze(&scans, &other).args([
        "--moires",
        "2",
        "--layers",
        "graphene,graphene/hBN",
    ]));
    assert!(
        said.stdout.contains("moiré 2 of 2: graphene/hBN"),
        "{}",
        said.stdout
    );
    let both = [1, 2].map(|n| results(&other.join(format!("moire-{n}"))));
    let (twist, _) = estimate(&both[0], "/sets/0/mean/twist_deg");
    let (before, _) = estimate(&results(&out.join("moire-1")), "/sets/0/mean/twist_deg");
    assert!((twist - before).abs() < 1e-12);
    assert!(both[0].pointer("/settings/substrate").is_none());
    assert_eq!(both[1].pointer("/settings/substrate/name").unwrap(), "hBN");
    // λ = κ a/√(κ² − 2κ cos θ + 1): a moiré of 7.42 nm is one of graphene on hBN at 1.60°.
    let (twist, _) = estimate(&both[1], "/sets/0/mean/twist_deg");
    let (kappa, lambda) = (0.2504 / 0.246, 0.246 / (2.0 * 0.95_f64.to_radians().sin()));
    let square = (kappa * 0.246 / lambda).powi(2);
    let expected = ((kappa * kappa + 1.0 - square) / (2.0 * kappa))
        .acos()
        .to_degrees();
    assert!((twist - expected).abs() < 0.1, "{twist} {expected}");
    for (arguments, words) in [
        (vec!["--layers", "graphene,graphene/hBN"], "found 2"),
        (
            vec![
                "--moires",
                "2",
                "--layers",
                "graphene,hBN",
                "--lattice-angle",
                "12±0.1",
            ],
            "one pair of layers for all moirés",
        ),
    ] {
        let refused = run(analyze(&scans, &folder.path().join("no")).args(arguments));
        assert!(refused.stderr.contains(words), "{}", refused.stderr);
    }
    // Nothing is written over unasked.
    let again = run(analyze(&scans, &out).args(["--moires", "2"]));
    assert!(
        again.stderr.contains("already holds results"),
        "{}",
        again.stderr
    );
}

/// One moiré is not taken for two.
#[test]
fn a_moire_that_is_not_there_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let scans = small_set(folder.path());
    let out = folder.path().join("out");
    let run = run(analyze(&scans, &out).args(["--moires", "2"]));
    assert_eq!(run.code, Some(1));
    assert!(
        run.stderr.contains("but only 1 can be found"),
        "{}",
        run.stderr
    );
    let other =
        crate::common::run(analyze(&scans, &out).args(["--moires", "2", "--method", "fourier"]));
    assert!(
        other.stderr.contains("only with the method \"lattice\""),
        "{}",
        other.stderr
    );
}

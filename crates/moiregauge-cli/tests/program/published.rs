//! `--method paper`: all that the published protocol does, through the program.

use crate::common::{analyze, estimate, number, results, simulate, succeed};

/// The method brings its equation and its region along; what the user says comes first.
#[test]
fn the_published_method_is_the_whole_protocol() {
    let folder = tempfile::tempdir().unwrap();
    let scans = simulate(folder.path(), &["--pixels", "128", "--scans", "4"]);
    let with = |name: &str, options: &[&str]| {
        let out = folder.path().join(name);
        succeed(
            analyze(&scans, &out)
                .args(["--quiet", "--method", "paper"])
                .args(options),
        );
        results(&out)
    };
    let found = with("plain", &[]);
    assert_eq!(found["settings"]["strain_convention"], "k-space");
    assert_eq!(found["settings"]["overlap"], true);
    let other = with("real", &["--strain-convention", "real-space"]);
    assert_eq!(other["settings"]["strain_convention"], "real-space");

    let drift = &found["sets"][0]["drift"];
    for axis in ["x", "y"] {
        let (value, sigma) = estimate(drift, &format!("/{axis}_nm_per_min"));
        // The drift is the mean of the draws, not a least-squares solution beside them; rounding is all that may differ.
        let of_draws = number(drift, &format!("/monte_carlo/{axis}_nm_per_min/value"));
        assert!(
            (value - of_draws).abs() < 1e-9 * sigma,
            "{value} {of_draws}"
        );
    }
    // Draws of twist and strain come from the 48 equations, and scatter about the scan's own solution.
    let scan = &found["sets"][0]["scans"][0];
    let (twist, sigma) = estimate(scan, "/twist_strain/drift_corrected/twist_deg");
    let (mean, spread) = estimate(scan, "/monte_carlo/twist_deg");
    assert!((mean - twist).abs() < 0.5 * spread, "{mean} {twist}");
    assert!((0.3..3.0).contains(&(spread / sigma)), "{spread} {sigma}");
}

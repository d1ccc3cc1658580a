//! Two equal layers and the orientation of one: both senses of the twist, and what tells them apart.

use crate::common::{analyze, caveats, estimate, number, program, results, simulate, succeed};

const SAMPLE: [&str; 6] = [
    "--strain",
    "0.2",
    "--biaxial",
    "0.15",
    "--lattice-angle",
    "20",
];
const SMALL: [&str; 4] = ["--pixels", "128", "--scans", "4"];

/// −1.5° and 1.5° with the atoms of layer 1: both solutions on the screen and in the results, the truth among them; the
/// sense or the orientation of the other layer leaves it alone.
#[test]
fn either_sense_of_twisted_graphene() {
    for twist in ["-1.5", "1.5"] {
        let truth: f64 = twist.parse().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let sample = [&["--twist", twist][..], &SAMPLE].concat();
        let moire = simulate(folder.path(), &[&SMALL[..], &sample].concat());
        let out = folder.path().join("open");
        // 20° is the orientation of the reciprocal vectors.
        let given = ["--lattice-angle", "50±0.02"];
        let open = succeed(analyze(&moire, &out).args(given));
        let at = |found: &serde_json::Value| {
            found["sets"][0]["mean"]["readings"]["strain_tensor"].clone()
        };
        let found = results(&out);
        assert!(caveats(&found).contains(&"twist-sense-open"));
        let tensor = at(&found);
        let right = if truth > 0.0 {
            &tensor
        } else {
            &tensor["other_sense"]
        };
        let (value, sigma) = estimate(right, "/twist_deg");
        assert!((value - truth).abs() < 4.0 * sigma, "{value} ± {sigma}");
        let (value, sigma) = estimate(right, "/splits/0/biaxial_percent");
        assert!((value - 0.15).abs() < 4.0 * sigma, "{value} ± {sigma}");
        assert!(
            open.stdout.contains("either twist") && open.stdout.contains("or     twist"),
            "{}",
            open.stdout
        );
        let interval = &tensor["other_sense"]["twist_interval_deg"];
        assert!(number(interval, "/0") < 1.5 && number(interval, "/1") > 1.5);

        let sense = if truth > 0.0 { "positive" } else { "negative" };
        let other = format!("{}±0.02", 50.0 + truth);
        for (name, more) in [
            ("sense", ["--twist-sense", sense]),
            ("other", ["--lattice-angle-2", &other]),
        ] {
            let out = folder.path().join(name);
            succeed(analyze(&moire, &out).args(given).args(more));
            let found = results(&out);
            assert!(!caveats(&found).contains(&"twist-sense-open"));
            let tensor = at(&found);
            assert!(tensor["other_sense"].is_null());
            let (value, sigma) = estimate(&tensor, "/twist_deg");
            assert!((value - truth).abs() < 4.0 * sigma, "{value} ± {sigma}");
        }
    }
}

/// The calculator says both, too.
#[test]
fn the_calculator_says_both_senses() {
    let vectors = [
        "moire",
        "--vectors",
        "12.9,0.4",
        "6.1,11.5",
        "--sigma",
        "0.02",
    ];
    let given = ["--lattice-angle", "11.2±0.3"];
    let said = succeed(program().args(vectors).args(given)).stdout;
    assert!(said.contains("the other sense of the twist"), "{said}");
    let settled = [&given[..], &["--twist-sense", "negative"]].concat();
    let said = succeed(program().args(vectors).args(settled)).stdout;
    assert!(!said.contains("the other sense of the twist"), "{said}");
}

//! Whether twist, biaxial and uniaxial strain come out right as often as their σ says, with atomic images
//! of one layer: simulated sets, each with an orientation, an axis, a biaxial strain and noise of its own.
//!
//! `cargo run --release -p moiregauge --example strain_tensor [SETS [layer FRAMES [hBN]]]`. The table has the
//! share of sets within one, two and three σ (true errors: 68.3, 95.4 and 99.7 %), the spread of the pulls, and the rms error
//! in degrees and per cent.

#[path = "../tests/science/tensor_scene/mod.rs"]
mod tensor_scene;

use moiregauge::caveat::Caveat;
use rayon::prelude::*;
use tensor_scene::{moire, on_hbn, run, truth};

/// Pulls and errors of one set, whether it has more than one solution, and whether its atomic images scatter.
type Outcome = ([f64; 7], [f64; 7], [bool; 2]);

fn main() {
    let mut arguments = std::env::args().skip(1);
    let mut number = |default: u64| {
        arguments
            .next()
            .and_then(|text| text.parse().ok())
            .unwrap_or(default)
    };
    let (sets, layer, frames) = (number(300), number(1), number(4));
    let hetero = std::env::args().any(|text| text == "hBN");
    let results: Vec<Outcome> = (1..=sets)
        .into_par_iter()
        .map(|seed| {
            let set = if hetero {
                on_hbn(moire(seed))
            } else {
                moire(seed)
            };
            let outcome = run(set, layer as u8, frames as usize);
            let (found, put_in) = (outcome.tensor(), truth(&outcome.simulation));
            let [split, _] = found.splits(outcome.simulation.sample.material.poisson_ratio);
            let errors = [
                (found.twist - put_in[0]).to_degrees(),
                100.0 * (found.mean - put_in[1]),
                100.0 * (found.shear.x - put_in[2]),
                100.0 * (found.shear.y - put_in[3]),
                100.0 * (split.uniaxial.value - put_in[4]),
                100.0 * (split.biaxial.value - put_in[5]),
            ];
            let turn = if layer == 1 {
                0.0
            } else {
                outcome.simulation.sample.twist_deg
            };
            let off = outcome.atomic.angle.value.to_degrees()
                - outcome.simulation.sample.lattice_angle_deg
                - turn;
            let off = off - 60.0 * (off / 60.0).round();
            let (mut pulls, mut all) = ([0.0; 7], [0.0; 7]);
            pulls[..6].copy_from_slice(&outcome.pulls());
            all[..6].copy_from_slice(&errors);
            (pulls[6], all[6]) = (off / outcome.atomic.angle.sigma.to_degrees(), off);
            let scatter = |c: &Caveat| c.code() == "atomic-scatter";
            let scatters = outcome.atomic.caveats.iter().any(scatter);
            (pulls, all, [outcome.is_ambiguous(), scatters])
        })
        .collect();
    let n = results.len() as f64;
    println!("quantity       < 1σ   < 2σ   < 3σ   pull    mean    rms error");
    let names = [
        "twist",
        "mean strain",
        "shear 1",
        "shear 2",
        "uniaxial",
        "biaxial",
        "orientation",
    ];
    for (i, name) in names.into_iter().enumerate() {
        let share =
            |limit: f64| 100.0 * results.iter().filter(|r| r.0[i].abs() < limit).count() as f64 / n;
        let rms = |values: &dyn Fn(&Outcome) -> f64| {
            (results.iter().map(|r| values(r).powi(2)).sum::<f64>() / n).sqrt()
        };
        let mean = results.iter().map(|r| r.0[i]).sum::<f64>() / n;
        println!(
            "{name:12} {:6.1} {:6.1} {:6.1} {:6.2} {mean:+7.2}   {:.6} {}",
            share(1.0),
            share(2.0),
            share(3.0),
            rms(&|r| r.0[i]),
            rms(&|r| r.1[i]),
            if i == 0 || i == 6 { "°" } else { "%" }
        );
    }
    let count = |i: usize| results.iter().filter(|r| r.2[i]).count();
    println!(
        "{} sets whose atomic images scatter more than they should",
        count(1)
    );
    if hetero {
        println!(
            "{} sets with more than one reading, of which the nearest is counted",
            count(0)
        );
    }
}

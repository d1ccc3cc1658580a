use moiregauge::map::*;
use moiregauge::simulate::FieldScene;
fn cpu() -> f64 {
    let s = std::fs::read_to_string("/proc/self/stat").unwrap();
    let f: Vec<&str> = s.rsplit(')').next().unwrap().split_whitespace().collect();
    (f[11].parse::<f64>().unwrap() + f[12].parse::<f64>().unwrap()) / 100.0
}
fn main() {
    let a: Vec<f64> = std::env::args()
        .skip(1)
        .map(|v| v.parse().unwrap())
        .collect();
    let side = a[0] as usize;
    let mut scene = FieldScene::hexagonal([side, side], a[1], 0.3);
    if a[2] > 0.0 {
        scene = FieldScene::rippled(side, side as f64 / a[1], a[2]);
    }
    scene.white = a[3];
    let image = scene.image();
    let reference = Reference {
        pair: scene.pair,
        pitch: [1.0; 2],
    };
    let window = (a.len() > 4).then(|| a[4]);
    for _ in 0..3 {
        let c = cpu();
        let t = std::time::Instant::now();
        let map = local_lattices(
            &image,
            &reference,
            &Resolution {
                window_nm: window,
                ..Resolution::default()
            },
        )
        .unwrap();
        println!(
            "cpu {:.2} wall {:.2} window {:.2} px {:.2} periods, nodes {:?} rms {:.2}",
            cpu() - c,
            t.elapsed().as_secs_f64(),
            map.window_nm,
            map.window_nm / a[1],
            map.size,
            scene.signal_rms()
        );
        for h in &map.harmonics {
            print!("{:?} {:.4} {:.5}; ", h.index, h.amplitude, h.noise);
        }
        let mut counts = [0; 8];
        for n in &map.nodes {
            counts[n.mask as usize] += 1;
        }
        println!("\nmasks {counts:?}");
        if side < 1500 {
            let mut chi: Vec<f64> = map
                .nodes
                .iter()
                .filter(|n| n.mask != Mask::Margin)
                .map(|n| n.chi2 / n.freedom.max(1) as f64)
                .collect();
            chi.sort_by(f64::total_cmp);
            if !chi.is_empty() {
                println!(
                    "chi2/dof quartiles {:?}",
                    [
                        chi[chi.len() / 4],
                        chi[chi.len() / 2],
                        chi[3 * chi.len() / 4],
                        chi[chi.len() - 1]
                    ]
                );
            }
            let mut pulls = Vec::new();
            let mut err = Vec::new();
            for (i, n) in map
                .nodes
                .iter()
                .enumerate()
                .filter(|(_, n)| n.mask != Mask::Margin)
            {
                let at = map.first
                    + nalgebra::Vector2::new(
                        (i % map.size[0]) as f64 * map.step[0],
                        (i / map.size[0]) as f64 * map.step[1],
                    );
                let e = n.pair - scene.waves(at);
                err.push((e.norm() / n.pair.norm()).abs());
                for w in 0..2 {
                    for x in 0..2 {
                        pulls.push(e[(x, w)] / (n.indices[(w, w)] * n.slope[(x, x)]).sqrt());
                    }
                }
            }
            let rms = |v: &[f64]| (v.iter().map(|x| x * x).sum::<f64>() / v.len() as f64).sqrt();
            println!(
                "pull rms {:.3} rel err rms {:.2e} max {:.2e}",
                rms(&pulls),
                rms(&err),
                err.iter().fold(0.0f64, |a, b| a.max(*b))
            );
            break;
        }
    }
}

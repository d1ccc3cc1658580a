//! What is decided, one result a line.

use moiregauge::campaign::{Analysis, SetMean};
use moiregauge::caveat::Caveat;
use moiregauge::map::TwistStrainMap;
use moiregauge::meaning::Readings;
use moiregauge::region::Trends;
use moiregauge::window::Mask;

pub(crate) fn line(scene: &str, what: &str, value: f64, sigma: f64) {
    println!("{scene} | {what} | {value:.9e} | {sigma:.6e}");
}

/// A number without an error.
pub(crate) fn number(scene: &str, what: &str, value: f64) {
    println!("{scene} | {what} | {value:.9e} |");
}

pub(crate) fn said(scene: &str, caveats: &[Caveat]) {
    for caveat in caveats {
        println!("{scene} | said | {} ({})", caveat.code(), caveat.place);
    }
}

pub(crate) fn analysed(name: &str, analysis: &Analysis) {
    said(name, &analysis.caveats);
    number(name, "sets", analysis.sets.len() as f64);
    for (i, set) in analysis.sets.iter().enumerate() {
        let of = format!("{name}, set {i}");
        if let Some(drift) = &set.drift {
            for axis in 0..2 {
                let sigma = drift.covariance[(axis, axis)].sqrt();
                line(
                    &of,
                    &format!("drift {axis} (nm/min)"),
                    60.0 * drift.velocity[axis],
                    60.0 * sigma,
                );
            }
            if let Some(joint) = &drift.joint {
                println!("{of} | said | phases linked: {}", joint.phases);
                println!(
                    "{of} | said | acceleration: {}",
                    joint.acceleration.is_some()
                );
                println!("{of} | said | settling: {}", joint.settling_s.is_some());
                println!("{of} | said | fast gain: {}", joint.fast_gain.is_some());
                number(&of, "instability (nm)", joint.instability_nm);
            }
        }
        if let Some(mean) = set.mean.as_ref().or(set.uncorrected.as_ref()) {
            println!("{of} | said | corrected: {}", set.mean.is_some());
            of_mean(&of, mean);
        }
        for scan in &set.scans {
            if let Some(twist) = scan.twist_strain {
                let twist = twist.twist().scaled(180.0 / std::f64::consts::PI);
                line(
                    &of,
                    &format!("frame {} twist (°)", scan.file),
                    twist.value,
                    twist.sigma,
                );
            }
        }
    }
    if let Some(all) = &analysis.combined {
        let of = format!("{name}, all");
        println!("{of} | said | joint: {}", all.joint.is_some());
        let total = all.budget.applied_to(&all.twist_strain);
        twist_and_strain(&of, &all.twist_strain, &total);
        read(&of, &all.readings);
    }
}

fn of_mean(name: &str, mean: &SetMean) {
    twist_and_strain(
        name,
        &mean.twist_strain,
        &mean.budget.applied_to(&mean.twist_strain),
    );
    number(name, "enlargement", mean.enlargement);
    read(name, &mean.readings);
}

fn twist_and_strain(
    name: &str,
    found: &heterostrain::strain::TwistStrain,
    total: &heterostrain::strain::TwistStrain,
) {
    let degrees = 180.0 / std::f64::consts::PI;
    let twist = found.twist().scaled(degrees);
    line(name, "twist (°)", twist.value, twist.sigma);
    for i in 0..2 {
        let sigma = found.strain().covariance[(i, i)].sqrt();
        line(
            name,
            &format!("strain {i} (%)"),
            100.0 * found.strain_vector[i],
            100.0 * sigma,
        );
    }
    number(
        name,
        "σ of the twist with calibration (°)",
        total.twist().sigma * degrees,
    );
    println!("{name} | said | axis: {}", found.axis_lab().is_some());
}

fn read(name: &str, readings: &Readings) {
    number(name, "readings", readings.solutions.len() as f64);
    if let Some(naming) = &readings.naming {
        number(name, "names", naming.names.len() as f64);
    }
}

pub(crate) fn masks(name: &str, map: &TwistStrainMap) {
    for mask in Mask::ALL {
        number(
            name,
            &format!("nodes, {}", mask.name()),
            map.count(mask) as f64,
        );
    }
    number(name, "window (nm)", map.window_nm);
}

pub(crate) fn local(name: &str, map: &TwistStrainMap) {
    masks(name, map);
    if let Some(spread) = map.spread(&map.twist) {
        line(
            name,
            "map: mean twist (°)",
            spread.mean.to_degrees(),
            spread.mean_sigma.to_degrees(),
        );
        line(
            name,
            "map: spread of the twist (°)",
            spread.spread.to_degrees(),
            spread.noise.to_degrees(),
        );
    }
    if let Some(trend) = Trends::new(map).and_then(|trends| trends.of(&map.twist)) {
        line(
            name,
            "map: twist in the middle (°)",
            trend.middle.value.to_degrees(),
            trend.middle.sigma.to_degrees(),
        );
    }
}

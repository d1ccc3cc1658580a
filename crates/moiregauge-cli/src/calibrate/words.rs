//! What a calibration says on the screen.

use std::fmt::Write as _;

use moiregauge::calibration::Coordinates;
use moiregauge::campaign::CalibratedSet;
use moiregauge_pipeline::calibrate::CalibrationFound;
use moiregauge_report::screen::caveats;
use moiregauge_report::{plus_minus, two_digits};

use crate::hints;

/// The sets, the calibration, and what to keep in mind.
pub(super) fn summary(calibration: &CalibrationFound) -> String {
    let (found, lattice) = (&calibration.found, &calibration.lattice);
    let mut text = format!(
        "known lattice: {}, {} × {} nm, {}° (± {} %; {})\n\n",
        lattice.name,
        lattice.a_nm,
        lattice.b_nm,
        lattice.angle_deg,
        two_digits(lattice.sigma_percent),
        lattice.source
    );
    for set in &found.sets {
        one_set(&mut text, set);
    }
    let coordinates = match found.calibration.coordinates {
        Coordinates::Sensors => "position sensors",
        Coordinates::Nominal => "nominal coordinates",
    };
    let sets = found.sets.iter().filter(|s| s.used).count();
    let of = if sets == 1 {
        "1 set".to_owned()
    } else {
        format!("{sets} sets")
    };
    let [gain, mismatch, right] = calibration.estimates();
    let noise = found.statistical.map(two_digits);
    let _ = writeln!(text, "calibration of the {coordinates}, {of}");
    let rows = [
        (
            "gain",
            gain,
            "%",
            &noise[0],
            "lengths in the image are too long by this, mean of x and y",
        ),
        (
            "mismatch",
            mismatch,
            "%",
            &noise[1],
            "lengths along x are too long by this much more than along y",
        ),
        (
            "orthogonality",
            right,
            "mrad",
            &noise[2],
            "the angle between the axes in the image is 90° less this",
        ),
    ];
    for (name, value, unit, noise, words) in rows {
        let _ = writeln!(
            text,
            "  {name:14}{} {unit}  ({noise} from the images alone): {words}",
            plus_minus(value)
        );
    }
    let [x, y] = calibration.gains().map(plus_minus);
    let _ = writeln!(text, "  which is      x {x} %, y {y} %");
    let sizes = found.calibration.sizes_nm.iter().flatten();
    let range = sizes.copied().fold(0.0, f64::max);
    if let Some(curvature) = &found.calibration.curvature {
        let [x, y] = curvature.bends(range).map(|e| plus_minus(e.scaled(100.0)));
        let _ = writeln!(
            text,
            "  bends         x {x} %, y {y} % of {range:.4} nm: how far the sensors depart from straight lines"
        );
    }
    text.push('\n');
    caveats(&mut text, found.caveats.iter().map(Into::into), hints::of);
    text
}

fn one_set(text: &mut String, set: &CalibratedSet) {
    let count = set.files.len();
    let plural = if count == 1 { "" } else { "s" };
    let _ = writeln!(text, "{}: {}, {count} scan{plural}", set.name, set.channel);
    let lengths = [0, 1, 2].map(|i| format!("{:.4}", set.lattice.wavelength(i).value));
    let _ = writeln!(text, "  lattice shown {} nm", lengths.join(", "));
    match &set.drift {
        Some([x, y]) => {
            let _ = writeln!(
                text,
                "  drift         x {}, y {} nm/min",
                plus_minus(x.scaled(60.0)),
                plus_minus(y.scaled(60.0))
            );
        }
        None => text.push_str("  drift         not separated from gain and shear\n"),
    }
    if !set.used {
        text.push_str("  not used: the drift of other sets is known better\n");
    }
    text.push('\n');
}

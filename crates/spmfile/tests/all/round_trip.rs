//! What is written is read back: the same names, the same frame, values within half a count.

use proptest::prelude::*;
use spmfile::nanoscope::{WriteError, write};
use spmfile::{
    Channel, DateTime, FrameDirection, LineDirection, Samples, Scan, position_sensors, read,
};

use crate::common;

fn channel(
    name: &str,
    internal: &str,
    unit: &str,
    line: LineDirection,
    values: Vec<f64>,
) -> Channel {
    let columns = 8;
    Channel {
        name: name.to_owned(),
        internal_name: internal.to_owned(),
        unit: unit.to_owned(),
        line_direction: Some(line),
        scan_line: Some("Main".to_owned()),
        rows: values.len() / columns,
        columns,
        width_nm: Some(70.0),
        height_nm: Some(60.5),
        span: spmfile::Span::Frame,
        scale: 1.0,
        offset: 0.0,
        scaling: String::new(),
        plane_fit: None,
        samples: Samples::F64(values),
    }
}

fn scan(channels: Vec<Channel>) -> Scan {
    Scan {
        format: "simulated".to_owned(),
        instrument: Some("Bench µ".to_owned()),
        acquired: Some(DateTime {
            year: 2024,
            month: 3,
            day: 15,
            hour: 0,
            minute: 7,
            second: 59,
        }),
        frame_direction: Some(FrameDirection::Down),
        line_rate_hz: Some(4.25),
        rounding: Some(0.05),
        rotation_rad: -0.123_456_789_012,
        offset_nm: [12.5, -0.001],
        size_nm: Some([70.0, 60.5]),
        closed_loop: Some(false),
        line_times_s: None,
        notes: Vec::new(),
        metadata: Vec::new(),
        channels,
        unreadable: Vec::new(),
    }
}

/// Half a count of a range at most 4.2 times the largest value, and the rounding of the scale.
fn assert_same_values(found: &Channel, expected: &Channel) {
    let (found, expected) = (found.values(), expected.values());
    assert_eq!(found.len(), expected.len());
    let largest = expected.iter().fold(0.0_f64, |a, v| a.max(v.abs()));
    let half_count = 0.5 * 4.2 * largest / 2f64.powi(32);
    for (f, e) in found.iter().zip(&expected) {
        assert!((f - e).abs() <= half_count * 1.000_001, "{f} for {e}");
    }
}

fn assert_same_frame(found: &Scan, expected: &Scan) {
    assert_eq!(found.acquired, expected.acquired);
    assert_eq!(found.instrument, expected.instrument);
    assert_eq!(found.frame_direction, expected.frame_direction);
    assert_eq!(found.line_rate_hz, expected.line_rate_hz);
    assert_eq!(found.rounding, expected.rounding);
    assert_eq!(found.rotation_rad, expected.rotation_rad);
    assert_eq!(found.offset_nm, expected.offset_nm);
    assert_eq!(found.size_nm, expected.size_nm);
    assert_eq!(found.closed_loop, expected.closed_loop);
    assert_eq!(found.channels.len(), expected.channels.len());
    for (f, e) in found.channels.iter().zip(&expected.channels) {
        assert_eq!(
            (&f.name, &f.internal_name, &f.unit),
            (&e.name, &e.internal_name, &e.unit)
        );
        assert_eq!((f.rows, f.columns), (e.rows, e.columns));
        assert_eq!(f.line_direction, e.line_direction);
        assert_eq!(f.plane_fit, e.plane_fit);
        assert_eq!((f.width_nm, f.height_nm), (e.width_nm, e.height_nm));
    }
}

#[test]
fn a_scan_survives() {
    let ramp = |slope: f64| {
        (0..64)
            .map(|i| slope * f64::from(i) - 3.0)
            .collect::<Vec<_>>()
    };
    let mut all = Vec::new();
    for line in [LineDirection::Trace, LineDirection::Retrace] {
        all.push(channel("TR Phase", "TRPhase", "°", line, ramp(5.6)));
        all.push(channel(
            "TR Amplitude",
            "TRAmplitude",
            "mV",
            line,
            ramp(-0.01),
        ));
        all.push(channel("Height Sensor", "ZSensor", "µm", line, ramp(1e-4)));
        all.push(channel("Xsensor", "Xsensor", "nm", line, ramp(0.9)));
        all.push(channel("Ysensor", "Ysensor", "nm", line, ramp(-700.0)));
        all.push(channel("Nothing", "", "arb. units", line, vec![0.0; 64]));
    }
    all[0].plane_fit = Some("Line (realtime), Full (offline)".to_owned());
    let scan = scan(all);
    let bytes = write(&scan).expect("finite values");
    let back = read(&bytes).expect("our own file");
    assert_same_frame(&back, &scan);
    for (found, expected) in back.channels.iter().zip(&scan.channels) {
        assert_same_values(found, expected);
    }
    assert_eq!(back.format, "NanoScope 9.70");
    let sensors = position_sensors(&back, LineDirection::Retrace).expect("sensors");
    assert_eq!(sensors.y.line_direction, Some(LineDirection::Retrace));
    assert!(
        sensors.y.scaling.contains("Sens. Ysensor"),
        "{}",
        sensors.y.scaling
    );
}

/// An unfinished frame: 30 of 40 lines, three quarters of the height.
#[test]
fn an_unfinished_frame_survives() {
    let mut one = channel(
        "Height",
        "Height",
        "nm",
        LineDirection::Trace,
        vec![1.0; 240],
    );
    one.height_nm = Some(60.5 * 0.75);
    let scan = scan(vec![one]);
    let back = read(&write(&scan).expect("finite values")).expect("our own file");
    assert_same_frame(&back, &scan);
}

/// A second generation is identical: counts are kept as they are.
#[test]
fn counts_survive_unchanged() {
    let values = (0..64).map(|i| f64::from(i).sin()).collect();
    let first = scan(vec![channel(
        "Xsensor",
        "",
        "nm",
        LineDirection::Trace,
        values,
    )]);
    let once = read(&write(&first).expect("finite")).expect("our own file");
    let twice = read(&write(&once).expect("finite")).expect("our own file");
    assert_eq!(once.channels[0].samples, twice.channels[0].samples);
    let ratio = once.channels[0].scale / twice.channels[0].scale;
    assert!((ratio - 1.0).abs() < 1e-15, "{ratio}");
}

/// A real 16-bit file and its 32-bit copy hold the same values.
#[test]
fn a_real_file_survives() {
    let Some(data) = common::testdata("a_real_file_survives") else {
        return;
    };
    let path = data.join("real/nanoscope/icon_v91_tapping_4ch.spm");
    let scan = read(&common::bytes(&path)).expect("readable");
    let back = read(&write(&scan).expect("finite values")).expect("our own file");
    assert_same_frame(&back, &scan);
    for (found, expected) in back.channels.iter().zip(&scan.channels) {
        assert_same_values(found, expected);
    }
}

#[test]
fn what_cannot_be_written_is_refused() {
    let mut values = vec![0.0; 64];
    values[5] = f64::NAN;
    let missing = scan(vec![channel("A", "", "V", LineDirection::Trace, values)]);
    assert_eq!(
        write(&missing),
        Err(WriteError::NotFinite {
            name: "A".to_owned()
        })
    );
    let mut short = channel("A", "", "V", LineDirection::Trace, vec![0.0; 64]);
    short.rows = 9;
    assert!(matches!(
        write(&scan(vec![short])),
        Err(WriteError::Shape { .. })
    ));
}

/// More channels than the usual header has room for.
#[test]
fn long_headers_push_the_data_back() {
    let many: Vec<_> = (0..150)
        .map(|i| {
            channel(
                &format!("Channel {i}"),
                "",
                "V",
                LineDirection::Trace,
                vec![f64::from(i); 8],
            )
        })
        .collect();
    let scan = scan(many);
    let back = read(&write(&scan).expect("finite values")).expect("our own file");
    assert_eq!(back.channels.len(), 150);
    assert_same_values(&back.channels[149], &scan.channels[149]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn any_values_and_names_survive(
        exponent in -12..12,
        mantissas in prop::collection::vec(-1.0..1.0_f64, 16),
        name in "[A-Za-z0-9 /().µ°]{1,20}",
        unit in prop::sample::select(vec!["nm", "µm", "pm", "V", "mV", "°", "log(Pa)", "N/m", ""]),
    ) {
        let name = name.trim();
        prop_assume!(!name.is_empty());
        let values = mantissas.iter().map(|m| m * 10f64.powi(exponent)).collect();
        let scan = scan(vec![channel(name, "I", unit, LineDirection::Trace, values)]);
        let back = read(&write(&scan).expect("finite values")).expect("our own file");
        assert_same_frame(&back, &scan);
        assert_same_values(&back.channels[0], &scan.channels[0]);
    }
}

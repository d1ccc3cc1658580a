use super::*;
use crate::scan::LineDirection;

fn named(name: &str, kind: u8, value: &[u8]) -> Vec<u8> {
    [name.as_bytes(), &[0, kind], value].concat()
}

fn integer(name: &str, n: i32) -> Vec<u8> {
    named(name, b'i', &n.to_le_bytes())
}

fn double(name: &str, n: f64) -> Vec<u8> {
    named(name, b'd', &n.to_le_bytes())
}

fn string(name: &str, value: &str) -> Vec<u8> {
    named(name, b's', &[value.as_bytes(), &[0]].concat())
}

fn object(kind: &str, items: &[Vec<u8>]) -> Vec<u8> {
    let items = items.concat();
    [
        kind.as_bytes(),
        &[0],
        &(items.len() as u32).to_le_bytes(),
        &items,
    ]
    .concat()
}

fn doubles(name: &str, values: &[f64]) -> Vec<u8> {
    let mut bytes = (values.len() as u32).to_le_bytes().to_vec();
    bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    named(name, b'D', &bytes)
}

fn unit(name: &str, unit: &str) -> Vec<u8> {
    named(name, b'o', &object("GwySIUnit", &[string("unitstr", unit)]))
}

fn field(lateral: &str, values: &[f64]) -> Vec<u8> {
    object(
        "GwyDataField",
        &[
            integer("xres", 3),
            integer("yres", 2),
            double("xreal", 3e-6),
            double("yreal", 1e-6),
            double("xoff", 1e-6),
            // What is not known is passed over.
            named("new", b'q', &[0; 8]),
            named("flag", b'b', &[1]),
            named("texts", b'S', b"\x02\0\0\0a\0b\0"),
            unit("si_unit_xy", lateral),
            unit("si_unit_z", "V"),
            doubles("data", values),
        ],
    )
}

const VALUES: [f64; 6] = [0.0, 1.0, 2.0, f64::NAN, 4.0, 5.0];

fn file(lateral: &str, values: &[f64]) -> Vec<u8> {
    let items = [
        named("/7/data", b'o', &field(lateral, values)),
        named("/0/data", b'o', &field(lateral, values)),
        named("/0/mask", b'o', &field(lateral, values)),
        string("/0/data/title", "Z (Backward)"),
        string("/7/data/title", "Phase"),
        named(
            "/0/meta",
            b'o',
            &object("GwyContainer", &[string("Bias", "1 µV")]),
        ),
        named("/0/graph", b'o', &object("GwyGraphModel", &[])),
    ];
    [b"GWYP".to_vec(), object("GwyContainer", &items)].concat()
}

#[test]
fn images_come_by_number_and_from_the_top() {
    let scan = crate::read(&file("m", &VALUES)).expect("two images");
    let names: Vec<&str> = scan.channels.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["Z (Backward)", "Phase"]);
    let channel = &scan.channels[0];
    assert_eq!(channel.line_direction, Some(LineDirection::Retrace));
    let values = channel.values();
    assert!(values[0].is_nan());
    assert_eq!(values[1..], [4.0, 5.0, 0.0, 1.0, 2.0]);
    assert_eq!(channel.unit, "V");
    let close = |found: f64, expected: f64| (found - expected).abs() < 1e-9;
    assert!(close(channel.width_nm.expect("width"), 3000.0));
    assert!(close(channel.height_nm.expect("height"), 1000.0));
    assert!(close(scan.offset_nm[0], 2500.0));
    assert_eq!(scan.metadata, [("Bias".to_owned(), "1 µV".to_owned())]);
}

#[test]
fn no_unit_is_no_metre() {
    for unit in ["", "V", "px"] {
        let scan = crate::read(&file(unit, &VALUES)).expect("two images");
        assert_eq!((scan.size_nm, scan.channels[0].width_nm), (None, None));
    }
    let scan = crate::read(&file("µm", &VALUES)).expect("two images");
    assert!((scan.channels[0].width_nm.expect("width") - 3e-3).abs() < 1e-12);
}

#[test]
fn damage_is_named() {
    let error = |bytes: &[u8]| crate::read(bytes).expect_err("damaged").to_string();
    assert!(error(&file("m", &VALUES[..5])).contains("5 samples"));
    let whole = file("m", &VALUES);
    for length in [5, 20, 60, 200] {
        assert!(error(&whole[..length]).contains("expected"), "{length}");
    }
    let Err(ReadError::Incomplete { readable, .. }) = crate::read(&whole[..whole.len() - 90])
    else {
        panic!("cut off behind the first images");
    };
    assert_eq!(readable.channels.len(), 2);
    assert!(error(b"GWYO").contains("version 1"));
    let empty = [b"GWYP".to_vec(), object("GwyContainer", &[])].concat();
    assert!(error(&empty).contains("no image"));
    let odd = [
        b"GWYP".to_vec(),
        object("GwyContainer", &[named("a", b'?', &[])]),
    ]
    .concat();
    assert!(error(&odd).contains("unknown kind"));
    // An object within its own promise only.
    let mut giant = whole;
    giant[17..21].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(crate::read(&giant).is_ok() || error(&giant).contains("expected"));
}

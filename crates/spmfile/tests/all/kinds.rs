//! Twelve inputs of the kinds that public reports show, made here: each is read as it is meant, or refused as what it is.

use spmfile::{ReadError, Scan, read};

fn whole(bytes: &[u8], what: &str) -> Scan {
    read(bytes).unwrap_or_else(|error| panic!("{what}: {error}"))
}

fn shape(scan: &Scan) -> [usize; 2] {
    [scan.channels[0].rows, scan.channels[0].columns]
}

fn near(found: Option<[f64; 2]>, expected: [f64; 2], what: &str) {
    let found = found.unwrap_or_else(|| panic!("{what}: no size"));
    let off = [0, 1].map(|i| (found[i] / expected[i] - 1.0).abs());
    assert!(off[0].max(off[1]) < 1e-6, "{what}: {found:?}");
}

/// Row 2 and column 3 of a table as it lies in the file, that is from the top, with nothing but its own numbers.
fn is_table(scan: &Scan, rows: usize, columns: usize, value: f64, what: &str) {
    assert_eq!(shape(scan), [rows, columns], "{what}");
    let at = (rows - 1 - 2) * columns + 3;
    let found = scan.channels[0].values()[at];
    assert!((found - value).abs() < 1e-12, "{what}: {found}");
}

/// A number for a place; no two places of a table have the same.
fn value(row: usize, column: usize) -> f64 {
    0.25 * (row * 37 + column * column) as f64 - 11.5
}

/// Pieces one after the other.
fn text(count: usize, piece: impl Fn(usize) -> String) -> String {
    (0..count).map(piece).collect::<Vec<_>>().concat()
}

fn row(row: usize, columns: usize, between: &str) -> String {
    let all = (0..columns).map(|column| value(row, column).to_string());
    all.collect::<Vec<_>>().join(between)
}

#[test]
fn labels_and_axes_are_no_pixels() {
    let (rows, columns) = (20, 17);
    // A data frame with names of columns and numbers of rows.
    let names = text(columns, |c| format!(",h{c}"));
    let lines = text(rows, |r| format!("{r},{}\n", row(r, columns, ",")));
    let frame = whole(format!("{names}\n{lines}").as_bytes(), "data frame");
    is_table(&frame, rows, columns, value(2, 3), "data frame");

    // Axes in even steps, x along the first line and y down the first column, with a word in the corner.
    let axis = text(columns, |c| format!(";{}", 1.5 * c as f64));
    let lines = text(rows, |r| {
        format!("{};{}\n", 1.5 * r as f64, row(r, columns, ";"))
    });
    let axes = whole(format!("y/x{axis}\n{lines}").as_bytes(), "axes");
    is_table(&axes, rows, columns, value(2, 3), "axes");
}

#[test]
fn text_of_windows_is_text() {
    let (rows, columns) = (19, 16);
    let lines: String = (0..rows).map(|r| row(r, columns, "\t") + "\r\n").collect();
    let big: Vec<u8> = std::iter::once(0xfeff)
        .chain(lines.encode_utf16())
        .flat_map(u16::to_be_bytes)
        .collect();
    is_table(&whole(&big, "UTF-16"), rows, columns, value(2, 3), "UTF-16");

    // A simple field by a program that writes Latin-1: µ and ö are one byte each.
    let mut field = b"Gwyddion Simple Field 1.0\nXRes = 5\nYRes = 4\nXReal = 0.05\nYReal = 0.04\nXYUnits = \xb5m\nTitle = H\xf6he\n".to_vec();
    field.resize(field.len() + 4 - field.len() % 4, 0);
    field.extend((0..20).flat_map(|n| (n as f32).to_le_bytes()));
    let scan = whole(&field, "GSF");
    near(scan.size_nm, [50.0, 40.0], "GSF");
    assert_eq!(scan.channels[0].name, "Höhe");
}

/// A component of a Gwyddion file.
fn component(name: &str, kind: u8, data: &[u8]) -> Vec<u8> {
    [name.as_bytes(), &[0, kind], data].concat()
}

fn object(name: &str, items: &[Vec<u8>]) -> Vec<u8> {
    let items = items.concat();
    let size = (items.len() as u32).to_le_bytes();
    [name.as_bytes(), &[0], &size, &items].concat()
}

#[test]
fn gwyddion_files_in_latin_1_keep_their_size() {
    let unit = object("GwySIUnit", &[component("unitstr", b's', b"\xb5m\0")]);
    let count = 12_u32.to_le_bytes();
    let samples: Vec<u8> = (0..12).flat_map(|n| f64::from(n).to_le_bytes()).collect();
    let field = object(
        "GwyDataField",
        &[
            component("xres", b'i', &4_i32.to_le_bytes()),
            component("yres", b'i', &3_i32.to_le_bytes()),
            component("xreal", b'd', &0.08_f64.to_le_bytes()),
            component("yreal", b'd', &0.06_f64.to_le_bytes()),
            component("si_unit_xy", b'o', &unit),
            component("data", b'D', &[&count[..], &samples].concat()),
        ],
    );
    let container = object(
        "GwyContainer",
        &[
            component("/0/data", b'o', &field),
            component("/0/data/title", b's', b"Gr\xf6\xdfe\0"),
        ],
    );
    let scan = whole(&[b"GWYP", &container[..]].concat(), "Gwyddion");
    near(scan.size_nm, [80.0, 60.0], "Gwyddion");
    assert_eq!(scan.channels[0].name, "Größe");
    assert_eq!(shape(&scan), [3, 4]);
}

/// A little-endian TIFF picture: entries (tag, type, values as they are stored), then the pixels.
fn tiff(entries: &[(u16, u16, Vec<u8>)], strips: usize, pixels: &[u8]) -> Vec<u8> {
    let size = |kind: u16| match kind {
        1 | 2 => 1,
        3 => 2,
        4 => 4,
        _ => 8,
    };
    let count = entries.len() + 1;
    let mut all = entries.to_vec();
    all.push((273, 4, vec![0; 4 * strips]));
    let stored: usize = all.iter().map(|e| e.2.len()).filter(|n| *n > 4).sum();
    let mut beside = 8 + 2 + 12 * count + 4;
    let start = beside + stored;
    let offsets = (0..strips).map(|n| (start + n * pixels.len() / strips) as u32);
    all[count - 1].2 = offsets.flat_map(u32::to_le_bytes).collect();
    let (mut list, mut rest) = (Vec::new(), Vec::new());
    all.sort_by_key(|entry| entry.0);
    for (tag, kind, value) in all {
        list.extend(tag.to_le_bytes());
        list.extend(kind.to_le_bytes());
        list.extend(((value.len() / size(kind)) as u32).to_le_bytes());
        if value.len() > 4 {
            list.extend((beside as u32).to_le_bytes());
            beside += value.len();
            rest.extend(value);
        } else {
            list.extend(value.iter().copied().chain([0; 4]).take(4));
        }
    }
    let head = [&b"II*\0\x08\0\0\0"[..], &(count as u16).to_le_bytes()].concat();
    [&head[..], &list, &[0; 4], &rest, pixels].concat()
}

fn short(number: u16) -> Vec<u8> {
    number.to_le_bytes().to_vec()
}

/// What every picture has: columns, rows, bits, samples of a pixel, bytes of the strip, sample format.
fn picture(columns: u16, rows: u16, bits: &[u16], format: u16) -> Vec<(u16, u16, Vec<u8>)> {
    let samples = bits.len() as u16;
    let bytes = u32::from(columns) * u32::from(rows) * u32::from(bits[0] / 8);
    let bits = bits.iter().flat_map(|b| b.to_le_bytes()).collect();
    vec![
        (256, 3, short(columns)),
        (257, 3, short(rows)),
        (258, 3, bits),
        (259, 3, short(1)),
        (262, 3, short(if samples == 3 { 2 } else { 1 })),
        (277, 3, short(samples)),
        (278, 3, short(rows)),
        (279, 4, bytes.to_le_bytes().to_vec()),
        (339, 3, short(format).repeat(samples.into())),
    ]
}

#[test]
fn pictures_of_imagej_have_a_size_and_planes_are_refused() {
    let mut entries = picture(6, 5, &[32], 3);
    // 200 samples in a micrometre.
    let resolution = [200_u32, 1]
        .iter()
        .flat_map(|n| n.to_le_bytes())
        .collect::<Vec<u8>>();
    entries.push((282, 5, resolution.clone()));
    entries.push((283, 5, resolution));
    entries.push((296, 3, short(1)));
    entries.push((
        270,
        2,
        b"ImageJ=1.53t\nunit=micron\nspacing=1.0\n\0".to_vec(),
    ));
    let pixels: Vec<u8> = (0..30).flat_map(|n| (n as f32).to_le_bytes()).collect();
    let scan = whole(&tiff(&entries, 1, &pixels), "ImageJ");
    near(scan.size_nm, [30.0, 25.0], "ImageJ");

    let mut planes = picture(4, 4, &[8, 8, 8], 1);
    planes.push((284, 3, short(2)));
    let counts = planes.iter_mut().find(|entry| entry.0 == 279);
    counts.unwrap().2 = [16_u32; 3].iter().flat_map(|n| n.to_le_bytes()).collect();
    let error = read(&tiff(&planes, 3, &[7; 48])).expect_err("planes");
    assert!(matches!(error, ReadError::Unsupported { .. }), "{error}");
}

#[test]
fn sound_files_that_are_no_images_are_not_called_damaged() {
    let mut complex =
        b"\x93NUMPY\x01\0\x76\0{'descr': '<c16', 'fortran_order': False, 'shape': (4, 4), }"
            .to_vec();
    complex.resize(127, b' ');
    complex.push(b'\n');
    complex.resize(128 + 256, 0);
    // A list of points with a fourth column, and a head.
    let points = text(300, |n| {
        format!("{}\t{}\t{}\t{}\n", n % 20, n / 20, value(n, 1), n % 7)
    });
    let points = format!("# x y z I\n{points}").into_bytes();
    let others = [
        (complex, "complex"),
        (points, "list of points"),
        (b"CDF\x01\0\0\0\x01\0\0\0\x0a\0\0\0\x02".to_vec(), "NetCDF"),
        (
            b"\x89HDF\r\n\x1a\n\x02\x08\x08\0jpk-image-map".to_vec(),
            "HDF5",
        ),
    ];
    for (bytes, words) in others {
        let error = read(&bytes).expect_err(words);
        assert!(!matches!(error, ReadError::Damaged { .. }), "{error}");
        assert!(error.to_string().contains(words), "{words}: {error}");
    }
}

#[test]
fn an_angle_in_words_is_told() {
    let header = ":NANONIS_VERSION:\n2\n:SCANIT_TYPE:\n FLOAT MSBFIRST\n:REC_DATE:\n 03.04.2022\n:REC_TIME:\n11:12:13\n:SCAN_PIXELS:\n 5 4\n:SCAN_TIME:\n 1.0E+0 1.0E+0\n\
                  :SCAN_RANGE:\n 5.0E-8 4.0E-8\n:SCAN_OFFSET:\n 0.0E+0 0.0E+0\n:SCAN_ANGLE:\n thirty\n:SCAN_DIR:\ndown\n:DATA_INFO:\n\
                  \tChannel\tName\tUnit\tDirection\tCalibration\tOffset\n\t0\tZ\tm\tboth\t1.0E+0\t0.0E+0\n\n:SCANIT_END:\n\n\n\x1a\x04";
    let samples = (0..40).flat_map(|n| (n as f32 * 1e-10).to_be_bytes());
    let bytes: Vec<u8> = header.bytes().chain(samples).collect();
    let scan = whole(&bytes, "Nanonis");
    let told = |note: &String| note.contains("SCAN_ANGLE") && note.contains("thirty");
    assert!(scan.notes.iter().any(told), "{:?}", scan.notes);
}

//! Small files that show what public reports found, against what is right for each, and that sound files of
//! instruments give no cause for doubt.

use std::path::{Path, PathBuf};

use spmfile::{ReadError, Scan, read};

use crate::common;

fn report(folder: &Path, name: &str) -> Result<Scan, ReadError> {
    read(&common::bytes(&folder.join("reports").join(name)))
}

fn shape(scan: &Scan) -> [usize; 2] {
    [scan.channels[0].rows, scan.channels[0].columns]
}

fn close(found: Option<[f64; 2]>, expected: [f64; 2], what: &str) {
    let found = found.unwrap_or_else(|| panic!("{what}: no size"));
    // Resolutions and units are fractions of two; everything else is exact.
    let near = found
        .iter()
        .zip(expected)
        .all(|(a, b)| (a - b).abs() < 1e-9);
    assert!(near, "{what}: {found:?} instead of {expected:?}");
}

#[test]
fn files_of_reports_are_read() {
    let Some(folder) = common::testdata("files_of_reports_are_read") else {
        return;
    };
    let whole = |name: &str| report(&folder, name).unwrap_or_else(|e| panic!("{name}: {e}"));

    let narrow = whole("nanoscope_narrow_16to1.spm");
    assert_eq!(shape(&narrow), [16, 256]);
    close(narrow.size_nm, [100.0, 6.25], "narrow");
    assert_eq!(narrow.channels[0].height_nm, Some(6.25));

    let angle = whole("nanonis_angle_unreadable.sxm");
    assert_eq!(angle.notes.len(), 1);
    let note = &angle.notes[0];
    assert!(
        note.contains("SCAN_ANGLE") && note.contains("4,500000E+01"),
        "{note}"
    );

    let latin1 = whole("gwy_latin1.gwy");
    close(latin1.size_nm, [100.0, 100.0], "Latin-1");
    assert_eq!(latin1.channels[0].name, "Höhe");

    let nid = whole("nanosurf_utf8.nid");
    assert!(
        (nid.offset_nm[0] + 1840.0).abs() < 1e-9,
        "{:?}",
        nid.offset_nm
    );
    assert_eq!(nid.channels[0].unit, "°");

    let table = whole("table_with_labels.csv");
    assert_eq!(shape(&table), [64, 64]);
    // The first line of the file is the top one.
    assert_eq!(
        table.channels[0].values()[63 * 64..][..3],
        [-0.5075, 0.2612, 1.2895]
    );

    assert_eq!(shape(&whole("utf16_matrix.txt")), [24, 24]);
    close(whole("imagej_nm.tif").size_nm, [100.0, 100.0], "ImageJ");
}

#[test]
fn files_of_reports_are_named() {
    let Some(folder) = common::testdata("files_of_reports_are_named") else {
        return;
    };
    for (name, words) in [
        ("points.xyz", "list of points"),
        ("stack_planes.tif", "one plane for each"),
        ("complex.npy", "complex"),
        ("hs_afm_head.asd", "high-speed AFM"),
        ("createc_head.dat", "Createc"),
        ("netcdf3_head.nc", "NetCDF"),
    ] {
        let error = report(&folder, name).expect_err(name);
        let damaged = matches!(error, ReadError::Damaged { .. });
        let error = error.to_string();
        assert!(error.contains(words), "{name}: {error}");
        // Of these the head of a Createc file alone is cut off.
        assert_eq!(damaged, name == "createc_head.dat", "{name}: {error}");
    }
}

/// A rule that finds fault with sound files would be ignored by everyone.
#[test]
fn sound_files_are_read_without_doubt() {
    let Some(folder) = common::testdata("sound_files_are_read_without_doubt") else {
        return;
    };
    let mut folders = vec![folder.join("real"), folder.join("synthetic")];
    let mut files: Vec<PathBuf> = Vec::new();
    while let Some(folder) = folders.pop() {
        let Ok(entries) = std::fs::read_dir(folder) else {
            continue;
        };
        for path in entries.flatten().map(|entry| entry.path()) {
            if path.is_dir() {
                folders.push(path);
            } else {
                files.push(path);
            }
        }
    }
    let mut scans = 0;
    for path in files {
        if let Ok(scan) = read(&common::bytes(&path)) {
            let doubts: Vec<_> = scan
                .notes
                .iter()
                .filter(|note| note.contains("to be readable"))
                .collect();
            assert!(doubts.is_empty(), "{}: {doubts:?}", path.display());
            scans += 1;
        }
    }
    assert!(scans > 20, "{scans} scans");
}

/// What is told by the first bytes alone.
#[test]
fn other_files_of_controllers_are_named() {
    for (head, words) in [
        (&b"Experiment\tbias spectroscopy\t\r\n"[..], "Nanonis"),
        (b"[ParVERT30]\r\n", "Createc"),
        (b"CDF\x02\0\0\0\0", "GXSM"),
        (b"\x89HDF\r\n\x1a\n\0\0\0jpk-force", ".jpk"),
        (b"\x89HDF\r\n\x1a\n\0\0\0IGORWaveType", "Igor"),
    ] {
        let error = read(head).expect_err("no image");
        assert!(matches!(error, ReadError::OtherFormat { .. }), "{error}");
        assert!(error.to_string().contains(words), "{error}");
    }
}

//! Files opened before they are decoded: the same channels and values as read at once, whole and by rows.

use std::io::Result as IoResult;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use spmfile::{Channel, File, Format, OpenOptions, ReadError, Seekable, Source};

use crate::common;

/// Formats that are read by rows without having their bytes in memory.
const FLAT: [Format; 7] = [
    Format::NanoScope,
    Format::Nanonis,
    Format::Gsf,
    Format::Nid,
    Format::Wsxm,
    Format::AgilentMi,
    Format::Npy,
];

/// Every real file, in order of name.
fn real(data: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let entries = |folder: &Path| -> Vec<PathBuf> {
        let entries = std::fs::read_dir(folder).expect("a folder");
        let mut paths: Vec<_> = entries.map(|e| e.expect("an entry").path()).collect();
        paths.sort();
        paths
    };
    let folders = entries(&data.join("real"))
        .into_iter()
        .filter(|p| p.is_dir());
    let files = folders.flat_map(|folder| entries(&folder));
    files
        .filter(|path| path.extension().is_none_or(|e| e != "json" && e != "md"))
        .map(|path| (path.clone(), common::bytes(&path)))
        .collect()
}

fn damaged_too() -> OpenOptions {
    let mut options = OpenOptions::default();
    options.damaged = true;
    options
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|v| v.to_bits()).collect()
}

/// Everything but the samples.
fn in_words(channel: &Channel) -> String {
    let c = channel;
    format!(
        "{:?}",
        (
            (
                &c.name,
                &c.internal_name,
                &c.unit,
                c.line_direction,
                &c.scan_line
            ),
            (c.rows, c.columns, c.width_nm, c.height_nm, c.span),
            (c.scale, c.offset, &c.scaling, &c.plane_fit),
        )
    )
}

#[test]
fn opened_files_hold_what_reading_gives() {
    let Some(data) = common::testdata("opened_files_hold_what_reading_gives") else {
        return;
    };
    let mut channels = 0;
    for (path, bytes) in real(&data) {
        let name = path.display();
        let scan = match spmfile::read(&bytes) {
            Ok(scan) => scan,
            // Only the samples tell that none was recorded.
            Err(ReadError::AllMissing { channels }) => {
                let file = File::open(&bytes).expect("whole headers");
                assert_eq!(file.frames()[0].channels().len(), channels, "{name}");
                continue;
            }
            Err(error) => {
                let opened = File::open(&bytes).expect_err("as reading");
                assert_eq!(opened.to_string(), error.to_string(), "{name}");
                continue;
            }
        };
        let file = File::open(&bytes).expect("as reading");
        let [frame] = file.frames() else {
            panic!("{name}: {} frames", file.frames().len());
        };
        assert_eq!(frame.channels().len(), scan.channels.len(), "{name}");
        assert_eq!(frame.header().format, scan.format, "{name}");
        assert_eq!(frame.header().size_nm, scan.size_nm, "{name}");
        assert_eq!(frame.header().metadata, scan.metadata, "{name}");
        for (number, (header, whole)) in frame.channels().zip(&scan.channels).enumerate() {
            assert_eq!(header.info.name, whole.name, "{name}");
            let alone = frame.read(number).expect("as reading");
            assert_eq!(in_words(&alone), in_words(whole), "{name}");
            assert_eq!(alone.values().len(), whole.rows * whole.columns, "{name}");
            let values = bits(&whole.values());
            assert_eq!(bits(&alone.values()), values, "{name}");
            let step = (whole.rows / 3).max(1);
            let mut by_rows = Vec::new();
            for start in (0..whole.rows).step_by(step) {
                let rows = start..(start + step).min(whole.rows);
                by_rows.extend(frame.rows(number, rows).expect("as reading"));
            }
            assert_eq!(bits(&by_rows), values, "{name}: {}", whole.name);
            channels += 1;
        }
        let beyond = frame.rows(0, 0..scan.channels[0].rows + 1);
        assert!(
            matches!(beyond, Err(ReadError::NoSuchRows { .. })),
            "{name}"
        );
        let none = frame.read(scan.channels.len());
        assert!(
            matches!(none, Err(ReadError::NoSuchChannel { .. })),
            "{name}"
        );
    }
    assert!(channels > 50, "{channels}");
}

/// Counts the bytes that are taken from it.
struct Counted<'a> {
    bytes: &'a [u8],
    taken: AtomicU64,
}

impl Source for Counted<'_> {
    fn length(&self) -> IoResult<u64> {
        self.bytes.length()
    }

    fn read_at(&self, at: u64, into: &mut [u8]) -> IoResult<()> {
        self.taken.fetch_add(into.len() as u64, Ordering::Relaxed);
        self.bytes.read_at(at, into)
    }
}

#[test]
fn flat_files_are_read_by_rows_from_a_source() {
    let Some(data) = common::testdata("flat_files_are_read_by_rows_from_a_source") else {
        return;
    };
    let mut met = Vec::new();
    for (path, bytes) in real(&data) {
        let name = path.display();
        let source = Arc::new(Counted {
            bytes: &bytes,
            taken: AtomicU64::new(0),
        });
        let opened = File::open_source(source.clone(), &OpenOptions::default());
        let format = spmfile::detect(&bytes);
        if !FLAT.contains(&format) {
            assert!(opened.is_err(), "{name}");
            continue;
        }
        let Ok(scan) = spmfile::read(&bytes) else {
            continue;
        };
        let file = opened.expect("as reading");
        let frame = &file.frames()[0];
        met.push(format);
        for (number, channel) in scan.channels.iter().enumerate() {
            let middle = channel.rows / 2..channel.rows / 2 + 1;
            let expected = bits(&channel.lines(middle.clone()));
            let found = frame.rows(number, middle.clone()).expect("a row");
            assert_eq!(bits(&found), expected, "{name}");
            // The scale is known by now: nothing but the row is taken.
            let before = source.taken.swap(0, Ordering::Relaxed);
            assert!(before > 0, "{name}");
            frame.rows(number, middle).expect("a row");
            let taken = source.taken.load(Ordering::Relaxed);
            assert!(taken <= 8 * channel.columns as u64, "{name}: {taken} bytes");
            let whole = frame.read(number).expect("as reading");
            assert_eq!(bits(&whole.values()), bits(&channel.values()), "{name}");
        }
        let seekable = Seekable::new(std::fs::File::open(&path).expect("a file"));
        let file =
            File::open_source(Arc::new(seekable), &OpenOptions::default()).expect("as reading");
        let row = file.frames()[0].rows(0, 0..1).expect("a row");
        assert_eq!(bits(&row), bits(&scan.channels[0].lines(0..1)), "{name}");
    }
    for format in [Format::NanoScope, Format::Nanonis, Format::Nid] {
        assert!(met.contains(&format), "{format:?}");
    }
    for format in [Format::Wsxm, Format::AgilentMi, Format::Npy] {
        assert!(met.contains(&format), "{format:?}");
    }
}

/// A survey of 1.2 TB that is not there: the header is, and every sample of row n is n.
struct Survey {
    header: Vec<u8>,
    rows: u64,
    columns: u64,
}

impl Source for Survey {
    fn length(&self) -> IoResult<u64> {
        Ok(self.header.len() as u64 + 4 * self.rows * self.columns)
    }

    fn read_at(&self, at: u64, into: &mut [u8]) -> IoResult<()> {
        for (place, byte) in (at..).zip(into) {
            *byte = if let Some(byte) = self.header.get(place as usize) {
                *byte
            } else {
                let place = place - self.header.len() as u64;
                let number = (place / 4 / self.columns) as f32;
                number.to_be_bytes()[(place % 4) as usize]
            };
        }
        Ok(())
    }
}

#[test]
fn surveys_larger_than_memory_are_read_by_rows() {
    let mut header = b":NANONIS_VERSION:\n2\n:SCANIT_TYPE:\nFLOAT MSBFIRST\n:SCAN_PIXELS:\n \
        100000 3000000\n:SCAN_DIR:\ndown\n:DATA_INFO:\n\tChannel\tName\tUnit\tDirection\n\
        \t14\tZ\tm\tforward\n:SCANIT_END:\n\n\n"
        .to_vec();
    header.extend([0x1a, 0x04]);
    let survey = Survey {
        header,
        rows: 3_000_000,
        columns: 100_000,
    };
    let file = File::open_source(Arc::new(survey), &OpenOptions::default()).expect("a survey");
    let frame = &file.frames()[0];
    // Downwards: the first stored line is the top one.
    let top = frame.rows(0, 2_999_999..3_000_000).expect("a row");
    assert!(top.len() == 100_000 && top.iter().all(|&v| v == 0.0));
    let two = frame.rows(0, 1_000_000..1_000_002).expect("two rows");
    assert_eq!((two[0], two[100_000]), (1_999_999.0, 1_999_998.0));
}

/// Whatever stands where the samples are, opening a file does not see it.
#[test]
fn samples_are_not_decoded_before_they_are_wanted() {
    // Of few columns it would be a list of points.
    let line = "1 2 3 5 ".repeat(10) + "\n";
    let words = line.repeat(500) + "4 five 6 7\n";
    let file = File::open(words.as_bytes()).expect("its last line is not looked at");
    let header = file.frames()[0].channels().next().expect("a matrix");
    assert_eq!((header.rows, header.columns), (501, 40));
    let error = file.frames()[0].read(0).expect_err("a word");
    assert!(error.to_string().contains("five"), "{error}");

    let test = "samples_are_not_decoded_before_they_are_wanted";
    let Some(data) = common::testdata(test) else {
        return;
    };
    for (path, mut bytes) in real(&data) {
        let name = path.display();
        if spmfile::detect(&bytes) != Format::Iso28632 {
            continue;
        }
        let end = bytes.windows(13).position(|w| w == b"end of header");
        let body = &mut bytes[end.expect("a header") + 16..];
        body.iter_mut()
            .filter(|b| b.is_ascii_digit())
            .for_each(|b| *b = b'x');
        let file = File::open(&bytes).expect("the header is whole");
        let error = file.frames()[0].read(0).expect_err("no number");
        assert!(error.to_string().contains("pixel 0"), "{name}: {error}");
    }
}

#[test]
fn truncated_files_are_named_both_ways() {
    let Some(data) = common::testdata("truncated_files_are_named_both_ways") else {
        return;
    };
    for (path, bytes) in real(&data) {
        let name = path.display();
        let flat = FLAT.contains(&spmfile::detect(&bytes));
        if !flat || spmfile::read(&bytes).is_err() {
            continue;
        }
        for length in [bytes.len() - 1, bytes.len() / 2, 2000, 300, 40] {
            let cut = &bytes[..length.min(bytes.len() - 1)];
            let read = spmfile::read(cut).expect_err("cut off").to_string();
            let open = File::open(cut).expect_err("cut off").to_string();
            assert_eq!(open, read, "{name}");
            let source = File::open_source(Arc::new(cut), &OpenOptions::default());
            assert_eq!(source.expect_err("cut off").to_string(), read, "{name}");
        }
        // What lies within it can be had all the same.
        let cut = &bytes[..bytes.len() - 1];
        if let Ok(file) = File::open_with(cut, &damaged_too()) {
            let frame = &file.frames()[0];
            assert!(frame.damage().is_some(), "{name}");
            assert!(matches!(
                frame.scan(&|_| true),
                Err(ReadError::Incomplete { .. })
            ));
            for number in 0..frame.channels().len() {
                assert!(frame.read(number).is_ok(), "{name}");
            }
        }
    }
}

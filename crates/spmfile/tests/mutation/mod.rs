//! Real files, damaged in place and put right again.

use std::ops::Range;
use std::path::{Path, PathBuf};

use spmfile::{ChannelInfo, ReadError, Scan, read_selected};

/// Bytes that hold most headers.
const HEADER: usize = 16 << 10;
/// Longer text files are cut: all of their bytes are looked at each time.
const LONGEST_TEXT: usize = 48 << 10;

/// Numbers that headers do not expect, in 1, 2, 4 and 8 bytes of either order.
const ODD: [u64; 12] = [
    0,
    1,
    0x7f,
    0xff,
    0x7fff,
    0xffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x7fef_ffff_ffff_ffff,
    0x7ff0_0000_0000_0000,
    u64::MAX,
];

/// A sequence of numbers from a seed (`SplitMix64` of Steele, Lea and Flood, 2014).
pub(crate) struct Dice(pub(crate) u64);

impl Dice {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number below `end`; 0 if there is none.
    fn below(&mut self, end: usize) -> usize {
        (self.next() % end.max(1) as u64) as usize
    }
}

/// A real file and where its header is.
pub(crate) struct Sample {
    pub(crate) name: String,
    pub(crate) bytes: Vec<u8>,
    /// Parts that tell the reader something.
    hot: Vec<Range<usize>>,
}

/// Every real file and every one that was reported, in order of name.
pub(crate) fn samples(data: &Path) -> Vec<Sample> {
    let mut folders = entries(&data.join("real"));
    folders.push(data.join("reports"));
    let files = folders
        .iter()
        .filter(|p| p.is_dir())
        .flat_map(|f| entries(f));
    let made = [
        "jpk/hdf5/film.h5-jpk",
        "gxsm/scan.nc",
        "array/nexus/scan.nxs",
        "array/nexus/array.h5",
    ];
    let made = made.map(|name| Path::new(env!("CARGO_MANIFEST_DIR")).join("src").join(name));
    let read = files
        .chain(made)
        .filter(|path| path.extension().is_none_or(|e| e != "json" && e != "md"))
        .filter(|path| path.is_file())
        .map(|path| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let mut bytes = super::common::bytes(&path);
            if is_text(&bytes) {
                bytes.truncate(LONGEST_TEXT);
            }
            (name.into_owned(), bytes)
        });
    read.chain([("grid.3ds".to_owned(), grid())])
        .map(|(name, bytes)| Sample {
            name,
            hot: hot(&bytes),
            bytes,
        })
        .collect()
}

/// A grid of 4 × 3 spectra of 8 points, of which no real file is at hand.
fn grid() -> Vec<u8> {
    let header = "Grid dim=\"4 x 3\"\r\nGrid settings=1.0E-7;-2.0E-8;4.0E-8;3.0E-8;3.0E+1\r\nFiletype=Linear\r\n\
        Sweep Signal=\"Bias (V)\"\r\nFixed parameters=\"Sweep Start;Sweep End\"\r\nExperiment parameters=\"X (m);Y (m);Z (m)\"\r\n\
        # Parameters (4 byte)=5\r\nExperiment size (bytes)=64\r\nPoints=8\r\nChannels=\"Current (A);LI Demod 1 X (V)\"\r\n\
        Start time=\"24.10.2021 20:44:06\"\r\n:HEADER_END:\r\n";
    let place = |n: usize| {
        [
            1e-8 * (n % 4) as f32,
            1e-8 * (n / 4) as f32,
            1e-10 * n as f32,
        ]
    };
    let point = |n: usize| {
        [-0.5, 0.5]
            .into_iter()
            .chain(place(n))
            .chain((0..16).map(|k| k as f32))
    };
    let numbers = (0..12).flat_map(point).flat_map(f32::to_be_bytes);
    header.bytes().chain(numbers).collect()
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let mut paths: Vec<_> = std::fs::read_dir(folder)
        .expect("a folder")
        .map(|entry| entry.expect("an entry").path())
        .collect();
    paths.sort();
    paths
}

fn is_text(bytes: &[u8]) -> bool {
    bytes
        .iter()
        .all(|b| b.is_ascii_graphic() || b.is_ascii_whitespace())
}

/// The start of a file, its end, and the directories of a TIFF file.
fn hot(bytes: &[u8]) -> Vec<Range<usize>> {
    let end = bytes.len();
    let mut hot = vec![0..end.min(HEADER), end.saturating_sub(256)..end];
    let big = bytes.starts_with(b"MM");
    if !big && !bytes.starts_with(b"II*") {
        return hot;
    }
    let number = |at: usize, width: usize| {
        let bytes = &bytes[at..at + width];
        let shift = |sum: usize, &b: &u8| sum << 8 | usize::from(b);
        if big {
            bytes.iter().fold(0, shift)
        } else {
            bytes.iter().rev().fold(0, shift)
        }
    };
    let mut place = number(4, 4);
    while place != 0 {
        let length = 2 + 12 * number(place, 2) + 4;
        hot.push(place..place + length);
        place = number(place + length - 4, 4);
    }
    hot
}

impl Sample {
    /// Damages the file, hands it to `read`, and puts it right.
    pub(crate) fn damaged(&mut self, dice: &mut Dice, read: impl FnOnce(&[u8])) {
        let mut undo: Vec<(usize, u8)> = Vec::new();
        let mut end = self.bytes.len();
        if dice.below(8) == 0 {
            end = self.place(dice);
        } else {
            for _ in 0..=dice.below(3) {
                self.damage(dice, &mut undo);
            }
        }
        read(&self.bytes[..end]);
        for (at, byte) in undo.into_iter().rev() {
            self.bytes[at] = byte;
        }
    }

    fn place(&self, dice: &mut Dice) -> usize {
        if dice.below(5) == 0 {
            return dice.below(self.bytes.len());
        }
        let range = &self.hot[dice.below(self.hot.len())];
        range.start + dice.below(range.len())
    }

    fn damage(&mut self, dice: &mut Dice, undo: &mut Vec<(usize, u8)>) {
        let at = self.place(dice);
        let left = self.bytes.len() - at;
        let mut put = |bytes: &mut [u8], at: usize, new: u8| {
            undo.push((at, bytes[at]));
            bytes[at] = new;
        };
        match dice.below(6) {
            0 | 1 => {
                let flipped = self.bytes[at] ^ 1 << dice.below(8);
                put(&mut self.bytes, at, flipped);
            }
            2 => {
                let width = (1 << dice.below(4)).min(left);
                let number = ODD[dice.below(ODD.len())];
                let big = dice.below(2) == 0;
                for i in 0..width {
                    let shift = 8 * if big { width - 1 - i } else { i };
                    put(&mut self.bytes, at + i, (number >> shift) as u8);
                }
            }
            // The next number in a text becomes a large one, or none.
            3 | 4 => {
                let new = b"9990-.eEnN%"[dice.below(11)];
                let digits = self.bytes[at..]
                    .iter()
                    .take(64)
                    .position(u8::is_ascii_digit)
                    .map_or(0..0, |start| {
                        let digits = self.bytes[at + start..].iter();
                        let length = digits.take_while(|b| b.is_ascii_digit()).count();
                        start..start + length.min(24)
                    });
                for i in digits {
                    put(&mut self.bytes, at + i, new);
                }
            }
            // A piece of the file in another place.
            _ => {
                let from = self.place(dice);
                let length = dice.below(24).min(left).min(self.bytes.len() - from);
                for i in 0..length {
                    let byte = self.bytes[from + i];
                    put(&mut self.bytes, at + i, byte);
                }
            }
        }
    }
}

/// Reads, and checks that what comes out can be true.
pub(crate) fn survive(bytes: &[u8], wanted: &dyn Fn(&ChannelInfo) -> bool) {
    let scan = match read_selected(bytes, wanted) {
        Ok(scan) => scan,
        Err(ReadError::Incomplete { readable, .. }) => *readable,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            return;
        }
    };
    plausible(&scan);
}

fn plausible(scan: &Scan) {
    let finite = |numbers: &[f64]| numbers.iter().all(|n| n.is_finite());
    let length = |n: &f64| *n > 0.0 && n.is_finite();
    assert!(finite(&scan.offset_nm), "offset {:?}", scan.offset_nm);
    assert!(scan.rotation_rad.is_finite(), "rotation");
    assert!(
        scan.size_nm.is_none_or(|size| size.iter().all(length)),
        "{:?}",
        scan.size_nm
    );
    assert!(
        scan.line_rate_hz.is_none_or(|r| length(&r)),
        "{:?}",
        scan.line_rate_hz
    );
    let time = |n: &f64| *n >= 0.0 && n.is_finite();
    assert!(
        scan.line_times_s.is_none_or(|t| t.iter().all(time)),
        "{:?}",
        scan.line_times_s
    );
    for channel in &scan.channels {
        assert_eq!(channel.samples.len(), channel.rows * channel.columns);
        assert!(
            finite(&[channel.scale, channel.offset]),
            "{}",
            channel.scaling
        );
        assert!(
            channel.width_nm.is_none_or(|n| length(&n)),
            "{:?}",
            channel.width_nm
        );
        assert!(
            channel.height_nm.is_none_or(|n| length(&n)),
            "{:?}",
            channel.height_nm
        );
    }
}

//! Lines of an image, from a scan in memory or straight from an uncompressed `.npy` file.

use std::io::{Read as _, Seek as _, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use moiregauge::frame::Image;
use spmfile::{Block, Channel};

/// Where lines come from.
pub(super) enum Source {
    /// A channel in memory.
    Memory(Channel),
    /// An array in C order on disk.
    Array(Array),
}

/// A `.npy` file, top line first.
pub(super) struct Array {
    path: PathBuf,
    header: String,
    /// Where `header` has the shape.
    shape: Range<usize>,
    /// First byte of the samples.
    start: u64,
    /// Rows and columns.
    pub(super) size: [usize; 2],
    line: usize,
    /// The part of it that is the image, if not all.
    block: Option<Block>,
}

impl Source {
    /// Reads a block of columns and rows, the bottom line being row 0.
    pub(super) fn block(&self, [columns, rows]: [Range<usize>; 2]) -> Result<Image, String> {
        let (width, count) = (self.width(), rows.len());
        let (values, columns) = match self {
            Self::Memory(channel) => (channel.lines(rows), columns),
            Self::Array(array) => {
                let [columns, rows] = array.of_whole([columns, rows]);
                let values = array.lines(rows).map_err(|e| format!("{e:#}"))?;
                (values, columns)
            }
        };
        if values.len() != width * count {
            return Err("the file ends before them".to_owned());
        }
        let image = Image::new(count, width, values);
        if columns.len() == width {
            return Ok(image);
        }
        Ok(image.cropped([columns.start, 0], [columns.len(), count]))
    }

    /// Samples of a line as they are stored.
    fn width(&self) -> usize {
        match self {
            Self::Memory(channel) => channel.columns,
            Self::Array(array) => array.size[1],
        }
    }
}

impl Array {
    /// Opens a file if it is such an array; `None` for anything else.
    pub(super) fn open(path: &Path) -> Option<Self> {
        let mut file = moiregauge_pipeline::open(path).ok()?;
        let mut first = [0; 10];
        file.read_exact(&mut first).ok()?;
        // Versions 2 and 3 are for headers longer than an image needs.
        if &first[..6] != b"\x93NUMPY" || first[6] != 1 {
            return None;
        }
        let length = usize::from(u16::from_le_bytes([first[8], first[9]]));
        let mut header = vec![0; length];
        file.read_exact(&mut header).ok()?;
        let header = String::from_utf8(header).ok()?;
        if !header.contains("'fortran_order': False") {
            return None;
        }
        let open = header.find("'shape': (")? + "'shape': (".len();
        let close = open + header[open..].find(')')?;
        let numbers: Option<Vec<usize>> = header[open..close]
            .split(',')
            .map(|n| n.trim().parse().ok())
            .collect();
        let [rows, columns] = numbers?[..] else {
            return None;
        };
        let bytes = file
            .metadata()
            .ok()?
            .len()
            .checked_sub(10 + length as u64)?;
        let line = usize::try_from(bytes).ok()?.checked_div(rows)?;
        Some(Self {
            path: path.to_owned(),
            shape: open..close,
            header,
            start: 10 + length as u64,
            size: [rows, columns],
            line,
            block: None,
        })
    }

    /// The same with a part of it as the image.
    pub(super) fn with_block(self, block: Option<Block>) -> Self {
        Self { block, ..self }
    }

    /// Columns and rows of the image as those of the array.
    fn of_whole(&self, [columns, rows]: [Range<usize>; 2]) -> [Range<usize>; 2] {
        let first = self.block.map_or([0, 0], |b| [b.column, b.row]);
        let moved = |range: Range<usize>, by: usize| range.start + by..range.end + by;
        [moved(columns, first[0]), moved(rows, first[1])]
    }

    /// The file as if it had only these lines, counted from the bottom.
    pub(super) fn part(&self, rows: &Range<usize>) -> anyhow::Result<Vec<u8>> {
        ensure!(
            rows.end <= self.size[0],
            "the array has {} lines",
            self.size[0]
        );
        let mut file = moiregauge_pipeline::open(&self.path)?;
        let top = self.size[0] - rows.end;
        file.seek(SeekFrom::Start(self.start + (top * self.line) as u64))?;
        let mut header = self.header.clone();
        let shape = format!("{}, {}", rows.len(), self.size[1]);
        header.replace_range(self.shape.clone(), &shape);
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend(u16::try_from(header.len())?.to_le_bytes());
        bytes.extend(header.as_bytes());
        let before = bytes.len();
        bytes.resize(before + rows.len() * self.line, 0);
        file.read_exact(&mut bytes[before..])
            .context("the file ends before its last line")?;
        Ok(bytes)
    }

    fn lines(&self, rows: Range<usize>) -> anyhow::Result<Vec<f64>> {
        let scan = spmfile::read(&self.part(&rows)?)?;
        let channel = scan.channels.first().context("the array holds no image")?;
        Ok(channel.values())
    }
}

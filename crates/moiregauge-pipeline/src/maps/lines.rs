//! Lines of an image, from a scan in memory or straight from its file.

use std::ops::Range;
use std::path::Path;

use moiregauge::frame::Image;
use moiregauge::scan::choose_channel;
use spmfile::{Block, Channel, File, OpenOptions, ReadError, Scan};

use crate::known::Known;

/// Where lines come from.
pub(super) enum Pixels {
    /// A channel in memory.
    Memory(Channel),
    /// A channel on disk.
    Lines(Lines),
}

/// A channel of a file that is read line by line.
pub(super) struct Lines {
    file: File<'static>,
    channel: usize,
    /// The names of all channels: the user's and the instrument's own.
    pub(super) names: Vec<(String, String)>,
    /// Rows and columns.
    pub(super) size: [usize; 2],
    /// The part of it that is the image, if not all.
    block: Option<Block>,
}

impl Pixels {
    /// Reads a block of columns and rows, the bottom line being row 0.
    pub(super) fn block(&self, [columns, rows]: [Range<usize>; 2]) -> Result<Image, String> {
        let (width, count) = (self.width(), rows.len());
        let (values, columns) = match self {
            Self::Memory(channel) => (channel.lines(rows), columns),
            Self::Lines(lines) => {
                let [columns, rows] = lines.of_whole([columns, rows]);
                let values = lines.read(rows).map_err(|e| e.to_string())?;
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
            Self::Lines(lines) => lines.size[1],
        }
    }
}

impl Lines {
    /// Opens the chosen channel of a file, of which no line is read here; `None` where the file has to be read as a
    /// whole, if only to say what is wrong with it.
    pub(super) fn open(path: &Path, known: &Known, wanted: Option<&str>) -> Option<Self> {
        let source = known.source(path).pieces().ok()?;
        let mut options = OpenOptions::default();
        options.array = known.array_options(path);
        let file = File::open_source(source, &options).ok()?;
        let frame = file.frames().first()?;
        let infos = || frame.channels().map(|c| &c.info);
        let names: Vec<(String, String)> = infos()
            .filter(|info| !known.names_sensor(&info.name, &info.internal_name))
            .map(|info| (info.name.clone(), info.internal_name.clone()))
            .collect();
        let both: Vec<(&str, &str)> = names.iter().map(|(a, b)| (&**a, &**b)).collect();
        let channel = if file.format().is_array() {
            0
        } else {
            let chosen = choose_channel(&both, wanted)?;
            infos().position(|info| info.name == *chosen)?
        };
        let header = frame.channels().nth(channel)?;
        Some(Self {
            size: [header.rows, header.columns],
            channel,
            names,
            block: None,
            file,
        })
    }

    /// The same with a part of it as the image.
    pub(super) fn with_block(self, block: Option<Block>) -> Self {
        Self { block, ..self }
    }

    /// The scan without a sample.
    pub(super) fn scan(&self) -> Result<Scan, ReadError> {
        self.file.frames()[0].without_samples(self.channel)
    }

    /// Columns and rows of the image as those of the channel.
    fn of_whole(&self, [columns, rows]: [Range<usize>; 2]) -> [Range<usize>; 2] {
        let first = self.block.map_or([0, 0], |b| [b.column, b.row]);
        let moved = |range: Range<usize>, by: usize| range.start + by..range.end + by;
        [moved(columns, first[0]), moved(rows, first[1])]
    }

    fn read(&self, rows: Range<usize>) -> Result<Vec<f64>, ReadError> {
        self.file.frames()[0].rows(self.channel, rows)
    }
}

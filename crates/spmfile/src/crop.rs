//! A part of a frame as a scan of its own: every pixel keeps its place, its value and its time.

use crate::clock;
use crate::scan::{Channel, FrameDirection, Samples, Scan, Span};

/// A block of pixels: the bottom left one and the numbers of columns and rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    /// Its first column, counted from the left.
    pub column: usize,
    /// Its first row, counted from the bottom.
    pub row: usize,
    /// Number of columns.
    pub columns: usize,
    /// Number of rows.
    pub rows: usize,
}

/// Why a scan cannot be cropped.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CropError {
    /// The channels differ in shape.
    #[error("channel {name:?} has {rows} lines of {columns} samples, unlike the first channel")]
    Unlike {
        /// The channel.
        name: String,
        /// Its lines.
        rows: usize,
        /// Samples in a line.
        columns: usize,
    },
    /// The block is empty or reaches beyond the frame.
    #[error(
        "expected a block within {rows} lines of {columns} samples, found {} lines of {} from line {} and sample {} on",
        .block.rows, .block.columns, .block.row, .block.column
    )]
    Outside {
        /// What was asked for.
        block: Block,
        /// Lines of the frame.
        rows: usize,
        /// Samples in a line.
        columns: usize,
    },
}

/// Cuts a block out of every channel of a scan.
///
/// Sizes, the centre of the frame, the times of its lines and the time of its end become those of
/// the block, so that pixels keep their positions and times; the latter to whole seconds, as the
/// date of a scan has them.
///
/// # Errors
/// - Channels of different shapes: the same pixels would be different places.
/// - The block does not lie within the frame.
pub fn crop(scan: &mut Scan, block: Block) -> Result<(), CropError> {
    let Some(first) = scan.channels.first() else {
        return Ok(());
    };
    let (rows, columns, pitch) = (first.rows, first.columns, first.pitch_nm());
    if let Some(odd) = scan
        .channels
        .iter()
        .find(|c| (c.rows, c.columns) != (rows, columns))
    {
        return Err(CropError::Unlike {
            name: odd.name.clone(),
            rows: odd.rows,
            columns: odd.columns,
        });
    }
    let within = |start: usize, count: usize, all: usize| {
        count > 0 && start.checked_add(count).is_some_and(|end| end <= all)
    };
    if !within(block.column, block.columns, columns) || !within(block.row, block.rows, rows) {
        return Err(CropError::Outside {
            block,
            rows,
            columns,
        });
    }
    if let Some([fast, slow]) = pitch {
        let middle = |start: usize, count: usize, all: usize| {
            start as f64 + 0.5 * count as f64 - 0.5 * all as f64
        };
        let x = fast * middle(block.column, block.columns, columns);
        let y = slow * middle(block.row, block.rows, rows);
        let (s, c) = scan.rotation_rad.sin_cos();
        scan.offset_nm[0] += c * x - s * y;
        scan.offset_nm[1] += s * x + c * y;
    }
    times(scan, block, rows, columns);
    for channel in &mut scan.channels {
        let pitch = channel.pitch_nm();
        channel.samples = samples(&channel.samples, columns, block);
        (channel.rows, channel.columns) = (block.rows, block.columns);
        resize(channel, pitch);
    }
    let first = &scan.channels[0];
    scan.size_nm = first
        .width_nm
        .zip(first.height_nm)
        .map(|(width, height)| [width, height]);
    Ok(())
}

/// Gives a channel the size that belongs to its pitch.
fn resize(channel: &mut Channel, pitch: Option<[f64; 2]>) {
    let size =
        pitch.map(|[fast, slow]| [fast * channel.columns as f64, slow * channel.rows as f64]);
    channel.span = Span::PixelEdges;
    channel.width_nm = size.map(|[width, _]| width);
    channel.height_nm = size.map(|[_, height]| height);
}

/// Times of the lines within the block and of its last pixel.
fn times(scan: &mut Scan, block: Block, rows: usize, columns: usize) {
    let whole = scan.line_times_s.or_else(|| {
        let half = 0.5 / scan.line_rate_hz? / (1.0 + scan.rounding.unwrap_or(0.0));
        Some([half, half])
    });
    let Some([trace, retrace]) = whole else {
        return;
    };
    // Lines follow each other as before, however short they are now.
    let rate = scan.line_rate_hz.unwrap_or(1.0 / (trace + retrace));
    scan.line_rate_hz = Some(rate);
    if columns > 1 {
        let share = (block.columns - 1) as f64 / (columns - 1) as f64;
        scan.line_times_s = Some([trace * share, retrace * share]);
    }
    let after = match scan.frame_direction {
        Some(FrameDirection::Up) => rows - block.row - block.rows,
        Some(FrameDirection::Down) => block.row,
        None => 0,
    };
    let later = -(after as f64) / rate;
    scan.acquired = scan.acquired.map(|end| clock::later(end, later));
}

fn samples(all: &Samples, columns: usize, block: Block) -> Samples {
    fn cut<T: Copy>(all: &[T], columns: usize, block: Block) -> Vec<T> {
        all.chunks_exact(columns)
            .skip(block.row)
            .take(block.rows)
            .flat_map(|line| &line[block.column..block.column + block.columns])
            .copied()
            .collect()
    }
    match all {
        Samples::I16(v) => Samples::I16(cut(v, columns, block)),
        Samples::I32(v) => Samples::I32(cut(v, columns, block)),
        Samples::F32(v) => Samples::F32(cut(v, columns, block)),
        Samples::F64(v) => Samples::F64(cut(v, columns, block)),
    }
}

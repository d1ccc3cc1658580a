//! The samples of a Createc scan: unpacked, and without the lines that were not recorded.

use std::borrow::Cow;
use std::sync::OnceLock;

use super::damaged;
use crate::cursor::Endian;
use crate::raster::{self, Encoding, Order};
use crate::scan::Samples;
use crate::stored::Failure;

/// The images of a file, of which the compressed ones are unpacked once.
pub(super) struct Images<'a> {
    /// All bytes behind the header.
    pub(super) bytes: &'a [u8],
    pub(super) compressed: bool,
    pub(super) encoding: Encoding,
    pub(super) channels: usize,
    pub(super) rows: usize,
    pub(super) columns: usize,
    /// Bytes of a channel.
    pub(super) length: usize,
    pub(super) unpacked: OnceLock<Result<Found<'a>, String>>,
}

/// The images and how many lines were recorded before the scan was stopped.
pub(super) struct Found<'a> {
    images: Cow<'a, [u8]>,
    lines: usize,
}

impl<'a> Images<'a> {
    fn found(&self) -> Result<Found<'a>, String> {
        let images = if self.compressed {
            let images = self.channels * self.length;
            Cow::Owned(unpack(
                self.bytes,
                self.encoding.width(),
                images,
                self.columns,
            )?)
        } else {
            Cow::Borrowed(self.bytes.get(self.encoding.width()..).unwrap_or(&[]))
        };
        // Lines that were not recorded are zero in all channels.
        let line = self.length / self.rows;
        let whole = images.chunks_exact(self.length).take(self.channels);
        let last = whole.filter_map(|image| image.iter().rposition(|&byte| byte != 0));
        let lines = last.max().map_or(0, |last| last / line + 1);
        Ok(Found { images, lines })
    }

    /// The samples of a channel, missing ones as NaN.
    pub(super) fn channel(&self, index: usize) -> Result<Samples, Failure> {
        let found = self.unpacked.get_or_init(|| self.found()).as_ref();
        let found = found.map_err(|error| Failure::File(damaged(error)))?;
        let start = index * self.length;
        let image = found
            .images
            .get(start..start + self.length)
            .ok_or_else(|| {
                let whole = found.images.len().saturating_sub(start) / (self.length / self.rows);
                Failure::Lost(format!("{whole} of its {} lines are there", self.rows))
            })?;
        let order = Order {
            top_first: true,
            mirrored: false,
        };
        let samples = raster::decode(image, self.columns, self.encoding, Endian::Little, order);
        let missing = (self.rows - found.lines) * self.columns;
        Ok(match samples {
            samples if missing == 0 => samples,
            Samples::F32(mut samples) => {
                leave_out(&mut samples, missing, self.columns, f32::NAN);
                Samples::F32(samples)
            }
            samples => {
                let mut samples = samples.into_doubles();
                leave_out(&mut samples, missing, self.columns, f64::NAN);
                Samples::F64(samples)
            }
        })
    }
}

/// Marks the first samples as missing, and of the line behind them, in which the scan was stopped, zeros at its ends.
fn leave_out<T: Copy + Default + PartialEq>(
    samples: &mut [T],
    missing: usize,
    columns: usize,
    nan: T,
) {
    let (blank, recorded) = samples.split_at_mut(missing);
    blank.fill(nan);
    let zero = |sample: &&mut T| **sample == T::default();
    let stopped = recorded.iter_mut().take(columns);
    stopped.take_while(zero).for_each(|sample| *sample = nan);
    let stopped = recorded.iter_mut().take(columns).rev();
    stopped.take_while(zero).for_each(|sample| *sample = nan);
}

/// The images of a zlib stream, as far as they are there, without the `skipped` bytes before them.
///
/// It is unpacked twice, first to see how long it is: a header that promises more takes no memory.
#[cfg(feature = "archives")]
fn unpack(bytes: &[u8], skipped: usize, images: usize, columns: usize) -> Result<Vec<u8>, String> {
    use std::io::{ErrorKind, Read, copy, sink};

    let [skipped, images] = [skipped, images].map(|n| n as u64);
    let wrong = |error: std::io::Error| format!("its zlib stream: {error}");
    let mut stream = flate2::read::ZlibDecoder::new(bytes);
    // The sum of all bytes comes behind the buffers of some lines.
    let buffers = 8 * skipped * columns as u64 + 4096;
    let all = stream.by_ref().take(skipped + images + buffers);
    match copy(&mut { all }, &mut sink()) {
        // Cut off: what is there is true.
        Err(error) if error.kind() != ErrorKind::UnexpectedEof => return Err(wrong(error)),
        _ => {}
    }
    let found = stream.total_out().saturating_sub(skipped).min(images);
    let mut stream = flate2::read::ZlibDecoder::new(bytes);
    copy(&mut stream.by_ref().take(skipped), &mut sink()).map_err(wrong)?;
    let mut unpacked = Vec::with_capacity(found as usize);
    stream
        .take(found)
        .read_to_end(&mut unpacked)
        .map_err(wrong)?;
    Ok(unpacked)
}

#[cfg(not(feature = "archives"))]
fn unpack(_: &[u8], _: usize, _: usize, _: usize) -> Result<Vec<u8>, String> {
    Err("its zlib stream cannot be unpacked".to_owned())
}

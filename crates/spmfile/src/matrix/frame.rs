//! Which samples belong to which image: shape of the frames, places of the samples.

use super::data::Data;
use super::log::{Quantity, State, Transfer};
use crate::scan::{FrameDirection, LineDirection, Samples};

/// The most samples of an image whose missing ones are filled in, unless the file holds a good part
/// of them: a damaged header must not make a small file a large image.
const MOST_FILLED: usize = 1 << 24;

/// How samples follow each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shape {
    pub(super) points: usize,
    pub(super) lines: usize,
    /// Each line is recorded on the way back, too.
    pub(super) retrace: bool,
    /// The frame is recorded downwards, too.
    pub(super) downwards: bool,
}

/// A channel's quantity, its scale and the shape of its frames.
#[derive(Debug)]
pub(super) struct Understood<'a> {
    pub(super) shape: Shape,
    /// `None` where the log does not tell it without doubt.
    pub(super) transfer: Option<&'a Transfer>,
    pub(super) quantity: Option<&'a Quantity>,
}

impl Shape {
    /// The shape of which both parameters and axes of the channel may speak; the number of
    /// intended samples says which of them is right.
    fn of(state: &State, fast: Option<u64>, intended: u32) -> Result<Self, String> {
        let told = [Self::by_parameters(state), Self::by_axes(state, fast)];
        let mut fitting: Vec<Self> = told
            .into_iter()
            .flatten()
            .filter(|shape| shape.samples() == Some(intended as usize))
            .collect();
        fitting.dedup();
        match fitting[..] {
            [shape] => Ok(shape),
            [] => {
                let words = |shape: Option<Self>| shape.map_or("nothing".to_owned(), Self::words);
                Err(format!(
                    "expected frames of {intended} samples; the parameters say {}, the axes of the channel {}",
                    words(told[0]),
                    words(told[1])
                ))
            }
            _ => Err(format!(
                "the parameters say {}, the axes of the channel {}",
                fitting[0].words(),
                fitting[1].words()
            )),
        }
    }

    fn by_parameters(state: &State) -> Option<Self> {
        Some(Self {
            points: state.count(&["Points", "X_Points"])? as usize,
            lines: state.count(&["Lines", "Y_Points"])? as usize,
            retrace: state.switch("X_Retrace")?,
            downwards: state.switch("Y_Retrace")?,
        })
    }

    fn by_axes(state: &State, fast: Option<u64>) -> Option<Self> {
        let fast = fast?;
        let axis = state.axes.get(&fast)?;
        let slow = state.axes.get(&axis.slower)?;
        let one_way = |key: &u64, mirrored: bool| {
            let length = *state.lengths.get(key)? as usize;
            if mirrored {
                length.is_multiple_of(2).then_some(length / 2)
            } else {
                Some(length)
            }
        };
        Some(Self {
            points: one_way(&fast, axis.mirrored)?,
            lines: one_way(&axis.slower, slow.mirrored)?,
            retrace: axis.mirrored,
            downwards: slow.mirrored,
        })
    }

    /// Samples of all images together; `None` if there are none or too many.
    fn samples(self) -> Option<usize> {
        let frame = self.line().checked_mul(self.lines)?;
        frame.checked_mul(self.frames()).filter(|&n| n > 0)
    }

    pub(super) fn frames(self) -> usize {
        1 + usize::from(self.downwards)
    }

    /// Samples of a line, both ways.
    fn line(self) -> usize {
        self.points.saturating_mul(1 + usize::from(self.retrace))
    }

    fn words(self) -> String {
        format!(
            "{} lines of {} points{}{}",
            self.lines,
            self.points,
            if self.retrace { ", back too" } else { "" },
            if self.downwards { ", down too" } else { "" }
        )
    }

    /// How many of `recorded` samples are those of a frame.
    pub(super) fn recorded(self, frame: FrameDirection, recorded: usize) -> usize {
        let all = self.line() * self.lines;
        match frame {
            FrameDirection::Up => recorded.min(all),
            FrameDirection::Down => recorded.saturating_sub(all),
        }
    }

    /// The image of a frame in a direction of the line; `None` if none of its samples is recorded.
    ///
    /// # Errors
    /// If it would fill a large image with a few samples.
    pub(super) fn image(
        self,
        counts: &[u8],
        frame: FrameDirection,
        line: LineDirection,
    ) -> Result<Option<Samples>, String> {
        let (counts, _) = counts.as_chunks::<4>();
        let frame_length = self.line() * self.lines;
        let counts = match frame {
            FrameDirection::Up => &counts[..counts.len().min(frame_length)],
            FrameDirection::Down => counts.get(frame_length..).unwrap_or_default(),
        };
        let back = line == LineDirection::Retrace;
        let start = if back { self.points } else { 0 };
        let lines = || {
            counts.chunks(self.line()).enumerate().map(|(n, line)| {
                let end = (start + self.points).min(line.len());
                let row = match frame {
                    FrameDirection::Up => n,
                    FrameDirection::Down => self.lines - 1 - n,
                };
                (row, line.get(start..end).unwrap_or_default())
            })
        };
        let size = self.points * self.lines;
        let found: usize = lines().map(|(_, line)| line.len()).sum();
        if found == 0 {
            return Ok(None);
        }
        let place =
            |row: usize, n: usize| row * self.points + if back { self.points - 1 - n } else { n };
        if found == size {
            let mut image = vec![0; size];
            for (row, line) in lines() {
                for (n, &count) in line.iter().enumerate() {
                    image[place(row, n)] = i32::from_le_bytes(count);
                }
            }
            return Ok(Some(Samples::I32(image)));
        }
        if size > MOST_FILLED && size / 16 > found {
            return Err(format!(
                "{found} samples of an image of {} lines of {}",
                self.lines, self.points
            ));
        }
        let mut image = vec![f64::NAN; size];
        for (row, line) in lines() {
            for (n, &count) in line.iter().enumerate() {
                image[place(row, n)] = f64::from(i32::from_le_bytes(count));
            }
        }
        Ok(Some(Samples::F64(image)))
    }
}

/// Finds the entries of the log for the channel `name`.
pub(super) fn understand<'a>(
    state: &'a State,
    data: &Data<'_>,
    name: &str,
) -> Result<Understood<'a>, String> {
    let of_name = || state.quantities.iter().filter(|(_, q)| q.name == name);
    // By the key of the channel, or else by a name that only one quantity has.
    let own = state.channels.get(&data.channel);
    let own = of_name().find(|(key, _)| Some(*key) == own);
    let mut alike = of_name();
    let only = alike.next().filter(|_| alike.next().is_none());
    let found = own.or(only);
    if let Some((_, quantity)) = found
        && let Some(axis) = state.axes.get(&quantity.axis)
        && !axis.name.ends_with("XYScanner::X")
    {
        return Err(format!(
            "it is recorded along {:?}: a curve, not an image",
            axis.name
        ));
    }
    let fast = found.map(|(_, quantity)| quantity.axis);
    Ok(Understood {
        shape: Shape::of(state, fast, data.intended)?,
        transfer: found.and_then(|(key, _)| state.transfers.get(key)),
        quantity: found.map(|(_, quantity)| quantity),
    })
}

impl Transfer {
    /// Scale and offset of `value = count · scale + offset`.
    pub(super) fn line(&self) -> Option<(f64, f64)> {
        let number = |name: &str| {
            self.numbers
                .iter()
                .find(|(n, _)| n == name)
                .map(|(_, n)| *n)
        };
        let (scale, zero) = match self.kind.as_str() {
            "TFF_Identity" => (1.0, 0.0),
            "TFF_Linear1D" => (1.0 / number("Factor")?, number("Offset")?),
            "TFF_MultiLinear1D" => {
                let divisor = number("NeutralFactor")? * number("PreFactor")?;
                let factor = number("Raw_1")? - number("PreOffset")?;
                (factor / divisor, number("Offset")?)
            }
            _ => return None,
        };
        let offset = -zero * scale;
        (scale.is_finite() && scale != 0.0 && offset.is_finite()).then_some((scale, offset + 0.0))
    }
}

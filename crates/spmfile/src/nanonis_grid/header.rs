//! The header of a grid: keys, values, and the frame they tell.

use super::grid::Grid;
use super::{FORMAT, WITH_POSITIONS};
use crate::clock;
use crate::scan::{DateTime, FrameDirection, Scan, Span};
use crate::words::Unread;

/// Directions that differ by less are one, rad: a degree.
const MOST_OFF: f64 = 0.0175;

/// Keys and values, in the order of the file.
pub(super) struct Header {
    pub(super) fields: Vec<(String, String)>,
    pub(super) unread: Unread,
}

impl Header {
    /// A value in quotation marks may have several lines.
    pub(super) fn of(text: &str) -> Self {
        let mut fields: Vec<(String, String)> = Vec::new();
        let mut open = false;
        for line in text.lines() {
            match (fields.last_mut(), line.split_once('=')) {
                (Some((_, value)), _) if open => {
                    value.push('\n');
                    value.push_str(line);
                    open = !line.trim_end().ends_with('"');
                }
                (_, Some((key, value))) => {
                    let value = value.trim();
                    open = value.starts_with('"') && (value.len() == 1 || !value.ends_with('"'));
                    fields.push((key.trim().to_owned(), value.to_owned()));
                }
                _ => {}
            }
        }
        for (_, value) in &mut fields {
            let inside = value.strip_prefix('"').unwrap_or(value);
            *value = inside.strip_suffix('"').unwrap_or(inside).trim().to_owned();
        }
        Self {
            fields,
            unread: Unread::default(),
        }
    }

    /// The value of a key, which may have a unit behind it: `Experiment size (bytes)`.
    pub(super) fn get(&self, key: &str) -> Option<&str> {
        let like = |full: &str| {
            let (name, rest) = full.split_at_checked(key.len()).unwrap_or_default();
            name.eq_ignore_ascii_case(key) && (rest.is_empty() || rest.starts_with(" ("))
        };
        let (_, value) = self.fields.iter().find(|(full, _)| like(full))?;
        Some(value)
    }

    pub(super) fn list(&self, key: &str) -> Vec<String> {
        let parts = self.get(key).unwrap_or("").split(';').map(str::trim);
        parts
            .filter(|part| !part.is_empty())
            .map(str::to_owned)
            .collect()
    }

    /// Everything about the frame but its channels, and what its size spans.
    pub(super) fn frame(&self, grid: &mut Grid<'_>, notes: &mut Vec<String>) -> (Scan, Span) {
        let settings: Vec<&str> = self.get("Grid settings").unwrap_or("").split(';').collect();
        let told = |n: usize, what: &str| {
            self.unread
                .number(&format!("Grid settings ({what})"), settings.get(n).copied())
        };
        let offset = told(0, "centre x").zip(told(1, "centre y"));
        let size = told(2, "width").zip(told(3, "height"));
        let size_nm = size
            .filter(|&(w, h)| w > 0.0 && h > 0.0)
            .map(|(w, h)| [w * 1e9, h * 1e9]);
        let clockwise = told(4, "angle").unwrap_or(0.0).to_radians();
        let mut rotation_rad = if clockwise == 0.0 { 0.0 } else { -clockwise };
        let mut span = None;
        if let Some([fast, slow]) = grid.steps_nm() {
            grid.top_first = fast[0] * slow[1] - fast[1] * slow[0] < 0.0;
            let angle = fast[1].atan2(fast[0]);
            let off = |rotation: f64| {
                let (sin, cos) = (angle - rotation).sin_cos();
                sin.atan2(cos).abs()
            };
            let [as_told, other_way] = [off(-clockwise), off(clockwise)];
            if as_told.min(other_way) > MOST_OFF {
                notes.push(format!(
                    "the positions of its points are turned by {:.2}°, but its header says {:.2}° clockwise, which is taken",
                    angle.to_degrees(),
                    clockwise.to_degrees()
                ));
            } else if other_way < 0.5 * as_told {
                rotation_rad = clockwise;
            }
            span = size_nm.and_then(|size| grid.span(size, [fast, slow].map(|[x, y]| x.hypot(y))));
            if span.is_none() {
                notes.push("the positions of its points do not fit its size, which is taken to reach from edge to edge".to_owned());
            }
        }
        let direction = if grid.top_first {
            FrameDirection::Down
        } else {
            FrameDirection::Up
        };
        let scan = Scan {
            format: if span.is_some() {
                WITH_POSITIONS
            } else {
                FORMAT
            }
            .to_owned(),
            acquired: self.unread.entry("End time", self.get("End time"), date),
            frame_direction: Some(direction),
            rotation_rad,
            offset_nm: offset.map_or([0.0; 2], |(x, y)| [x * 1e9, y * 1e9]),
            size_nm,
            metadata: self.fields.clone(),
            ..Scan::default()
        };
        (scan, span.unwrap_or(Span::PixelEdges))
    }
}

/// `24.10.2021 20:44:06`, the day first.
fn date(text: &str) -> Option<DateTime> {
    let (date, time) = text.split_once(' ')?;
    let date: Option<Vec<i64>> = date
        .split('.')
        .map(|part| part.trim().parse().ok())
        .collect();
    let [day, month, year] = date?.try_into().ok()?;
    clock::date([year, month, day], clock::clock(time)?)
}

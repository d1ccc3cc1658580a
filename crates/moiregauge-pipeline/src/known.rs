//! Scans completed by what their files do not tell and the user knows.

use std::path::{Path, PathBuf};

use moiregauge::campaign::natural_order;
use moiregauge::scan::plain_name;
use moiregauge_report::results::{Crop, FrameOrder, UserSpecified};
use spmfile::arrays::ArrayOptions;
use spmfile::{
    Block, Channel, ChannelInfo, CropError, Format, FrameDirection, ReadError, Scan, Span, crop,
    sensor_axis,
};

use crate::content::Content;
use crate::in_memory::ScanInMemory;
use crate::session;
use crate::source::{Places, Source};
use crate::twice::distinct;

/// Why a file cannot be read as the user knows it.
#[derive(Debug, thiserror::Error)]
pub enum KnownError {
    /// The file itself.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A channel that is to be a position sensor is not there.
    #[error("no channel {wanted:?} for the {role}; there are {present}")]
    NoChannel {
        /// The name that was given.
        wanted: String,
        /// Which sensor.
        role: &'static str,
        /// The names that there are.
        present: String,
    },
    /// The file with the position sensors.
    #[error("{file}: {reason}")]
    Sensors {
        /// Its name.
        file: String,
        /// What was expected and what was found.
        reason: String,
    },
    /// The block reaches beyond the image.
    #[error("rows {first} to {last} from the top of an image of {rows}")]
    Rows {
        /// Its first row.
        first: usize,
        /// Its last row.
        last: usize,
        /// Rows of the image.
        rows: usize,
    },
    /// The block cannot be cut out.
    #[error(transparent)]
    Crop(#[from] CropError),
}

/// What the user tells, the order of the files for those that alternate, and where they lie.
#[derive(Clone, Debug, Default)]
pub struct Known {
    told: UserSpecified,
    order: Vec<PathBuf>,
    places: Places,
}

impl Known {
    /// What is told of these files.
    pub fn new(told: &UserSpecified, inputs: &[PathBuf]) -> Self {
        let (mut order, _) = distinct(inputs);
        order.sort_by(|a, b| natural_order(&a.to_string_lossy(), &b.to_string_lossy()));
        Self {
            told: told.clone(),
            order,
            places: Places::new(),
        }
    }

    /// The same, of files that lie elsewhere.
    #[must_use]
    pub fn at(mut self, places: &Places) -> Self {
        self.places.clone_from(places);
        self
    }

    /// What is told.
    pub fn user_specified(&self) -> &UserSpecified {
        &self.told
    }

    /// Where a file lies.
    pub fn place<'a>(&'a self, path: &'a Path) -> &'a Path {
        self.places.place(path)
    }

    /// A file, on the disk or in memory.
    pub fn source<'a>(&'a self, path: &'a Path) -> Source<'a> {
        self.places.source(path)
    }

    /// The scan of this name, if it is in memory and no file.
    pub fn in_memory(&self, path: &Path) -> Option<&ScanInMemory> {
        self.places.scan(path)
    }

    /// The parts of the log beside a file, by their names.
    pub(crate) fn logs(&self, path: &Path) -> Vec<PathBuf> {
        let logs = self.places.named(path).logs();
        logs.iter().map(|log| log.path().to_owned()).collect()
    }

    /// Reads the wanted channels of a file and its position sensors, completed by what is known.
    ///
    /// The second part says in words what was told in place of what the file tells.
    ///
    /// # Errors
    /// The file or that of the sensors cannot be read, or does not hold what was told.
    pub fn read(
        &self,
        path: &Path,
        content: &Content,
        wanted: &dyn Fn(&ChannelInfo) -> bool,
    ) -> Result<(Scan, Vec<String>), KnownError> {
        let mut scan = self.decode(path, content, wanted)?;
        let replaced = self.complete(path, &mut scan)?;
        Ok((scan, replaced))
    }

    /// Reads the wanted channels and those named as sensors.
    ///
    /// # Errors
    /// The bytes are no scan, or a damaged one.
    pub fn decode(
        &self,
        path: &Path,
        content: &Content,
        wanted: &dyn Fn(&ChannelInfo) -> bool,
    ) -> Result<Scan, ReadError> {
        let wanted =
            |info: &ChannelInfo| wanted(info) || self.names_sensor(&info.name, &info.internal_name);
        let bytes = content.bytes();
        match content.format() {
            array if array.is_array() => {
                let options = self.array_options(path);
                let mut scan = spmfile::arrays::read_as(array, bytes, &options, &wanted)?;
                self.tell_sensor_unit(&mut scan);
                Ok(scan)
            }
            Format::OmicronMatrix => {
                let direction = self.frame_direction(path);
                session::read(&self.source(path), bytes, direction, &wanted)
            }
            other => spmfile::read_as(other, bytes, &wanted),
        }
    }

    /// Whether the user calls the channel of these names a position sensor.
    pub fn names_sensor(&self, name: &str, internal_name: &str) -> bool {
        let both = [&self.told.x_sensor, &self.told.y_sensor];
        both.into_iter()
            .flatten()
            .any(|wanted| is_named(name, wanted) || is_named(internal_name, wanted))
    }

    /// Arrays that only the user calls position sensors were read as images: the unit that is told of sensors is theirs.
    fn tell_sensor_unit(&self, scan: &mut Scan) {
        let Some(unit) = &self.told.sensor_unit else {
            return;
        };
        for channel in &mut scan.channels {
            if self.names_sensor(&channel.name, &channel.internal_name) {
                channel.unit.clone_from(unit);
            }
        }
    }

    /// What the user tells of an array.
    pub fn array_options(&self, path: &Path) -> ArrayOptions {
        ArrayOptions {
            size_nm: self.told.size_nm,
            frame_direction: self.frame_direction(path),
            line_rate_hz: self.told.line_rate_hz,
            rotation_rad: self.told.rotation_deg.map(f64::to_radians),
            unit: self.told.unit.clone(),
            sensor_unit: self.told.sensor_unit.clone(),
            ..ArrayOptions::default()
        }
    }

    /// The sense of the slow motion that is told of a file.
    pub fn frame_direction(&self, path: &Path) -> Option<FrameDirection> {
        let Some(told) = self.told.frame_direction else {
            return session::is_second_frame(path).then_some(FrameDirection::Down);
        };
        let mut files = self.order.iter().filter(|p| !session::is_second_frame(p));
        let number = files.position(|p| p == path).unwrap_or(0);
        let up = match told {
            FrameOrder::Up => true,
            FrameOrder::Down => false,
            FrameOrder::AlternatingUp => number % 2 == 0,
            FrameOrder::AlternatingDown => number % 2 == 1,
        };
        Some(if up {
            FrameDirection::Up
        } else {
            FrameDirection::Down
        })
    }

    /// Puts what is known into a scan, then takes the block that is wanted of it. Returns what was
    /// replaced.
    ///
    /// # Errors
    /// The file of the sensors cannot be read, or the scan does not hold what was told.
    pub fn complete(&self, path: &Path, scan: &mut Scan) -> Result<Vec<String>, KnownError> {
        let replaced = self.tell(path, scan);
        self.sensors(scan)?;
        self.cut(scan)?;
        Ok(replaced)
    }

    /// Puts what is known of the frame into a scan: size, line rate, directions. Returns what was replaced.
    pub fn tell(&self, path: &Path, scan: &mut Scan) -> Vec<String> {
        let mut replaced = Vec::new();
        let mut note = |what: &str, old: Option<String>, new: String| {
            if let Some(old) = old.filter(|old| *old != new) {
                replaced.push(format!("{what} {new} instead of {old} of the file"));
            }
        };
        if let Some(size @ [width, height]) = self.told.size_nm {
            let words = |[w, h]: [f64; 2]| format!("{w} nm × {h} nm");
            note("size", scan.size_nm.map(words), words(size));
            scan.size_nm = Some(size);
            for channel in &mut scan.channels {
                (channel.width_nm, channel.height_nm) = (Some(width), Some(height));
                channel.span = Span::PixelEdges;
            }
        }
        if let Some(rate) = self.told.line_rate_hz {
            let old = scan
                .line_rate_hz
                .or(scan.line_times_s.map(|[a, b]| 1.0 / (a + b)));
            if old != Some(rate) {
                let words = |hz: f64| format!("{hz} Hz");
                note("line rate", old.map(words), words(rate));
                scan.line_rate_hz = Some(rate);
                scan.line_times_s = None;
            }
        }
        if let Some(direction) = self.frame_direction(path) {
            let words = |d: FrameDirection| match d {
                FrameDirection::Up => "up".to_owned(),
                FrameDirection::Down => "down".to_owned(),
            };
            let old = scan.frame_direction.map(words);
            note("frame direction", old, words(direction));
            scan.frame_direction = Some(direction);
        }
        if let Some(degrees) = self.told.rotation_deg {
            // Files that tell no rotation have none.
            let old = Some(scan.rotation_rad.to_degrees()).filter(|old| *old != 0.0);
            let words = |deg: f64| format!("{deg}°");
            note("rotation", old.map(words), words(degrees));
            scan.rotation_rad = degrees.to_radians();
        }
        replaced
    }

    /// Takes the block that is wanted of a scan, if one is.
    ///
    /// # Errors
    /// It does not lie within the image.
    pub fn cut(&self, scan: &mut Scan) -> Result<Option<Block>, KnownError> {
        let Some(wanted) = self.told.crop else {
            return Ok(None);
        };
        let rows = scan.channels.first().map_or(0, |c| c.rows);
        let block = from_below(wanted, rows).ok_or(KnownError::Rows {
            first: wanted.top,
            last: wanted.top.saturating_add(wanted.rows).saturating_sub(1),
            rows,
        })?;
        crop(scan, block)?;
        Ok(Some(block))
    }

    /// Makes the channels that the user names position sensors, or those of the second file.
    fn sensors(&self, scan: &mut Scan) -> Result<(), KnownError> {
        let names = self
            .told
            .x_sensor
            .as_deref()
            .zip(self.told.y_sensor.as_deref());
        let Some(file) = &self.told.sensors else {
            return names.map_or(Ok(()), |names| adopt(scan, names));
        };
        let refused = |reason: String| KnownError::Sensors {
            file: file.clone(),
            reason,
        };
        let path = Path::new(file);
        let content = self.source(path).content();
        let content = content.map_err(|e| refused(e.to_string()))?;
        let mut second = self
            .decode(path, &content, &|_| true)
            .map_err(|e| refused(e.to_string()))?;
        if let Some(names) = names {
            adopt(&mut second, names).map_err(|e| refused(e.to_string()))?;
        }
        second
            .channels
            .retain(|c| sensor_axis(&c.name, &c.internal_name).is_some());
        put_sensors(scan, second.channels).map_err(refused)
    }
}

/// The block counted from the bottom, as scans are; `None` where it reaches beyond the last row.
fn from_below(wanted: Crop, rows: usize) -> Option<Block> {
    let below = wanted.top.checked_add(wanted.rows)?;
    Some(Block {
        column: wanted.column,
        row: rows.checked_sub(below)?,
        columns: wanted.columns,
        rows: wanted.rows,
    })
}

/// Puts these position sensors in the place of those of the scan.
fn put_sensors(scan: &mut Scan, sensors: Vec<Channel>) -> Result<(), String> {
    for axis in ['X', 'Y'] {
        let found = sensors
            .iter()
            .any(|c| sensor_axis(&c.name, &c.internal_name) == Some(axis));
        if !found {
            return Err(format!(
                "expected a channel like \"{axis} Sensor\", found none. Name the channels of both sensors"
            ));
        }
    }
    scan.channels
        .retain(|c| sensor_axis(&c.name, &c.internal_name).is_none());
    for (image, sensor) in scan
        .channels
        .iter()
        .flat_map(|image| sensors.iter().map(move |sensor| (image, sensor)))
    {
        if (image.rows, image.columns) != (sensor.rows, sensor.columns) {
            return Err(format!(
                "channel {:?} has {} lines of {} samples, {:?} of the scan {} of {}",
                sensor.name, sensor.rows, sensor.columns, image.name, image.rows, image.columns
            ));
        }
    }
    scan.channels.extend(sensors);
    Ok(())
}

/// Names the channels that the user calls position sensors so; others of these names are left out.
fn adopt(scan: &mut Scan, (x, y): (&str, &str)) -> Result<(), KnownError> {
    let found = |scan: &Scan, wanted: &str| -> Vec<usize> {
        let named = |c: &Channel| is_named(&c.name, wanted) || is_named(&c.internal_name, wanted);
        (0..scan.channels.len())
            .filter(|&i| named(&scan.channels[i]))
            .collect()
    };
    let both = [
        ("X Sensor", found(scan, x), x),
        ("Y Sensor", found(scan, y), y),
    ];
    for (role, places, wanted) in &both {
        if places.is_empty() {
            let mut present: Vec<&str> = scan.channels.iter().map(|c| c.name.as_str()).collect();
            present.dedup();
            return Err(KnownError::NoChannel {
                wanted: (*wanted).to_owned(),
                role,
                present: present.join(", "),
            });
        }
    }
    let mut index = 0;
    scan.channels.retain_mut(|channel| {
        let role = both.iter().find(|(_, places, _)| places.contains(&index));
        index += 1;
        match role {
            Some((role, _, _)) => {
                channel.internal_name = std::mem::replace(&mut channel.name, (*role).to_owned());
                true
            }
            None => sensor_axis(&channel.name, &channel.internal_name).is_none(),
        }
    });
    Ok(())
}

/// Whether a name is the wanted one: case, blanks and signs but those of numbers do not count, and a name without line
/// direction stands for both.
pub fn is_named(name: &str, wanted: &str) -> bool {
    let (name, wanted) = (plain_name(name), plain_name(wanted));
    let rest = name.strip_prefix(&wanted);
    let directions = ["", "trace", "retrace", "forward", "backward"];
    !wanted.is_empty() && rest.is_some_and(|rest| directions.contains(&rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_without_direction_stand_for_both() {
        assert!(is_named("Phase_Retrace", "phase") && is_named("TR Phase", "tr_phase"));
        assert!(!is_named("Phase 2", "phase") && !is_named("TR Phase", "phase"));
        assert!(!is_named("LI (-0.5 V)", "LI (0.5 V)") && is_named("LI (-0.5 V)", "li -0.5v"));
        assert!(!is_named("", ""));
    }

    /// Arrays of any name become sensors in the unit that is told of sensors; others keep that of images.
    #[test]
    fn arrays_become_sensors_in_their_unit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scan.npz");
        let channel = |name: &str| Channel {
            name: name.to_owned(),
            internal_name: String::new(),
            unit: String::new(),
            line_direction: None,
            scan_line: None,
            rows: 2,
            columns: 3,
            width_nm: None,
            height_nm: None,
            span: Span::PixelEdges,
            scale: 1.0,
            offset: 0.0,
            scaling: String::new(),
            plane_fit: None,
            samples: spmfile::Samples::F64(vec![0.0, 1.0, 2.0, 0.0, 1.0, 2.0]),
        };
        let scan = Scan {
            channels: ["image", "stage x", "stage y"].map(channel).to_vec(),
            ..Scan::default()
        };
        std::fs::write(&path, spmfile::arrays::npz(&scan, &[]).unwrap()).unwrap();
        let told = UserSpecified {
            x_sensor: Some("stage x".to_owned()),
            y_sensor: Some("stage y".to_owned()),
            sensor_unit: Some("um".to_owned()),
            unit: Some("V".to_owned()),
            ..UserSpecified::default()
        };
        let known = Known::new(&told, std::slice::from_ref(&path));
        let content = known.source(&path).content().unwrap();
        let (read, _) = known.read(&path, &content, &|_| true).unwrap();
        let units: Vec<(&str, &str)> = (read.channels.iter())
            .map(|c| (c.name.as_str(), c.unit.as_str()))
            .collect();
        let expected = [("image", "V"), ("X Sensor", "um"), ("Y Sensor", "um")];
        assert_eq!(units, expected);
        let sensors = spmfile::position_sensors(&read, spmfile::LineDirection::Trace);
        assert!(sensors.is_ok(), "{:?}", sensors.err());
    }

    #[test]
    fn files_alternate_by_number() {
        let told = UserSpecified {
            frame_direction: Some(FrameOrder::AlternatingDown),
            ..UserSpecified::default()
        };
        let known = Known::new(&told, &["s.10.npy", "s.9.npy"].map(PathBuf::from));
        let of = |name: &str| known.frame_direction(Path::new(name));
        assert_eq!(of("s.9.npy"), Some(FrameDirection::Down));
        assert_eq!(of("s.10.npy"), Some(FrameDirection::Up));
    }
}

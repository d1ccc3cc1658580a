//! An image too large for memory, mapped band by band. Finished bands are kept beside the results until the map
//! is complete, so that an interrupted run goes on where it stopped; one that is damaged is made again.

use std::path::Path;

use moiregauge::caveat::{Caveat, FileDoubt};
use moiregauge::domains::{Contrast, DomainMap};
use moiregauge::frame::Image;
use moiregauge::frame::remove_background;
use moiregauge::frame::{Geometry, Timing};
use moiregauge::map::TwistStrainMap;
use moiregauge::scan::Picture;
use moiregauge::scan::{choose_channel, unusual_channels};
use moiregauge::settings::Settings;
use moiregauge::survey::{SurveyPlan, nominal_geometry};
use moiregauge::window::Resolution;
use moiregauge_report::InputFile;
use nalgebra::Vector2;
use spmfile::{Channel, LineDirection, Scan};

use super::bytes::{decoded, encoded, key};
use super::error::NoBands;
use super::lines::{Lines, Pixels};
use crate::job::{Event, Job};
use crate::known::Known;
use crate::opened::Opened;
use crate::sink::{Keep, Part};

/// Images with more pixels than this are mapped in bands.
const LARGE: usize = 4096 * 4096 * 5 / 4;

/// A large image that can be mapped.
pub(super) struct Large {
    pub(super) input: InputFile,
    /// What the user's options replaced in it, and what its reader doubts.
    pub(super) caveats: Vec<Caveat>,
    geometry: Geometry,
    /// Name and unit of the channel.
    channel: String,
    unit: String,
    /// Where the file tells its line rate and frame direction.
    timing: Option<Timing>,
    pixels: Pixels,
}

impl Large {
    /// Opens a file if its image is large, or `always`; `None` for one that is read as a whole.
    pub(super) fn open(
        path: &Path,
        settings: &Settings,
        known: &Known,
        always: bool,
    ) -> Result<Option<Self>, NoBands> {
        let large = if always { 0 } else { LARGE };
        // It is in memory as a whole; only who asks for bands gets them.
        let in_memory = known.in_memory(path).is_some();
        if in_memory && !always {
            return Ok(None);
        }
        let lines = || Lines::open(path, known, settings.channel.as_deref());
        if let Some(lines) = Some(lines).filter(|_| !in_memory).and_then(|open| open()) {
            if lines.size[0] * lines.size[1] < large {
                return Ok(None);
            }
            no_sensors(known)?;
            return Self::of_lines(path, lines, settings, known).map(Some);
        }
        // Other files are read as a whole anyway; small ones go the common way.
        if !in_memory && known.source(path).length()? < large as u64 {
            return Ok(None);
        }
        let opened = Opened::new(path, known)?;
        let reading = opened.reading(settings)?;
        let names: Vec<(&str, &str)> = reading
            .scan
            .channels
            .iter()
            .map(|c| (c.name.as_str(), c.internal_name.as_str()))
            .collect();
        let chosen = choose_channel(&names, settings.channel.as_deref()).map(str::to_owned);
        let channel = reading
            .scan
            .channels
            .iter()
            .find(|c| Some(&c.name) == chosen.as_ref());
        let Some(channel) = channel.filter(|c| c.rows * c.columns >= large) else {
            return Ok(None);
        };
        no_sensors(known)?;
        let geometry = nominal_geometry(&reading.scan, channel).ok_or(NoBands::NoSize)?;
        Ok(Some(Self {
            input: reading.input,
            caveats: reading.caveats,
            geometry,
            channel: channel.name.clone(),
            unit: channel.unit.clone(),
            timing: timing(&reading.scan, channel),
            pixels: Pixels::Memory(channel.clone()),
        }))
    }

    /// A file of which no line is read here.
    fn of_lines(
        path: &Path,
        lines: Lines,
        settings: &Settings,
        known: &Known,
    ) -> Result<Self, NoBands> {
        let mut scan = lines.scan()?;
        let replaced = known.tell(path, &mut scan);
        let block = known.cut(&mut scan)?;
        let input = known.source(path).identity(path)?;
        let channel = scan
            .channels
            .first()
            .ok_or(NoBands::Nothing("the file holds no image"))?;
        let names: Vec<(&str, &str)> = lines.names.iter().map(|(a, b)| (&**a, &**b)).collect();
        let several = unusual_channels(&names, settings.channel.as_deref());
        let several = several.map(FileDoubt::SeveralImages);
        let replaced = replaced.into_iter().map(FileDoubt::GivenByUser);
        let doubts = scan.notes.iter().cloned().map(FileDoubt::ReaderDoubt);
        let caveat = |doubt| Caveat::new(doubt, input.file.as_str());
        Ok(Self {
            caveats: several
                .into_iter()
                .chain(replaced)
                .chain(doubts)
                .map(caveat)
                .collect(),
            geometry: nominal_geometry(&scan, channel).ok_or(NoBands::NoSize)?,
            timing: timing(&scan, channel),
            channel: channel.name.clone(),
            unit: channel.unit.clone(),
            pixels: Pixels::Lines(lines.with_block(block)),
            input,
        })
    }

    /// Maps band by band, as `first` of the same survey was. Finished bands are kept until all is written, and those of
    /// an earlier run of the same program are taken.
    pub(super) fn map(
        &self,
        (settings, resolution): (&Settings, &Resolution),
        first: Option<&SurveyPlan>,
        keep: &dyn Keep,
        job: &Job,
    ) -> Result<(TwistStrainMap, SurveyPlan), NoBands> {
        let read = |block| self.pixels.block(block);
        let (geometry, timing) = (&self.geometry, self.timing.as_ref());
        let plan = SurveyPlan::new(geometry, timing, settings, resolution, first, &read)?;
        let key = key(&self.in_words(), settings, resolution, &plan)?;
        let stage = job.stage("mapping", "bands", plan.bands());
        let mut whole: Option<TwistStrainMap> = None;
        for band in 0..plan.bands() {
            let name = format!("{key}-{band:04}");
            let kept = match keep.kept(&name) {
                Part::Whole(bytes) => decoded(&bytes, &plan),
                Part::Absent => None,
                Part::Damaged => {
                    let words = format!(
                        "band {} was damaged on the disk and is mapped again",
                        band + 1
                    );
                    job.tell(&Event::Note { words: &words });
                    None
                }
            };
            let map = if let Some(kept) = kept {
                kept
            } else {
                let mut map = plan.band(band, &read)?;
                keep.keep(&name, &encoded(&mut map))?;
                map
            };
            let all = whole.get_or_insert_with(|| plan.start(&map.grid));
            all.append(map);
            stage.step();
        }
        drop(stage);
        let whole = whole.ok_or(NoBands::Nothing("the image has no lines"))?;
        Ok((whole, plan))
    }
}

impl Large {
    /// What the maps of its bands depend on: its content, geometry and times.
    fn in_words(&self) -> String {
        format!("{}{:?} {:?}", self.input.sha256, self.geometry, self.timing)
    }

    /// Nodes and triangles of the image; none where its lines cannot be read.
    pub(super) fn domains(&self, plan: &SurveyPlan, contrast: Contrast) -> Option<DomainMap> {
        let read = |block| self.pixels.block(block);
        plan.domains(&read, contrast).ok().flatten()
    }
}

/// Pixels along the longer side of a picture of a survey, at most.
const SHOWN: usize = 1024;

impl Large {
    /// The image in little, to be shown: one line of every block of lines. `None` where its lines cannot be read.
    pub(super) fn picture(&self, settings: &Settings) -> Option<Picture> {
        let [columns, rows] = self.geometry.size;
        let block = columns.max(rows).div_ceil(SHOWN).max(1);
        let mut values = Vec::new();
        for row in 0..rows / block {
            let row = row * block + block / 2;
            let line = self.pixels.block([0..columns, row..row + 1]).ok()?;
            values.extend(line.values.chunks_exact(block).map(|pixels| {
                let there: Vec<f64> = pixels.iter().copied().filter(|v| v.is_finite()).collect();
                there.iter().sum::<f64>() / there.len() as f64
            }));
        }
        let image = Image::new(rows / block, columns / block, values);
        let geometry = &self.geometry;
        let middle = Vector2::repeat((block - 1) as f64 / 2.0);
        Some(Picture {
            file: self.input.file.clone(),
            channel: self.channel.clone(),
            unit: self.unit.clone(),
            image: remove_background(&image, settings.background),
            pixel_to_nm: geometry.pixel_to_nm * block as f64,
            origin: geometry.origin + geometry.pixel_to_nm * middle,
            from_sensors: false,
        })
    }
}

fn timing(scan: &Scan, channel: &Channel) -> Option<Timing> {
    let line = channel.line_direction.unwrap_or(LineDirection::Trace);
    Timing::of_scan(scan, channel.columns, scan.frame_direction?, line)
}

/// Refuses position sensors, which have no use here.
fn no_sensors(known: &Known) -> Result<(), NoBands> {
    let told = known.user_specified();
    if told.sensors.is_some() || told.x_sensor.is_some() {
        return Err(NoBands::Sensors);
    }
    Ok(())
}

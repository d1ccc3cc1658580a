//! An image too large for memory, mapped band by band. Finished bands are kept beside the results until the map
//! is complete, so that an interrupted run goes on where it stopped; one that is damaged is made again.

use std::path::Path;

use anyhow::{Context as _, ensure};
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
use moiregauge_pipeline::sink::{FolderSink, Part};
use moiregauge_pipeline::{Event, Job, Known, Opened, identity};
use moiregauge_report::InputFile;
use nalgebra::Vector2;
use spmfile::{Channel, LineDirection, Scan};

use super::kept::{decoded, encoded, key};
use super::source::{Lines, Source};
use crate::analyze::with_advice;
use crate::input::with_option;

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
    source: Source,
}

impl Large {
    /// Opens a file if its image is large, or `always`; `None` for one that is read as a whole.
    pub(super) fn open(
        path: &Path,
        settings: &Settings,
        known: &Known,
        always: bool,
    ) -> anyhow::Result<Option<Self>> {
        let large = if always { 0 } else { LARGE };
        let place = known.place(path);
        if let Some(lines) = Lines::open(path, known, settings.channel.as_deref()) {
            if lines.size[0] * lines.size[1] < large {
                return Ok(None);
            }
            no_sensors(known)?;
            return Self::of_lines(path, lines, settings, known).map(Some);
        }
        // Other files are read as a whole anyway; small ones go the common way.
        if std::fs::metadata(place)?.len() < large as u64 {
            return Ok(None);
        }
        let opened = Opened::new(path, known).map_err(with_advice)?;
        let reading = opened.reading(settings).map_err(with_advice)?;
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
        let geometry =
            nominal_geometry(&reading.scan, channel).context("the file gives no scan size")?;
        Ok(Some(Self {
            input: reading.input,
            caveats: reading.caveats,
            geometry,
            channel: channel.name.clone(),
            unit: channel.unit.clone(),
            timing: timing(&reading.scan, channel),
            source: Source::Memory(channel.clone()),
        }))
    }

    /// A file of which no line is read here.
    fn of_lines(
        path: &Path,
        lines: Lines,
        settings: &Settings,
        known: &Known,
    ) -> anyhow::Result<Self> {
        let mut scan = lines.scan()?;
        let replaced = known.tell(path, &mut scan);
        let block = known.cut(&mut scan).map_err(with_option)?;
        let input = identity(path, known.place(path))?;
        let channel = scan.channels.first().context("the file holds no image")?;
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
            geometry: nominal_geometry(&scan, channel)
                .context("the file gives no scan size; give it with --size")?,
            timing: timing(&scan, channel),
            channel: channel.name.clone(),
            unit: channel.unit.clone(),
            source: Source::Lines(lines.with_block(block)),
            input,
        })
    }

    /// Maps band by band, as `first` of the same survey was. Finished bands are kept until all is written, and those of
    /// an earlier run of the same program are taken.
    pub(super) fn map(
        &self,
        (settings, resolution): (&Settings, &Resolution),
        first: Option<&SurveyPlan>,
        sink: &FolderSink,
        job: &Job,
    ) -> anyhow::Result<(TwistStrainMap, SurveyPlan)> {
        let read = |block| self.source.block(block);
        let (geometry, timing) = (&self.geometry, self.timing.as_ref());
        let plan = SurveyPlan::new(geometry, timing, settings, resolution, first, &read)?;
        let key = key(&self.in_words(), settings, resolution, &plan)?;
        let stage = job.stage("mapping", "bands", plan.bands());
        let mut whole: Option<TwistStrainMap> = None;
        for band in 0..plan.bands() {
            let name = format!("{key}-{band:04}");
            let kept = match sink.kept(&name) {
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
                sink.keep(&name, &encoded(&mut map))?;
                map
            };
            let all = whole.get_or_insert_with(|| plan.start(&map.grid));
            all.append(map);
            stage.step();
        }
        drop(stage);
        let whole = whole.context("the image has no lines")?;
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
        let read = |block| self.source.block(block);
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
            let line = self.source.block([0..columns, row..row + 1]).ok()?;
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
fn no_sensors(known: &Known) -> anyhow::Result<()> {
    let told = known.told();
    ensure!(
        told.sensors.is_none() && told.x_sensor.is_none(),
        "--sensors, --x-sensor and --y-sensor: an image that is mapped in bands has nominal positions, and position \
         sensors are not used"
    );
    Ok(())
}

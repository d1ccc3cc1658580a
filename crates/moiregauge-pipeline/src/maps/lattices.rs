//! Scans that show a lattice → their maps, and the average of these.

use moiregauge::campaign::{Analysis, ScanAnalysis, SetAnalysis, grains, picture, refusal};
use moiregauge::caveat::{Caveat, Doubt, MoireDoubt};
use moiregauge::domains::{Contrast, DomainMap};
use moiregauge::map::{Agreement, DriftChange, RegistryMap, TwistStrainMap};
use moiregauge::scan::Picture;
use moiregauge::settings::Settings;
use moiregauge::survey::{
    LineMap, MapError, MapMethod, MappedPattern, average_maps, change_of_drift, domains_of_scan,
    map_grain, map_scan, pattern_of_scan,
};
use moiregauge::window::{Resolution, UsedHarmonic};
use moiregauge_report::FailedInput;
use moiregauge_report::results::{MappedImage, MappedRuler, TwistStrainResult};
use spmfile::LineDirection;

use super::doubts;
use crate::campaign::{Scans, in_words};
use crate::job::{Cancelled, Job};
use crate::names::in_full;
use crate::opened::{InputError, read_again};

/// A map and what came with it.
#[derive(Clone, Debug)]
pub struct Mapped {
    /// The map.
    pub map: TwistStrainMap,
    /// Twist and strain of the whole images.
    pub whole: Option<TwistStrainResult>,
    /// The images behind it.
    pub images: Vec<MappedImage>,
    /// The first of them, to be shown.
    pub picture: Option<Picture>,
    /// Its pattern: undistorted, and its averaged cell.
    pub pattern: Option<MappedPattern>,
    /// The registry of the layers on the nodes.
    pub registry: Option<RegistryMap>,
    /// How well maps of several images agree.
    pub agreement: Option<Agreement>,
    /// How the drift changes between upward and downward frames.
    pub drift_change: Option<DriftChange>,
    /// Doubts, those of the analysis first.
    pub caveats: Vec<Caveat>,
    /// Files that gave no map.
    pub failed: Vec<FailedInput>,
}

/// The first image, to be shown as it is and undistorted.
#[derive(Default)]
struct FirstImage {
    picture: Option<Picture>,
    pattern: Option<MappedPattern>,
}

/// Why there is no map.
#[derive(Debug, thiserror::Error)]
pub enum NoMap {
    /// It was stopped.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// No image gave one.
    #[error("no image gave a map")]
    Nothing {
        /// Why not, file by file.
        failed: Vec<FailedInput>,
    },
}

/// Why one scan gave none.
#[derive(Debug, thiserror::Error)]
enum OfScan {
    #[error(transparent)]
    Input(#[from] InputError),
    #[error(transparent)]
    Map(#[from] MapError),
}

/// Maps the scans of an analysis, trace and retrace, puts the maps on each other and averages.
///
/// # Errors
/// [`NoMap`].
pub fn map_lattices(
    scans: &Scans,
    method: MapMethod,
    resolution: &Resolution,
    job: &Job,
) -> Result<Mapped, NoMap> {
    job.run(|| scans.mapped(method, resolution, job))?
}

impl Scans<'_> {
    fn mapped(
        &self,
        method: MapMethod,
        resolution: &Resolution,
        job: &Job,
    ) -> Result<Mapped, NoMap> {
        let caveats = self.analysis.caveats.clone();
        match grains(self.analysis) {
            None => {
                // The maps read the lattice under the name that the analysis found.
                let settings = &self.analysis.named_settings();
                let maps = self.maps(settings, method, resolution, None, job);
                self.averaged(maps, None, settings, resolution, caveats)
            }
            Some(grains) => self.of_grains(&grains, method, resolution, job, caveats),
        }
    }

    /// One map of grains that lie side by side; the window of the first is that of all.
    fn of_grains(
        &self,
        grains: &[Vec<usize>],
        method: MapMethod,
        resolution: &Resolution,
        job: &Job,
        caveats: Vec<Caveat>,
    ) -> Result<Mapped, NoMap> {
        let (mut found, mut failed) = (Vec::<(u8, Mapped)>::new(), Vec::new());
        for (number, sets) in (1..).zip(grains).filter(|(_, sets)| !sets.is_empty()) {
            let settings = &self.analysis.named_settings_of(sets);
            let first = found.first().map(|(_, first)| first.map.window_nm);
            let resolution = &Resolution {
                window_nm: resolution.window_nm.or(first),
                ..*resolution
            };
            let (maps, shown, without) = self.maps(settings, method, resolution, Some(sets), job);
            let told = self.analysis.settings.grain.unwrap_or(number.into());
            failed.extend(without.into_iter().map(|file| FailedInput {
                error: format!("grain {told}: {}", file.error),
                ..file
            }));
            let maps = (maps, shown, Vec::new());
            match self.averaged(maps, Some(sets), settings, resolution, Vec::new()) {
                Ok(mapped) => found.push((number, mapped)),
                Err(NoMap::Nothing { .. }) => {}
                Err(cancelled) => return Err(cancelled),
            }
        }
        if found.len() > 1 {
            return side_by_side(found, failed, caveats)
                .ok_or(NoMap::Nothing { failed: Vec::new() });
        }
        let Some((_, mut alone)) = found.pop() else {
            return Err(NoMap::Nothing { failed });
        };
        alone.caveats.splice(0..0, caveats);
        alone.failed.append(&mut failed);
        Ok(alone)
    }

    /// The average of the maps of all scans, or of those of a grain in its sets, and what came with it; doubts follow on `caveats`.
    fn averaged(
        &self,
        (mut maps, shown, failed): (Vec<LineMap>, FirstImage, Vec<FailedInput>),
        grain: Option<&[usize]>,
        settings: &Settings,
        resolution: &Resolution,
        mut caveats: Vec<Caveat>,
    ) -> Result<Mapped, NoMap> {
        doubts::registered(&mut maps, &mut caveats);
        let Some((lattices, agreement)) = average_maps(&maps) else {
            return Err(NoMap::Nothing { failed });
        };
        let reference = maps[0].whole;
        let (layers, convention) = (settings.bilayer(), settings.strain_convention);
        let found = match self.no_twist_strain(grain) {
            Some(why) => Err(why),
            None => match &maps[0].ruler {
                Some((atoms, _)) => {
                    Ok(lattices.twist_strain_by(&atoms.ruler, atoms.layer, atoms.twist, layers))
                }
                None => lattices
                    .twist_strain(&reference, layers, convention)
                    .map_err(|why| why.to_string()),
            },
        };
        let found = found.unwrap_or_else(|why| {
            caveats.push(doubts::no_twist_strain(why));
            vec![None; lattices.nodes.len()]
        });
        doubts::of_maps(&maps, &mut caveats);
        if resolution.margin.is_none() {
            let narrow = maps
                .iter()
                .find_map(|m| doubts::narrow_margin(m.margin, &m.file));
            caveats.extend(narrow);
        }
        // Atoms show no drift that changes.
        let ruled = maps.iter().any(|m| m.ruler.is_some());
        let drift_change = change_of_drift(&maps).filter(|_| !ruled);
        doubts::about_change(drift_change, &mut caveats);
        let unbent = TwistStrainMap::new(&lattices, &found);
        let of_bends = lattices.of_bends(&reference, layers, convention, settings);
        let by_nodes = maps.iter().all(|m| m.ruler.is_some_and(|(_, nodes)| nodes));
        let map = match of_bends {
            Ok(of_bends) if !by_nodes => unbent.with_bends(&of_bends),
            _ => unbent,
        };
        caveats.extend(doubts::of_bends(&map, lattices.bends.from_sensors));
        let image = |m: &LineMap| MappedImage {
            ruler: m.ruler.map(|(_, nodes)| MappedRuler::of(nodes)),
            ..mapped_image(&m.file, Some(m.line), m.drift_corrected, &m.harmonics)
        };
        Ok(Mapped {
            map,
            whole: match grain {
                Some(sets) => whole_set(&self.analysis.sets[sets[0]]),
                None => whole_image(self.analysis),
            },
            images: maps.iter().map(image).collect(),
            picture: shown.picture,
            pattern: shown.pattern,
            registry: lattices.registry(&reference, layers, convention),
            agreement,
            drift_change,
            caveats,
            failed,
        })
    }

    /// Nodes and triangles of every scan.
    pub fn domains(&self, contrast: Contrast) -> Vec<DomainMap> {
        let settings = &self.analysis.named_settings();
        let origin = self.origin();
        let of_scan = |scan: &ScanAnalysis| {
            let read = read_again(self.inputs, &scan.file, settings, self.known).ok();
            read.map_or_else(Vec::new, |read| {
                domains_of_scan(&read, scan, origin, settings, contrast)
            })
        };
        self.used().flat_map(of_scan).collect()
    }

    /// Why the analysis gives no twist and strain of all sets, or of those of a grain; `None` where it does. What it refuses is not mapped.
    fn no_twist_strain(&self, grain: Option<&[usize]>) -> Option<String> {
        let all: Vec<usize> = (0..self.analysis.sets.len()).collect();
        let sets = grain
            .unwrap_or(&all)
            .iter()
            .map(|&i| &self.analysis.sets[i]);
        let found = |set: &SetAnalysis| set.mean.is_some() || set.uncorrected.is_some();
        if sets.clone().any(found) {
            return None;
        }
        let no_moire = |c: &&Caveat| matches!(c.doubt, Doubt::Moire(MoireDoubt::NoMoire { .. }));
        let why = refusal(self.analysis).or_else(|| self.analysis.caveats.iter().find(no_moire));
        let words = "no twist and strain explain the lattice of the images".to_owned();
        Some(why.map_or(words, Caveat::message))
    }

    /// The scans that are not excluded.
    fn used(&self) -> impl Iterator<Item = &ScanAnalysis> {
        (0..self.analysis.sets.len()).flat_map(|set| self.used_of(set))
    }

    /// Those of a set.
    fn used_of(&self, set: usize) -> impl Iterator<Item = &ScanAnalysis> {
        let all = self.analysis.sets[set].scans.iter();
        all.filter(|scan| scan.excluded.is_none())
    }

    /// The time that drift is counted from.
    fn origin(&self) -> Option<f64> {
        self.used()
            .filter_map(|s| s.motion.map(|m| m.middle))
            .min_by(f64::total_cmp)
    }

    /// The maps of all scans, or of one grain in those of its sets, trace and retrace, with the first image, to be shown, and the files
    /// that gave none.
    fn maps(
        &self,
        settings: &Settings,
        method: MapMethod,
        resolution: &Resolution,
        grain: Option<&[usize]>,
        job: &Job,
    ) -> (Vec<LineMap>, FirstImage, Vec<FailedInput>) {
        let (mut maps, mut failed) = (Vec::new(), Vec::new());
        let mut first = FirstImage::default();
        let origin = self.origin();
        let of_part = if grain.is_some() { map_grain } else { map_scan };
        let scans: Vec<&ScanAnalysis> = match grain {
            Some(sets) => sets.iter().flat_map(|set| self.used_of(*set)).collect(),
            None => self.used().collect(),
        };
        let stage = job.stage("mapping", "scans", scans.len());
        for scan in scans {
            let mut of_scan = || -> Result<Vec<LineMap>, OfScan> {
                let read = read_again(self.inputs, &scan.file, settings, self.known)?;
                let lines = of_part(&read, scan, origin, settings, method, resolution)?;
                if first.picture.is_none() {
                    first.picture = picture(&scan.file, &read, settings);
                }
                if first.pattern.is_none() {
                    let of = |map| pattern_of_scan(&read, scan, origin, settings, map);
                    first.pattern = lines.iter().find_map(of);
                }
                Ok(lines)
            };
            match of_scan() {
                Ok(lines) => maps.extend(lines),
                Err(error) => failed.push(FailedInput {
                    file: scan.file.clone(),
                    error: match &error {
                        OfScan::Input(error) => in_words(error, self.advice),
                        OfScan::Map(error) => in_full(error),
                    },
                }),
            }
            stage.step();
        }
        (maps, first, failed)
    }
}

/// The maps of grains as one. What counts from the mean lattice of one of them (displacements, registry, averaged cell) is left out, and so
/// is a mean over all.
fn side_by_side(
    found: Vec<(u8, Mapped)>,
    failed: Vec<FailedInput>,
    mut caveats: Vec<Caveat>,
) -> Option<Mapped> {
    let grains = found.len();
    let (mut maps, mut images, mut picture, mut drift_change) =
        (Vec::new(), Vec::new(), None, None);
    for (number, grain) in found {
        for doubt in grain.caveats {
            if !caveats.iter().any(|known| known.says_the_same(&doubt)) {
                caveats.push(doubt);
            }
        }
        for image in grain.images {
            let known =
                |other: &MappedImage| [&other.file, &other.line] == [&image.file, &image.line];
            if !images.iter().any(known) {
                images.push(image);
            }
        }
        picture = picture.or(grain.picture);
        drift_change = drift_change.or(grain.drift_change);
        maps.push((number, grain.map));
    }
    caveats.push(doubts::of_grains(grains));
    Some(Mapped {
        map: TwistStrainMap::of_grains(maps)?,
        whole: None,
        images,
        picture,
        pattern: None,
        registry: None,
        agreement: None,
        drift_change,
        caveats,
        failed,
    })
}

/// Twist and strain of the whole images.
fn whole_image(analysis: &Analysis) -> Option<TwistStrainResult> {
    if let Some(combined) = &analysis.combined {
        let found = &combined.twist_strain;
        return Some(TwistStrainResult::of_mean(found, &combined.budget));
    }
    whole_set(analysis.sets.first()?)
}

/// The same of the images of a set.
fn whole_set(set: &SetAnalysis) -> Option<TwistStrainResult> {
    let mean = set.mean.as_ref().or(set.uncorrected.as_ref());
    let scan = set.scans.first();
    mean.map(|m| TwistStrainResult::of_mean(&m.twist_strain, &m.budget))
        .or(scan.and_then(|s| s.twist_strain_sensor.as_ref().map(Into::into)))
}

/// One image behind a map.
pub(super) fn mapped_image(
    file: &str,
    line: Option<LineDirection>,
    drift_corrected: bool,
    harmonics: &[UsedHarmonic],
) -> MappedImage {
    MappedImage {
        file: file.to_owned(),
        line: match line {
            Some(LineDirection::Retrace) => "retrace",
            Some(LineDirection::Trace) | None => "trace",
        }
        .to_owned(),
        drift_corrected,
        ruler: None,
        harmonics: harmonics.iter().map(Into::into).collect(),
    }
}

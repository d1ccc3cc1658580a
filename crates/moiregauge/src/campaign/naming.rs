//! Which waves of the lattice belong to the atoms, before anything is read from it: by all images of an analysis.

use heterostrain::lattice::canonical;
use nalgebra::{Matrix2, Vector2};

use crate::drift::linear::common_lattice;
use crate::meaning::naming::named_waves;
use crate::meaning::strengths::WaveStrengths;
use crate::scan::measured::MeasuredScan;
use crate::settings::knobs::Settings;

/// What the images say of the names of the lattice.
pub(crate) struct Named {
    /// The settings with the waves that the images name.
    pub(crate) settings: Settings,
    /// How strong the waves are in all images that are used.
    pub(crate) strengths: WaveStrengths,
}

impl Named {
    /// Drift is not known yet: a moiré that it distorts by a per cent has strains that are off by a hundredth of the
    /// twist, which names bear.
    pub(crate) fn new(scans: &[&MeasuredScan], settings: &Settings) -> Self {
        let mut named = Self {
            settings: settings.clone(),
            strengths: WaveStrengths::default(),
        };
        let used = || scans.iter().filter(|scan| scan.excluded.is_none());
        let Some(first) = used().find_map(|scan| scan.lines.first()) else {
            return named;
        };
        let reference = canonical(&first.in_sensor_coordinates()).basis;
        named.strengths = WaveStrengths::new(&reference);
        let mut seen = Vec::new();
        for line in used().flat_map(|scan| &scan.lines) {
            seen.push(line.observation(&reference));
            if let Some(fit) = &line.lattice.fit {
                named.strengths.add(fit, &line.geometry.pixel_to_nm);
            }
        }
        let still = common_lattice(&seen, &Vector2::zeros(), &Matrix2::zeros());
        if let Ok((lattice, _, _)) = still
            && let Some(waves) = named_waves(&lattice, &named.strengths, settings)
        {
            named.settings.moire_waves = Some(waves);
        }
        named
    }
}

//! A simulation at work: settings → scans and their truth.

use spmfile::Scan;

use crate::simulate::error::SimulateError;
use crate::simulate::raster::{FramePlan, file_name};
use crate::simulate::scene::Scene;
use crate::simulate::settings::Simulation;
use crate::simulate::surface::Surface;
use crate::simulate::truth::Truth;
use crate::simulate::{frame, truth};

/// A simulation whose settings have been checked, ready to record frames.
#[derive(Clone, Debug)]
pub struct Simulator {
    settings: Simulation,
    scene: Scene,
    surface: Option<Surface>,
}

impl Simulator {
    /// Checks the settings and lays out the sample.
    ///
    /// # Errors
    /// [`SimulateError`] names the setting that makes no sense.
    pub fn new(settings: Simulation) -> Result<Self, SimulateError> {
        settings.check()?;
        let scene = Scene::new(&settings.sample)?;
        let surface = Surface::new(&settings)?;
        Ok(Self {
            settings,
            scene,
            surface,
        })
    }

    /// The settings.
    pub fn settings(&self) -> &Simulation {
        &self.settings
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.settings.raster.scans
    }

    /// Frame `index` as the instrument would have written it.
    pub fn frame(&self, index: usize) -> Scan {
        let plan = FramePlan::new(&self.settings, index);
        frame::record(&self.settings, &self.scene, self.surface.as_ref(), &plan)
    }

    /// The wave vectors (rad/nm) and amplitudes (degrees of phase) of one half of the harmonics.
    pub(crate) fn harmonics(&self) -> impl Iterator<Item = (nalgebra::Vector2<f64>, f64)> {
        self.scene.harmonics.iter().map(|h| (h.wave, h.amplitude))
    }

    /// Everything needed to check an analysis of the frames.
    pub fn truth(&self) -> Truth {
        truth::truth(&self.settings, &self.scene, self.surface.as_ref())
    }

    /// The name of the file for frame `index`, as in `scan.003.spm`.
    pub fn file_name(index: usize) -> String {
        file_name(index)
    }
}

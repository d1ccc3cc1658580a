//! Options that say what is known of the scanner and of isotropic strain, for the uncertainty budget.

use std::path::PathBuf;

use moiregauge::settings::{MoireLayers, RulerLayer, Settings};

use crate::numbers::number;

/// What no scan of a moiré tells.
#[derive(clap::Args, Clone, Debug)]
#[command(next_help_heading = "Scanner and uncertainty budget")]
pub(crate) struct ScannerArgs {
    /// Calibration of the scanner, as `moiregauge calibrate` writes it: corrects positions; its errors replace the
    /// three below
    #[arg(long, value_name = "FILE", conflicts_with_all = ["calibration_gain", "calibration_mismatch", "calibration_orthogonality"])]
    calibration: Option<PathBuf>,
    /// Gain error of the scanner, common to x and y, per cent, for the budget [default: 1]
    #[arg(long, value_name = "PERCENT", value_parser = number([0.0, 50.0]))]
    calibration_gain: Option<f64>,
    /// Difference of the gains of x and y, per cent, for the budget [default: 0.5]
    #[arg(long, value_name = "PERCENT", value_parser = number([0.0, 50.0]))]
    calibration_mismatch: Option<f64>,
    /// Deviation of the axes from a right angle, mrad, for the budget [default: 5]
    #[arg(long, value_name = "MRAD", value_parser = number([0.0, 500.0]))]
    calibration_orthogonality: Option<f64>,
    /// By how much a position sensor bends against a straight line, per cent of its range in the frame, for the budget [default: 0.1]
    #[arg(long, value_name = "PERCENT", value_parser = number([0.0, 50.0]))]
    sensor_bend: Option<f64>,
    /// The same of a scanner without position sensors [default: 1]
    #[arg(long, value_name = "PERCENT", value_parser = number([0.0, 50.0]))]
    scanner_bend: Option<f64>,
    /// Isotropic heterostrain that the layers may have, per cent, for the budget [default: 0.05]
    #[arg(long, value_name = "PERCENT", value_parser = number([0.0, 10.0]))]
    isotropic_strain: Option<f64>,
    /// Layer whose atoms the frames show beside the moiré and which measures them in place of the scanner: free of drift and
    /// calibration. `auto`: whichever they show, where that is more accurate. With --moires N one for all moirés, or one for each: `2,off` where
    /// only the first has the layer that shows [default: auto]
    #[arg(long, value_name = "LAYER", value_delimiter = ',', value_parser = ["1", "2", "auto", "off"])]
    ruler: Vec<String>,
    /// Strain that this layer itself may have, along x and along y, per cent, for the budget [default: 0.1]
    #[arg(long, value_name = "PERCENT", value_parser = number([0.0, 10.0]))]
    ruler_strain: Option<f64>,
    /// By how much the gains of the scanner may differ from those in the frames of --ruler-from, along x and along y, per cent,
    /// for the budget [default: 0.5]
    #[arg(long, value_name = "PERCENT", value_parser = number([0.0, 50.0]))]
    ruler_magnification: Option<f64>,
}

impl ScannerArgs {
    /// Puts what was given on top of the settings.
    pub(crate) fn apply(&self, settings: &mut Settings) -> anyhow::Result<()> {
        let priors = &mut settings.calibration;
        for (given, setting) in [
            (self.calibration_gain, &mut priors.gain_percent),
            (self.calibration_mismatch, &mut priors.mismatch_percent),
            (
                self.calibration_orthogonality,
                &mut priors.orthogonality_mrad,
            ),
            (self.sensor_bend, &mut priors.sensor_bend_percent),
            (self.scanner_bend, &mut priors.scanner_bend_percent),
            (
                self.isotropic_strain,
                &mut settings.isotropic_strain_percent,
            ),
            (self.ruler_strain, &mut settings.ruler_strain_percent),
            (
                self.ruler_magnification,
                &mut settings.ruler_magnification_percent,
            ),
        ] {
            *setting = given.unwrap_or(*setting);
        }
        let ruler = |named: &String| match named.as_str() {
            "1" => RulerLayer::First,
            "2" => RulerLayer::Second,
            "off" => RulerLayer::Off,
            _ => RulerLayer::Auto,
        };
        match self.ruler.as_slice() {
            [] => {}
            [one] => {
                settings.ruler = ruler(one);
                for own in &mut settings.moire_layers {
                    own.ruler = None;
                }
            }
            each => {
                let moires = settings.moires;
                anyhow::ensure!(
                    each.len() == moires,
                    "--ruler: expected one layer for all moirés or one for each of the {moires}, found {}",
                    each.len()
                );
                if settings.moire_layers.is_empty() {
                    let (upper, lower) = (settings.material.clone(), settings.substrate.clone());
                    settings.moire_layers = vec![MoireLayers::new(upper, lower); moires];
                }
                for (own, named) in settings.moire_layers.iter_mut().zip(each) {
                    own.ruler = Some(ruler(named));
                }
            }
        }
        if let Some(path) = &self.calibration {
            settings.scanner = Some(moiregauge_pipeline::calibrate::read_calibration(path)?);
        }
        Ok(())
    }
}

//! The orientation of a layer: the options for it.

use std::path::PathBuf;

use clap::ValueEnum;
use heterostrain::strain::{KnownOrientation, LatticeDirection, TwistSense};
use moiregauge::settings::Settings;
use moiregauge_report::results::AtomicImages;

use crate::numbers;
use crate::paths::expand;

/// The options for it.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "Orientation of a layer: separates isotropic strain from twist")]
pub(crate) struct OrientationArgs {
    /// Orientation of the atomic lattice or of a crystal edge in the frame of the scans, degrees counter-clockwise from
    /// x, and its standard uncertainty, as in 12.3±0.2 or 12.3+-0.2; any of the equivalent directions may be given
    #[arg(long, value_name = "DEG±SIGMA", allow_hyphen_values = true, value_parser = parse_angle)]
    lattice_angle: Option<Angle>,
    /// The layer that --lattice-angle belongs to: 1, the lower one and the reference (with equal layers, the one taken
    /// as unstrained), or 2. For a strained layer 2, give the mean over its three directions
    #[arg(long, value_name = "1|2", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2))]
    lattice_angle_layer: u8,
    /// The vector that --lattice-angle belongs to
    #[arg(long, value_enum, default_value_t = DirectionArg::Atomic)]
    lattice_angle_of: DirectionArg,
    /// Atomically resolved images of the layer --lattice-angle-layer, taken with the same scan angle and sensors as the
    /// scans: the program measures the orientation. Frames up and down are best, because their drift can then be
    /// removed
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with_all = ["lattice_angle", "lattice_angle_of"])]
    atomic: Vec<PathBuf>,
    /// Orientation of the other layer, as --lattice-angle. With two equal layers one orientation leaves the sense of
    /// the twist open; two determine it
    #[arg(long, value_name = "DEG±SIGMA", allow_hyphen_values = true, value_parser = parse_angle)]
    lattice_angle_2: Option<Angle>,
    /// The sense of the twist of layer 2 against layer 1, if it is known: positive is counter-clockwise
    #[arg(long, value_enum)]
    twist_sense: Option<SenseArg>,
    /// Channel that shows the atoms [default: as --channel]
    #[arg(long, value_name = "NAME", requires = "atomic")]
    atomic_channel: Option<String>,
}

/// Which vector an orientation is that of.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(crate) enum DirectionArg {
    /// The atomic vector: a row of atoms of a hexagonal layer, a zigzag edge
    #[default]
    Atomic,
    /// The reciprocal vector, 30° from it: an armchair edge, a spot of the Fourier transform
    Reciprocal,
}

/// The sense of a twist.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum SenseArg {
    /// Layer 2 is turned counter-clockwise against layer 1
    Positive,
    /// Layer 2 is turned clockwise
    Negative,
}

impl From<SenseArg> for TwistSense {
    fn from(sense: SenseArg) -> Self {
        match sense {
            SenseArg::Positive => Self::Positive,
            SenseArg::Negative => Self::Negative,
        }
    }
}

/// Degrees and σ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Angle(pub(crate) [f64; 2]);

impl From<DirectionArg> for LatticeDirection {
    fn from(of: DirectionArg) -> Self {
        match of {
            DirectionArg::Atomic => Self::Atomic,
            DirectionArg::Reciprocal => Self::Reciprocal,
        }
    }
}

impl OrientationArgs {
    /// What was given beside the orientation of one layer: that of the other one, and the sense of the twist.
    pub(super) fn apply(&self, settings: &mut Settings) {
        settings.lattice_angle = self.known().or(settings.lattice_angle);
        if let Some(Angle([angle_deg, sigma_deg])) = self.lattice_angle_2 {
            let first = settings.lattice_angle.filter(|_| self.atomic.is_empty());
            settings.lattice_angle_2 = Some(KnownOrientation {
                angle_deg,
                sigma_deg,
                layer: 3 - first.map_or(self.lattice_angle_layer, |known| known.layer),
                of: self.lattice_angle_of.into(),
            });
        }
        settings.twist_sense = self.twist_sense.map(Into::into).or(settings.twist_sense);
    }

    /// The orientation that was given.
    fn known(&self) -> Option<KnownOrientation> {
        let Angle([angle_deg, sigma_deg]) = self.lattice_angle?;
        Some(KnownOrientation {
            angle_deg,
            sigma_deg,
            layer: self.lattice_angle_layer,
            of: self.lattice_angle_of.into(),
        })
    }

    /// The images in which it is to be measured; `None` without any.
    pub(super) fn asked(&self) -> anyhow::Result<Option<AtomicImages>> {
        if self.atomic.is_empty() {
            return Ok(None);
        }
        let mut files = Vec::new();
        for path in expand(&self.atomic, true) {
            match path {
                Ok(path) => files.push(path.display().to_string()),
                Err(one) => anyhow::bail!("--atomic {}: {}", one.file, one.error),
            }
        }
        Ok(Some(AtomicImages {
            files,
            channel: self.atomic_channel.clone(),
            layer: self.lattice_angle_layer,
        }))
    }
}

/// `12.3±0.2`, `12.3+-0.2` or `12.3+/-0.2`.
pub(crate) fn parse_angle(text: &str) -> Result<Angle, String> {
    let parsed = || {
        let (angle, sigma) = ["±", "+/-", "+-"]
            .iter()
            .find_map(|sign| text.split_once(sign))?;
        let number = |part: &str| {
            let plain = part.trim().trim_end_matches('°').trim();
            plain.parse().ok().filter(|x: &f64| x.is_finite())
        };
        let angle = numbers::within(numbers::ANGLE_DEG, number(angle))?;
        let sigma = numbers::within([0.0, 180.0], number(sigma))?;
        Some(Angle([angle, sigma]))
    };
    parsed().ok_or_else(|| {
        format!(
            "expected an angle and its standard uncertainty in degrees, as in 12.3±0.2 or 12.3+-0.2, found \
             {text:?}"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_have_uncertainties() {
        for text in ["12.3±0.2", "12.3 +- 0.2", "12.3°+/-0.2°"] {
            assert_eq!(parse_angle(text), Ok(Angle([12.3, 0.2])), "{text}");
        }
        assert_eq!(parse_angle("-7±0"), Ok(Angle([-7.0, 0.0])));
        for wrong in ["12.3", "12.3±", "±2", "12±-1", "a±1", ""] {
            assert!(parse_angle(wrong).is_err(), "{wrong}");
        }
    }
}

//! What the eye knows better than the search: the options for it.

use std::path::PathBuf;

use anyhow::Context as _;
use moiregauge::settings::{MOST_GRAINS, Settings};
use moiregauge_pipeline::read_mask;
use nalgebra::Vector2;

use crate::numbers;
use crate::places::{length, parse_region};

/// The options for it.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "By hand: which lattice to measure, and where it is")]
pub(crate) struct HandArgs {
    /// Measure the lattice with about these two vectors: x and y of the first, x and y of the second, as in the
    /// results; nm, or with a unit. They may be wrong by 5 % and 3°
    #[arg(long, value_name = "L1X,L1Y,L2X,L2Y", value_parser = parse_lattice, allow_hyphen_values = true, conflicts_with = "near")]
    lattice: Option<[[f64; 2]; 2]>,
    /// Measure the lattice with about this mean wavelength (12nm); it may be wrong by 15 %
    #[arg(long, value_name = "WAVELENGTH", value_parser = parse_length)]
    near: Option<f64>,
    /// Use only some pixels of each frame: those that are not black in this picture, or above zero in this array, of
    /// the same size
    #[arg(long, value_name = "FILE")]
    mask: Option<PathBuf>,
    /// Of scans that show several grains use only this one; sets are named by them: grain 1, grain 2
    #[arg(long, value_name = "N", value_parser = numbers::count(1, MOST_GRAINS))]
    grain: Option<usize>,
    /// The parts of each frame to use, where a command asks for them.
    #[arg(skip)]
    pub(super) parts: Vec<Vec<[f64; 2]>>,
}

impl HandArgs {
    /// Puts them on top of the settings.
    ///
    /// # Errors
    /// The mask cannot be read.
    pub(super) fn apply(&self, settings: &mut Settings) -> anyhow::Result<()> {
        settings.grain = self.grain.or(settings.grain);
        let told = &mut settings.by_hand;
        if self.lattice.is_some() {
            (told.lattice_nm, told.near_nm) = (self.lattice, None);
        }
        if self.near.is_some() {
            (told.lattice_nm, told.near_nm) = (None, self.near);
        }
        told.regions_nm.extend(self.parts.iter().cloned());
        if let Some(path) = &self.mask {
            let mask = read_mask(path);
            told.mask =
                Some(mask.with_context(|| format!("cannot read the mask {}", path.display()))?);
        }
        Ok(())
    }
}

fn parse_lattice(text: &str) -> Result<[[f64; 2]; 2], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(length).collect();
    match numbers.as_deref() {
        Some(&[ax, ay, bx, by]) => Ok([[ax, ay], [bx, by]]),
        _ => Err("expected two vectors in nm, as in 12.1,0.4,6.2,10.5".to_owned()),
    }
}

fn parse_length(text: &str) -> Result<f64, String> {
    length(text)
        .filter(|nm| *nm > 0.0)
        .ok_or_else(|| "expected a wavelength in nm, as in 12nm".to_owned())
}

pub(super) fn parse_part(text: &str) -> Result<Vec<[f64; 2]>, String> {
    // A name, as the regions of a map have one, does no harm.
    let (_, part) = text.split_once('=').unwrap_or(("", text));
    let region = parse_region(&format!("part={part}")).map_err(|error| {
        error
            .replace("a name and, in nm, a box", "in nm a box")
            .replace("bar=", "")
            .replace("flake=", "")
    })?;
    let corners = region.corners.iter();
    Ok(corners.map(|c: &Vector2<f64>| [c.x, c.y]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_and_parts() {
        assert_eq!(
            parse_lattice("12.1,-0.4,6.2nm,0.0105um"),
            Ok([[12.1, -0.4], [6.2, 10.5]])
        );
        assert!(parse_lattice("12,0,6").is_err());
        assert_eq!(parse_part("1,2,3,4").unwrap()[0], [1.0, 2.0]);
        assert_eq!(parse_part("left=0,0 4,0 0,2").unwrap().len(), 3);
        let error = parse_part("1,2,3").unwrap_err();
        assert!(error.contains("expected in nm a box"), "{error}");
        assert!(parse_length("0").is_err() && parse_length("1.2um") == Ok(1200.0));
    }
}

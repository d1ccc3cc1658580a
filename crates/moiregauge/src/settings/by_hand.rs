//! Choices made by hand: which lattice to measure, and where it is.

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

use crate::frame::polygon;

/// Choices made by hand. Nothing by default.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ByHand {
    /// Two vectors of the lattice, x and y in nm, in the axes of the results and before drift is taken out; 5 % off and 3° will do.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lattice_nm: Option<[[f64; 2]; 2]>,
    /// The mean wavelength of the lattice, nm, to 15 %.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub near_nm: Option<f64>,
    /// The parts of the frame to use: the corners of polygons, nm from its lower left corner, along the lines and across them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub regions_nm: Vec<Vec<[f64; 2]>>,
    /// The pixels to use.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mask: Option<Mask>,
}

/// Which pixels of a frame are used.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mask {
    /// Samples in a line.
    pub columns: usize,
    /// Lines.
    pub rows: usize,
    /// Row by row from the bottom: how many pixels are left out, then how many are used, and so on in turn.
    pub runs: Vec<usize>,
}

impl Mask {
    /// A mask from its pixels, row by row from the bottom.
    pub fn new(columns: usize, rows: usize, used: &[bool]) -> Self {
        let mut runs = vec![0];
        let mut last = false;
        for pixel in used {
            if *pixel != last {
                runs.push(0);
                last = *pixel;
            }
            if let Some(run) = runs.last_mut() {
                *run += 1;
            }
        }
        Self {
            columns,
            rows,
            runs,
        }
    }

    /// Whether each pixel is used.
    pub fn used(&self) -> Vec<bool> {
        let runs = self.runs.iter().enumerate();
        runs.flat_map(|(i, run)| std::iter::repeat_n(i % 2 == 1, *run))
            .collect()
    }

    fn problem(&self) -> Option<String> {
        let (columns, rows) = (self.columns, self.rows);
        let found = self
            .runs
            .iter()
            .try_fold(0usize, |sum, run| sum.checked_add(*run));
        if found != columns.checked_mul(rows) {
            return Some(format!(
                "the runs of the mask add up to {found:?} pixels, not to {columns} × {rows}"
            ));
        }
        let used: usize = self.runs.iter().skip(1).step_by(2).sum();
        (used == 0).then(|| "the mask leaves out all pixels".to_owned())
    }
}

impl ByHand {
    /// Whether nothing was told.
    pub fn is_nothing(&self) -> bool {
        *self == Self::default()
    }

    /// Whether it says which lattice is meant.
    pub fn says_which(&self) -> bool {
        self.lattice_nm.is_some() || self.near_nm.is_some()
    }

    /// The lattice, a vector in each column, nm.
    pub fn lattice(&self) -> Option<Matrix2<f64>> {
        let [a, b] = self.lattice_nm?;
        Some(Matrix2::new(a[0], b[0], a[1], b[1]))
    }

    /// What makes no sense in it.
    pub fn problem(&self) -> Option<String> {
        if self.lattice_nm.is_some() && self.near_nm.is_some() {
            return Some("give either the lattice or its wavelength, not both".to_owned());
        }
        if let Some(lattice) = self.lattice() {
            let area = lattice.determinant().abs();
            let sides = lattice.column(0).norm() * lattice.column(1).norm();
            if !(area > 0.1 * sides) {
                return Some(format!(
                    "the two vectors of a lattice must not be parallel or zero, found {:?} nm",
                    self.lattice_nm
                ));
            }
        }
        if let Some(near) = self.near_nm
            && !(near > 0.0 && near.is_finite())
        {
            return Some(format!("the wavelength must be above 0 nm, found {near}"));
        }
        for corners in &self.regions_nm {
            let corners: Vec<Vector2<f64>> = corners.iter().map(|c| Vector2::from(*c)).collect();
            if corners.len() < 3 || !(polygon::area(&corners) > 0.0) {
                return Some(format!(
                    "a part of the frame must be a polygon with at least three corners, found {}",
                    corners.len()
                ));
            }
        }
        self.mask.as_ref().and_then(Mask::problem)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_are_runs() {
        for used in [
            vec![false, false, true, true, false, true],
            vec![true, false, false, false, true, true],
        ] {
            let mask = Mask::new(3, 2, &used);
            assert_eq!(mask.used(), used);
            assert_eq!(mask.problem(), None);
        }
        let none = Mask::new(3, 2, &[false; 6]);
        assert!(none.problem().unwrap().contains("all pixels"));
        let short = Mask {
            columns: 3,
            rows: 2,
            runs: vec![1, 2],
        };
        assert!(short.problem().unwrap().contains("3 × 2"));
    }

    #[test]
    fn nonsense_is_named() {
        let hand = |lattice_nm| ByHand {
            lattice_nm: Some(lattice_nm),
            ..ByHand::default()
        };
        assert_eq!(hand([[10.0, 0.0], [5.0, 8.0]]).problem(), None);
        for wrong in [[[10.0, 0.0], [20.0, 0.0]], [[f64::NAN, 0.0], [5.0, 8.0]]] {
            assert!(hand(wrong).problem().is_some(), "{wrong:?}");
        }
        let line = ByHand {
            regions_nm: vec![vec![[0.0, 0.0], [1.0, 1.0]]],
            ..ByHand::default()
        };
        assert!(line.problem().unwrap().contains("found 2"));
    }
}

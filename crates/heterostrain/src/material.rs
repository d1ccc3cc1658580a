//! The atomic layers: lattice, Poisson ratio, and where the numbers come from.
//!
//! A layer is any two-dimensional lattice: two vectors of lengths a and b with the angle γ between them;
//! hexagonal (b = a, γ = 60°) unless it says otherwise. Two layers make a [`Bilayer`]: layer 1 is the
//! reference, layer 2 lies on it, stretched and turned. The twist of equal layers is proportional to the
//! lattice constant: 0.247 in place of 0.246 nm for graphene is 0.0046° at 1.126°.

mod table;

use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, PI};

use nalgebra::Matrix2;
use serde::{Deserialize, Serialize};

/// An atomic layer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Name, as in `graphene`.
    pub name: String,
    /// Lattice constant a, nm.
    pub lattice_constant_nm: f64,
    /// Second lattice constant b, nm; without it the layer is hexagonal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lattice_constant_b_nm: Option<f64>,
    /// Angle γ between the two lattice vectors, degrees; goes with `lattice_constant_b_nm`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cell_angle_deg: Option<f64>,
    /// Poisson ratio ν: a stretch ε along an axis shrinks the layer by νε across it.
    pub poisson_ratio: f64,
    /// Standard uncertainty of the lattice constant, nm.
    #[serde(default = "lattice_constant_sigma")]
    pub lattice_constant_sigma_nm: f64,
    /// Standard uncertainty of the Poisson ratio.
    #[serde(default = "poisson_ratio_sigma")]
    pub poisson_ratio_sigma: f64,
    /// Where the numbers come from.
    #[serde(default = "given_by_user")]
    pub source: String,
}

fn given_by_user() -> String {
    "given by the user".to_owned()
}

/// For a layer described by the user without saying how well it is known: nm.
fn lattice_constant_sigma() -> f64 {
    0.0005
}

/// For a layer described by the user without saying how well it is known.
fn poisson_ratio_sigma() -> f64 {
    0.03
}

impl Material {
    /// Graphene.
    pub fn graphene() -> Self {
        Self::from_row(&table::GRAPHENE)
    }

    /// Every layer known by name.
    pub fn all() -> Vec<Self> {
        std::iter::once(&table::GRAPHENE)
            .chain(&table::OTHERS)
            .map(Self::from_row)
            .collect()
    }

    /// The layer of that name, upper or lower case, `1T′` with any kind of apostrophe or none.
    pub fn named(name: &str) -> Option<Self> {
        let plain = |text: &str| -> String {
            text.chars()
                .filter(|c| c.is_alphanumeric())
                .flat_map(char::to_lowercase)
                .collect()
        };
        Self::all()
            .into_iter()
            .find(|material| plain(&material.name) == plain(name))
    }

    fn from_row(row: &table::Row) -> Self {
        Self {
            name: row.name.to_owned(),
            lattice_constant_nm: row.a,
            lattice_constant_b_nm: row.cell.map(|(b, _)| b),
            cell_angle_deg: row.cell.map(|(_, angle)| angle),
            poisson_ratio: row.poisson_ratio,
            lattice_constant_sigma_nm: row.a_sigma,
            poisson_ratio_sigma: row.poisson_ratio_sigma,
            source: row.source.to_owned(),
        }
    }

    /// What is wrong with the numbers; `None` where they make sense.
    pub fn problem(&self) -> Option<String> {
        let name = &self.name;
        let positive = |x: f64| x.is_finite() && x > 0.0;
        let (a, ratio) = (self.lattice_constant_nm, self.poisson_ratio);
        if !positive(a) {
            return Some(format!(
                "{name}: expected a lattice constant > 0 nm, found {a}"
            ));
        }
        if !(ratio > -1.0 && ratio < 1.0) {
            return Some(format!(
                "{name}: expected a Poisson ratio between −1 and 1, found {ratio}"
            ));
        }
        match (self.lattice_constant_b_nm, self.cell_angle_deg) {
            (None, None) => None,
            (Some(b), Some(angle)) => {
                let sensible = positive(b) && angle > 20.0 && angle < 160.0;
                (!sensible).then(|| {
                    format!(
                        "{name}: expected lattice_constant_b_nm > 0 and cell_angle_deg between 20 and 160, \
                         found {b} and {angle}"
                    )
                })
            }
            _ => Some(format!(
                "{name}: lattice_constant_b_nm and cell_angle_deg go together; without both the layer is \
                 hexagonal"
            )),
        }
    }

    /// Whether the lattice is hexagonal.
    pub fn is_hexagonal(&self) -> bool {
        let b = self
            .lattice_constant_b_nm
            .unwrap_or(self.lattice_constant_nm);
        let angle = self.cell_angle_deg.unwrap_or(60.0);
        (b / self.lattice_constant_nm - 1.0).abs() < 1e-9
            && ((angle - 60.0).abs() < 1e-9 || (angle - 120.0).abs() < 1e-9)
    }

    /// The angle by which the lattice can be turned without being another one, rad: 60° for a hexagonal,
    /// 90° for a square, 180° for any other lattice.
    pub fn rotation_period(&self) -> f64 {
        let square = self.lattice_constant_b_nm.is_some_and(|b| {
            (b / self.lattice_constant_nm - 1.0).abs() < 1e-9
                && self
                    .cell_angle_deg
                    .is_some_and(|angle| (angle - 90.0).abs() < 1e-9)
        });
        if self.is_hexagonal() {
            FRAC_PI_3
        } else if square {
            FRAC_PI_2
        } else {
            PI
        }
    }

    /// The atomic vectors a and b as columns, nm, for a layer of orientation zero: b along y, a at
    /// 90° − γ, so that the reciprocal vector of a points along x. That of b stands at 90° + (90° − γ).
    pub fn atomic_pair(&self) -> Matrix2<f64> {
        let a = self.lattice_constant_nm;
        let (b, angle) = if self.is_hexagonal() {
            (a, FRAC_PI_3)
        } else {
            let angle = self.cell_angle_deg.unwrap_or(60.0).to_radians();
            (self.lattice_constant_b_nm.unwrap_or(a), angle)
        };
        let (sine, cosine) = angle.sin_cos();
        Matrix2::new(a * sine, 0.0, a * cosine, b)
    }

    /// Angle from the reciprocal vector by which orientations are counted to the atomic vector a (for a
    /// hexagonal lattice: to a zigzag row of atoms), rad.
    pub fn atomic_row_angle(&self) -> f64 {
        let pair = self.atomic_pair();
        pair.m21.atan2(pair.m11)
    }
}

/// Two layers. Layer 1 (`reference`) keeps its shape; layer 2 (`stretched`) is stretched and turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bilayer<'a> {
    /// Layer 1.
    pub reference: &'a Material,
    /// Layer 2.
    pub stretched: &'a Material,
    /// Two wave vectors of the moiré (columns, rad/nm) that belong to the reciprocal vectors of the atoms, if these are
    /// known: the same lattice has other pairs, too. `None`: those that need the least strain.
    pub waves: Option<nalgebra::Matrix2<f64>>,
}

impl<'a> From<&'a Material> for Bilayer<'a> {
    /// Two equal layers.
    fn from(material: &'a Material) -> Self {
        Self {
            reference: material,
            stretched: material,
            waves: None,
        }
    }
}

impl Bilayer<'_> {
    /// Whether both layers have the same lattice.
    pub fn is_equal(&self) -> bool {
        let (a, b) = (self.reference.atomic_pair(), self.stretched.atomic_pair());
        (a - b).norm() < 1e-9 * a.norm()
    }

    /// `graphene`, or `graphene/hBN` for layer 2 on layer 1.
    pub fn name(&self) -> String {
        if self.reference == self.stretched {
            self.reference.name.clone()
        } else {
            format!("{}/{}", self.stretched.name, self.reference.name)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_in_any_case_and_unknown_ones_are_not_guessed() {
        assert_eq!(Material::named("GRAPHENE"), Some(Material::graphene()));
        assert_eq!(
            Material::named(" hbn ").map(|m| m.lattice_constant_nm),
            Some(0.2504)
        );
        assert_eq!(Material::named("unobtainium"), None);
        assert_eq!(Material::named("wte2 1t'"), Material::named("WTe2 1T′"));
        let mut names: Vec<_> = Material::all().into_iter().map(|m| m.name).collect();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), Material::all().len());
        assert!(names.iter().all(|name| Material::named(name).is_some()));
    }

    /// Every row makes sense, says where it comes from, and has an atomic cell of the right area.
    #[test]
    fn rows_are_sound() {
        for material in Material::all() {
            assert_eq!(material.problem(), None);
            assert!(material.source.len() > 10, "{material:?}");
            let (a, area) = (
                material.lattice_constant_nm,
                material.atomic_pair().determinant(),
            );
            let expected = match (material.lattice_constant_b_nm, material.cell_angle_deg) {
                (Some(b), Some(angle)) => a * b * angle.to_radians().sin(),
                _ => a * a * 0.75_f64.sqrt(),
            };
            assert!((area / expected - 1.0).abs() < 1e-12);
        }
    }

    /// 60° and 120° name the same hexagonal lattice; b and γ go together.
    #[test]
    fn cells_in_other_words() {
        let with = |b, angle| Material {
            lattice_constant_b_nm: b,
            cell_angle_deg: angle,
            ..Material::graphene()
        };
        let hexagonal = with(Some(0.246), Some(120.0));
        assert!(hexagonal.is_hexagonal() && hexagonal.problem().is_none());
        assert_eq!(hexagonal.atomic_pair(), Material::graphene().atomic_pair());
        assert!(with(Some(0.3), None).problem().is_some());
        assert!(with(None, Some(90.0)).problem().is_some());
        assert!(with(Some(-0.3), Some(90.0)).problem().is_some());
        let square = with(Some(0.246), Some(90.0));
        assert!((square.rotation_period() - FRAC_PI_2).abs() < 1e-15);
        assert!((with(Some(0.3), Some(90.0)).rotation_period() - PI).abs() < 1e-15);
        // The atomic row of a hexagonal layer lies 30° from the reciprocal vector.
        assert!((hexagonal.atomic_row_angle().to_degrees() - 30.0).abs() < 1e-12);
    }
}

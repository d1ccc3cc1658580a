//! The moiré cell by itself: vectors, lengths, angles, area, carrier density; and cells from three numbers.
//!
//! Units nm, rad, nm⁻². "Three wavelengths" has two meanings that agree only without strain: the lengths of
//! the real-space vectors L₁, L₂, L₂ − L₁, and `4π/(√3|K_j|)` of the three shortest wave vectors. The
//! anisotropy has opposite sign in the two; the same three numbers (13.72, 12.7, 10.18 nm) are 1.190° or 1.152°
//! of graphene. Whoever types numbers in has to say which they are.

use nalgebra::{Matrix2, Matrix4, SMatrix, Vector2};

use crate::lattice::blocks::reciprocal;
use crate::lattice::reduce::{canonical, shortest_pair};
use crate::lattice::vectors::{Lattice, Nm};

/// What three wavelengths are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WavelengthMeaning {
    /// Lengths of the real-space vectors L₁, L₂ and L₂ − L₁.
    RealSpace,
    /// `4π/(√3|K_j|)` of the wave vectors K₁, K₂ and K₂ − K₁.
    KSpace,
}

/// Why three wavelengths make no cell.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CellError {
    /// Not positive numbers.
    #[error("expected three lengths above 0 nm, found {0:?}")]
    NotPositive([f64; 3]),
    /// No triangle has such sides.
    #[error(
        "{lengths:?} nm are not the {what} of a lattice: the longest must be shorter than the sum of the others"
    )]
    NoTriangle {
        /// As given.
        lengths: [f64; 3],
        /// Sides of which triangle, in words.
        what: &'static str,
    },
}

/// One cell of a moiré lattice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MoireCell {
    /// L₁, L₂ (60° to 90° apart, counter-clockwise) and L₂ − L₁, nm.
    pub vectors: [Vector2<f64>; 3],
    /// Wave vectors K₁, K₂ and K₂ − K₁ at 60°, rad/nm.
    pub waves: [Vector2<f64>; 3],
    /// Area of the primitive cell, nm².
    pub area: f64,
}

impl MoireCell {
    /// The cell of a lattice by any pair of its vectors (columns, nm); `None` for parallel ones.
    pub fn new(basis: &Matrix2<f64>) -> Option<Self> {
        let shortest = basis * shortest_pair(basis)?;
        // L₁ between 0° and 60°, where it can be.
        let named = canonical(&Lattice::<Nm>::exact(shortest));
        let basis = if shortest_pair(&named.basis)? == Matrix2::identity() {
            named.basis
        } else {
            shortest
        };
        let pair = reciprocal(&basis)?;
        let three = |m: &Matrix2<f64>| {
            let (a, b): (Vector2<f64>, Vector2<f64>) = (m.column(0).into(), m.column(1).into());
            [a, b, b - a]
        };
        Some(Self {
            vectors: three(&basis),
            waves: three(&pair),
            area: basis.determinant().abs(),
        })
    }

    /// The lattice that the cell was made of, by the first two vectors of the cell.
    pub fn pair_of(&self, lattice: &Lattice) -> Lattice {
        let own = Matrix2::from_columns(&[self.vectors[0], self.vectors[1]]);
        match lattice.basis.try_inverse() {
            Some(inverse) => lattice.relabelled(&(inverse * own).map(f64::round)),
            None => *lattice,
        }
    }

    /// Lengths of the three real-space vectors, nm.
    pub fn wavelengths(&self) -> [f64; 3] {
        self.vectors.map(|v| v.norm())
    }

    /// `4π/(√3|K_j|)`, nm.
    pub fn k_space_wavelengths(&self) -> [f64; 3] {
        self.waves
            .map(|k| 4.0 * std::f64::consts::PI / (3.0_f64.sqrt() * k.norm()))
    }

    /// Angle between L₁ and L₂, rad.
    pub fn angle(&self) -> f64 {
        let [a, b, _] = self.vectors;
        a.perp(&b).atan2(a.dot(&b))
    }

    /// Carriers per nm² that fill a band of `degeneracy` electrons per cell: `g/A`. Graphene, with two spins
    /// and two valleys, has g = 4.
    pub fn density(&self, degeneracy: f64) -> f64 {
        degeneracy / self.area
    }
}

/// The lattice of three wavelengths (nm) with standard uncertainties: the vector of the first one along x,
/// or, in the k-space meaning, its wave vector.
///
/// # Errors
/// [`CellError`] where they are not positive or make no triangle.
pub fn from_wavelengths(
    lengths: [f64; 3],
    sigmas: [f64; 3],
    meaning: WavelengthMeaning,
) -> Result<Lattice, CellError> {
    if !lengths.iter().all(|l| l.is_finite() && *l > 0.0) {
        return Err(CellError::NotPositive(lengths));
    }
    let basis = triangle(lengths, meaning).ok_or(CellError::NoTriangle {
        lengths,
        what: match meaning {
            WavelengthMeaning::RealSpace => "real-space vectors",
            WavelengthMeaning::KSpace => "wave vectors",
        },
    })?;
    let mut jacobian = SMatrix::<f64, 4, 3>::zeros();
    for i in 0..3 {
        let step = 1e-6 * lengths[i];
        let side = |sign: f64| {
            let mut moved = lengths;
            moved[i] += sign * step;
            triangle(moved, meaning).unwrap_or(basis)
        };
        let slope = (side(1.0) - side(-1.0)) / (2.0 * step);
        jacobian.column_mut(i).copy_from_slice(slope.as_slice());
    }
    let errors = SMatrix::<f64, 3, 3>::from_diagonal(&sigmas.map(|s| s * s).into());
    let covariance: Matrix4<f64> = jacobian * errors * jacobian.transpose();
    Ok(Lattice::new(basis, covariance))
}

/// The pair of real-space vectors; `None` where there is no such triangle.
fn triangle(lengths: [f64; 3], meaning: WavelengthMeaning) -> Option<Matrix2<f64>> {
    let sides = match meaning {
        WavelengthMeaning::RealSpace => lengths,
        WavelengthMeaning::KSpace => {
            lengths.map(|l| 4.0 * std::f64::consts::PI / (3.0_f64.sqrt() * l))
        }
    };
    let [a, b, c] = sides;
    let cosine = (a * a + b * b - c * c) / (2.0 * a * b);
    if !(cosine.abs() < 1.0 - 1e-12) {
        return None;
    }
    let pair = Matrix2::new(a, b * cosine, 0.0, b * (1.0 - cosine * cosine).sqrt());
    match meaning {
        WavelengthMeaning::RealSpace => Some(pair),
        WavelengthMeaning::KSpace => reciprocal(&pair),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::Material;
    use crate::strain::convention::StrainConvention::RealSpace;
    use crate::strain::forward::moire_lattice;
    use crate::strain::twist_strain;

    /// The two meanings of 13.72, 12.7 and 10.18 nm: 1.190° and 1.152° of graphene.
    #[test]
    fn the_two_meanings() {
        let graphene = Material::graphene();
        let lengths = [13.72, 12.7, 10.18];
        for (meaning, expected) in [
            (WavelengthMeaning::RealSpace, 1.190),
            (WavelengthMeaning::KSpace, 1.152),
        ] {
            let lattice = from_wavelengths(lengths, [0.0; 3], meaning).unwrap();
            let found = twist_strain(&lattice, &graphene, RealSpace).unwrap();
            let degrees = found.twist.to_degrees();
            assert!((degrees - expected).abs() < 6e-4, "{meaning:?} {degrees}");
            let cell = MoireCell::new(&lattice.basis).unwrap();
            let mut back = match meaning {
                WavelengthMeaning::RealSpace => cell.wavelengths(),
                WavelengthMeaning::KSpace => cell.k_space_wavelengths(),
            };
            back.sort_by(|a, b| b.total_cmp(a));
            let close = back.iter().zip(lengths).all(|(a, b)| (a - b).abs() < 1e-9);
            assert!(close, "{back:?}");
        }
    }

    /// Hexagonal, both meanings are one, and the area is √3/2 λ².
    #[test]
    fn without_strain_the_meanings_are_one() {
        let basis = moire_lattice(0.02, 0.0, 0.0, 0.3, &Material::graphene(), RealSpace).unwrap();
        let cell = MoireCell::new(&basis).unwrap();
        let length = 0.246 / (2.0 * 0.01_f64.sin());
        for found in cell
            .wavelengths()
            .into_iter()
            .chain(cell.k_space_wavelengths())
        {
            assert!((found - length).abs() < 1e-9);
        }
        assert!((cell.area - 0.75_f64.sqrt() * length * length).abs() < 1e-9);
        assert!((cell.angle().to_degrees() - 60.0).abs() < 1e-9);
        assert!((cell.density(4.0) * cell.area - 4.0).abs() < 1e-12);
    }

    /// σ of three equal lengths: the twist of an undistorted moiré goes with their mean.
    #[test]
    fn errors_of_wavelengths() {
        let lattice = from_wavelengths([12.5; 3], [0.03; 3], WavelengthMeaning::RealSpace).unwrap();
        let found = twist_strain(&lattice, &Material::graphene(), RealSpace).unwrap();
        let twist = 2.0 * (0.246_f64 / 25.0).asin();
        let expected = twist * (0.03 / 3.0_f64.sqrt()) / 12.5;
        assert!(
            (found.twist().sigma / expected - 1.0).abs() < 0.01,
            "{found:?}"
        );
    }

    #[test]
    fn what_makes_no_triangle() {
        let of = |lengths| from_wavelengths(lengths, [0.0; 3], WavelengthMeaning::RealSpace);
        assert!(matches!(
            of([1.0, 2.0, 3.1]),
            Err(CellError::NoTriangle { .. })
        ));
        assert!(matches!(
            of([1.0, 2.0, -2.0]),
            Err(CellError::NotPositive(_))
        ));
        assert!(matches!(
            of([1.0, f64::NAN, 2.0]),
            Err(CellError::NotPositive(_))
        ));
        assert_eq!(MoireCell::new(&Matrix2::new(1.0, 2.0, 1.0, 2.0)), None);
    }
}

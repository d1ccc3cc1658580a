//! A moiré in the coordinates of the atoms of one of its layers.
//!
//! In: the atomic lattice A′ of a layer as a frame shows it (nm of the scanner), with its covariance. Drift, gains and skew map the
//! atoms and the moiré alike, A′ = D A and L′ = D L, so that `A′⁻¹ L′ = A⁻¹ L` is free of them. Out: the map `D⁻¹ = R(α) A⁰ A′⁻¹`
//! from these nm to those in which the layer has its lattice constant, and the moiré there, with the covariance of both lattices.
//! [`Ruler::tensors`] makes twist and strain of it, and nothing is left open but the sense of
//! the twist of equal layers: `G₂ = G₁ ± M`.
//!
//! The turn of D is that which keeps the direction of the fast axis ([`Ruler::angle`]): neither drift nor gains turn it.
//!
//! A layer that is itself strained by e makes `(1 + e)⁻¹ F (1 + e)` of the deformation `F = A₂ A₁⁻¹`: trace and determinant stay as
//! they are. The shear part changes by 2 sin θ times that of e, the twist by the product of two strains. The lattice constant of
//! equal layers does not matter.
//!
//! # References
//! Strain of layers from their atomic and moiré lattices together: Artaud et al., Sci. Rep. 6, 25670 (2016);
//! Huder et al., Phys. Rev. Lett. 120, 156405 (2018).

use nalgebra::{Matrix2, Matrix4, Matrix5, Rotation2, SMatrix, Vector2, Vector4, Vector5};

use crate::complex_pair::ComplexPair;
use crate::lattice::vectors::Lattice;
use crate::lattice::{block, labelled_like, renamings};
use crate::material::{Bilayer, Material};
use crate::strain::error::StrainError;
use crate::strain::tensor::{Orientation, StrainTensor, strain_tensors, uniaxial_and_biaxial};
use crate::strain::twist_strain::TwistStrain;

/// The atoms of a layer as the ruler of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ruler {
    /// From the nm of the scanner to those in which the layer has its lattice constant.
    pub map: Matrix2<f64>,
    /// Covariance of (m₁₁, m₂₁, m₁₂, m₂₂) of the map, by the noise of the atomic lattice.
    pub covariance: Matrix4<f64>,
    /// α: orientation of the reciprocal vectors of the layer in those nm, rad.
    pub angle: f64,
}

impl Ruler {
    /// α of a layer of `material` in a frame whose fast axis points along `fast`: that at which this axis is not turned; `None` for a
    /// lattice without area.
    pub fn angle(atoms: &Lattice, material: &Material, fast: &Vector2<f64>) -> Option<f64> {
        let free = material.atomic_pair();
        let along = free * named_like(atoms, &free)?.basis.try_inverse()? * fast;
        Some(along.perp(fast).atan2(along.dot(fast)))
    }

    /// The ruler of a frame by the atomic lattice of a layer of `material` that has the orientation `angle`; `None` for a lattice
    /// without area.
    pub fn new(atoms: &Lattice, material: &Material, angle: f64) -> Option<Self> {
        let free = Rotation2::new(angle).into_inner() * material.atomic_pair();
        let named = labelled_like(&named_like(atoms, &free)?, &free);
        let inverse = named.basis.try_inverse()?;
        let map = free * inverse;
        let mut slopes = Matrix4::zeros();
        for component in 0..4 {
            let mut unit = Matrix2::zeros();
            unit[component] = 1.0;
            let change = -(map * unit * inverse);
            slopes.set_column(component, &Vector4::from_column_slice(change.as_slice()));
        }
        Some(Self {
            map,
            covariance: slopes * named.covariance * slopes.transpose(),
            angle,
        })
    }

    /// A lattice of the same frame (nm of the scanner, errors independent of those of the atoms) in nm of the ruler.
    pub fn measured(&self, lattice: &Lattice) -> Lattice {
        let mut found = lattice.mapped(&self.map);
        let (i, b) = (Matrix2::identity(), &lattice.basis);
        let lever = block(&(i * b.m11), &(i * b.m21), &(i * b.m12), &(i * b.m22));
        found.covariance += lever * self.covariance * lever.transpose();
        found
    }

    /// Twist and strain of a moiré in nm of the ruler, which is layer 1 of `bilayer` or layer 2: every solution, as
    /// [`strain_tensors`] has them, with the covariance of the lattice.
    ///
    /// # Errors
    /// As [`strain_tensors`].
    pub fn tensors(
        &self,
        lattice: &Lattice,
        bilayer: Bilayer<'_>,
        layer: u8,
    ) -> Result<Vec<StrainTensor>, StrainError> {
        let orientation = Orientation {
            angle: self.angle,
            sigma: 0.0,
            of_reference: true,
        };
        if layer == 1 {
            return strain_tensors(lattice, bilayer, &orientation);
        }
        // The ruler is the layer that keeps its shape.
        let exchanged = Bilayer {
            reference: bilayer.stretched,
            stretched: bilayer.reference,
            waves: bilayer.waves,
        };
        let all = strain_tensors(lattice, exchanged, &orientation)?;
        let mut found: Vec<_> = all.iter().map(StrainTensor::of_exchanged_layers).collect();
        let equal = bilayer.is_equal();
        found.sort_by_key(|t| equal && t.twist < 0.0);
        Ok(found)
    }
}

/// A lattice under the names that distort the pair `free` least; `None` without area.
pub fn named_like(lattice: &Lattice, free: &Matrix2<f64>) -> Option<Lattice> {
    let inverse = free.try_inverse()?;
    let distortion = |f: &Matrix2<f64>| ComplexPair::from(*f).distortion();
    // Two rounds reach every name of a pair that is nearly reduced.
    let mut best = *lattice;
    for _ in 0..2 {
        let start = best;
        for change in renamings(1) {
            let named = start.relabelled(&change);
            let f = named.basis * inverse;
            if f.determinant() > 0.0
                && distortion(&f) < distortion(&(best.basis * inverse)) * (1.0 - 1e-9)
            {
                best = named;
            }
        }
    }
    ((best.basis * inverse).determinant() > 0.0).then_some(best)
}

impl StrainTensor {
    /// What a strain of the ruler brings about: covariance of `(θ, α, mean, shear)` for one whose components along x and y are
    /// independent with the standard deviation `sigma`, in any coordinates.
    pub fn error_of_strained_ruler(&self, sigma: f64) -> Matrix5<f64> {
        let part = |e: &Matrix2<f64>| {
            let change = central(|side| {
                let strain = Matrix2::identity() + e * side;
                let inverse = strain.try_inverse().unwrap_or_else(Matrix2::identity);
                Self::of_deformation(strain * self.deformation() * inverse)
            });
            change * change.transpose()
        };
        let shear = sigma / std::f64::consts::SQRT_2;
        part(&Matrix2::new(sigma, 0.0, 0.0, 0.0))
            + part(&Matrix2::new(0.0, 0.0, 0.0, sigma))
            + part(&Matrix2::new(0.0, shear, shear, 0.0))
    }

    /// The same layers with their names exchanged.
    #[must_use]
    fn of_exchanged_layers(&self) -> Self {
        let step = 1e-6;
        let values = |moved: &Self| {
            let inverse = moved.deformation().try_inverse();
            let mut found = Self::of_deformation(inverse.unwrap_or_else(Matrix2::identity));
            found[1] = moved.lattice_angle + moved.twist;
            found
        };
        let by = |component: usize| {
            central(|side| {
                let mut moved = *self;
                let value = match component {
                    0 => &mut moved.twist,
                    1 => &mut moved.lattice_angle,
                    2 => &mut moved.mean,
                    _ => &mut moved.shear[component - 3],
                };
                *value += side * step;
                values(&moved)
            }) / step
        };
        let slopes = Matrix5::from_columns(&[0, 1, 2, 3, 4].map(by));
        let found = values(self);
        Self {
            twist: found[0],
            lattice_angle: found[1],
            mean: found[2],
            shear: Vector2::new(found[3], found[4]),
            covariance: slopes * self.covariance * slopes.transpose(),
        }
    }

    /// F: what makes layer 2 of layer 1 in the laboratory, over the ratio of their free sizes.
    fn deformation(&self) -> Matrix2<f64> {
        let (c, s) = (self.shear.x, self.shear.y);
        let stretch = Matrix2::new(1.0 + self.mean + c, s, s, 1.0 + self.mean - c);
        stretch * Rotation2::new(self.twist).into_inner()
    }

    /// `(θ, 0, mean, shear)` of a deformation: its polar decomposition.
    fn of_deformation(f: Matrix2<f64>) -> Vector5<f64> {
        let ComplexPair { p, q } = f.into();
        let shear = q * p / p.norm();
        Vector5::new(p.arg(), 0.0, p.norm() - 1.0, shear.re, shear.im)
    }

    /// Twist and strain with the uniaxial part of the strain alone, tension along its larger principal axis, for a layer of the
    /// Poisson ratio ν.
    pub fn uniaxial(&self, poisson_ratio: f64) -> TwistStrain {
        let shear = self.shear.norm().max(1e-9);
        let per_shear = uniaxial_and_biaxial(self.mean, shear, poisson_ratio)[0] / shear;
        let mut select = SMatrix::<f64, 4, 5>::zeros();
        (select[(0, 0)], select[(1, 1)]) = (1.0, 1.0);
        (select[(2, 3)], select[(3, 4)]) = (per_shear, per_shear);
        TwistStrain {
            twist: self.twist,
            lattice_angle: self.lattice_angle,
            strain_vector: self.shear * per_shear,
            covariance: select * self.covariance * select.transpose(),
        }
    }
}

/// Half the difference of the two sides.
fn central(of: impl Fn(f64) -> Vector5<f64>) -> Vector5<f64> {
    (of(1.0) - of(-1.0)) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWIST: f64 = 0.045;

    /// Twist, half a per cent of mean strain and a shear part.
    fn deformation() -> Matrix2<f64> {
        Matrix2::new(1.004, 0.001, 0.001, 1.0) * Rotation2::new(TWIST).into_inner()
    }

    /// The atoms of layer 1 and 2 for a deformation, of which `ruler` is free, and the moiré, as a frame shows them.
    fn seen(
        bilayer: Bilayer<'_>,
        ruler: u8,
        strain: &Matrix2<f64>,
        frame: &Matrix2<f64>,
    ) -> [Matrix2<f64>; 2] {
        let [first, second] = [bilayer.reference, bilayer.stretched];
        let ratio = second.lattice_constant_nm / first.lattice_constant_nm;
        let f = deformation() * ratio;
        let turn = strain * Rotation2::new(0.3).into_inner();
        let atoms = if ruler == 1 {
            let first = turn * first.atomic_pair();
            [first, f * first]
        } else {
            let second = turn * second.atomic_pair();
            [f.try_inverse().unwrap() * second, second]
        };
        // Waves are the transposed inverse: G = G₂ − G₁.
        let [one, two] = atoms.map(|a| a.try_inverse().unwrap());
        let moire = (two - one).try_inverse().unwrap();
        [frame * atoms[usize::from(ruler) - 1], frame * moire]
    }

    fn found(
        bilayer: Bilayer<'_>,
        ruler: u8,
        strain: &Matrix2<f64>,
        frame: &Matrix2<f64>,
    ) -> StrainTensor {
        let [atoms, moire] = seen(bilayer, ruler, strain, frame).map(Lattice::exact);
        let material = [bilayer.reference, bilayer.stretched][usize::from(ruler) - 1];
        let of = Ruler::new(
            &atoms,
            material,
            Ruler::angle(&atoms, material, &Vector2::x()).unwrap(),
        )
        .unwrap();
        let all = of.tensors(&of.measured(&moire), bilayer, ruler).unwrap();
        let off = |t: &StrainTensor| (t.twist - TWIST).abs();
        all.into_iter()
            .min_by(|a, b| off(a).total_cmp(&off(b)))
            .unwrap()
    }

    /// Atoms of either layer and the moiré through any linear map: the layers as they are, equal or not.
    #[test]
    fn the_scanner_drops_out() {
        let (graphene, hbn) = (Material::graphene(), Material::named("hBN").unwrap());
        let frame = Matrix2::new(1.03, 0.02, -0.01, 0.97);
        let truth = StrainTensor::of_deformation(deformation());
        for stretched in [&graphene, &hbn] {
            let bilayer = Bilayer {
                reference: &graphene,
                stretched,
                waves: None,
            };
            for ruler in [1, 2] {
                let tensor = found(bilayer, ruler, &Matrix2::identity(), &frame);
                assert!(
                    (tensor.twist - truth[0]).abs() < 1e-10,
                    "{} {ruler}",
                    stretched.name
                );
                assert!((tensor.mean - truth[2]).abs() < 1e-10);
                assert!(
                    (tensor.shear.norm() - Vector2::new(truth[3], truth[4]).norm()).abs() < 1e-10
                );
            }
        }
    }

    /// The covariance of the moiré in the ruler is that of both lattices, by differences.
    #[test]
    fn both_lattices_have_errors() {
        let graphene = Material::graphene();
        let [atoms, moire] = seen(
            Bilayer::from(&graphene),
            1,
            &Matrix2::identity(),
            &Matrix2::identity(),
        );
        let [small, large] = [1e-6, 1e-3];
        let with = |basis, sigma: f64| Lattice::new(basis, Matrix4::identity() * sigma * sigma);
        let of = |atoms: Matrix2<f64>, moire: Matrix2<f64>| {
            let ruler = Ruler::new(&with(atoms, small), &graphene, 0.3).unwrap();
            ruler.measured(&with(moire, large))
        };
        let covariance = of(atoms, moire).covariance;
        let mut numeric = Matrix4::zeros();
        for (matrix, sigma) in [(0, small), (1, large)] {
            for component in 0..4 {
                let side = |sign: f64| {
                    let mut moved = [atoms, moire];
                    moved[matrix][component] += sign * sigma;
                    of(moved[0], moved[1]).flat()
                };
                let change = (side(1.0) - side(-1.0)) / 2.0;
                numeric += change * change.transpose();
            }
        }
        assert!((covariance - numeric).norm() < 1e-4 * numeric.norm());
    }

    /// A strain of the ruler leaves the mean strain, and changes twist and shear as is stated.
    #[test]
    fn a_strained_ruler_changes_the_shear() {
        let graphene = Material::graphene();
        let with = |e: Matrix2<f64>| {
            let strain = Matrix2::identity() + e;
            found(Bilayer::from(&graphene), 1, &strain, &Matrix2::identity())
        };
        let sigma = 1e-3;
        let free = with(Matrix2::zeros());
        let mut numeric = Matrix5::<f64>::zeros();
        let shear = sigma / std::f64::consts::SQRT_2;
        for e in [
            Matrix2::new(sigma, 0.0, 0.0, 0.0),
            Matrix2::new(0.0, 0.0, 0.0, sigma),
            Matrix2::new(0.0, shear, shear, 0.0),
        ] {
            let [one, other] = [with(e), with(-e)];
            let change = Vector2::new(
                one.twist - other.twist,
                one.shear.norm() - other.shear.norm(),
            ) / 2.0;
            assert!((one.mean - free.mean).abs() < 2e-6);
            numeric[(0, 0)] += change.x * change.x;
            numeric[(3, 3)] += change.y * change.y;
        }
        let stated = free.error_of_strained_ruler(sigma);
        assert!((stated[(0, 0)] / numeric[(0, 0)] - 1.0).abs() < 0.02);
        let axis = free.shear.normalize();
        let length = (axis.transpose() * stated.fixed_view::<2, 2>(3, 3) * axis)[0];
        assert!((length / numeric[(3, 3)] - 1.0).abs() < 0.02);
        assert!(length < (2.0 * TWIST * sigma).powi(2));
    }
}

//! What a person may choose in place of the program: the name of a lattice, and so its twist and strain, or the grain.

use moiregauge::campaign::{Analysis, SetAnalysis};
use moiregauge::caveat::{Caveat, Doubt, LatticeDoubt, OtherGrain};
use moiregauge::meaning::{NameReading, Naming};
use moiregauge_report::results::{NameResult, NamesResult};
use nalgebra::Matrix2;
use serde::Serialize;

/// A name of the lattice.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NameChoice {
    /// As in `results.json`.
    #[serde(flatten)]
    pub name: NameResult,
    /// The setting that chooses it.
    pub moire_waves: [[f64; 2]; 2],
}

/// The names of the lattice that the headline is about, the reported one first; none for layers of dissimilar lattices.
pub fn names(analysis: &Analysis) -> Vec<NameChoice> {
    let combined = analysis.combined.as_ref();
    let combined = combined.map(|all| (&all.lattice.basis, &all.readings));
    let of_set = || {
        let means = analysis.sets.iter();
        let mut means = means.filter_map(|set| set.mean.as_ref().or(set.uncorrected.as_ref()));
        means
            .next()
            .map(|mean| (&mean.lattice.basis, &mean.readings))
    };
    let Some((lattice, readings)) = combined.or_else(of_set) else {
        return Vec::new();
    };
    let named = |naming: &Naming| {
        let told = NamesResult::from(naming).names;
        let both = naming.names.iter().zip(told);
        let choice = |(reading, name): (&NameReading, NameResult)| {
            let waves = reading.name.waves(lattice)?;
            Some(NameChoice {
                name,
                moire_waves: [0, 1].map(|i| [waves[(0, i)], waves[(1, i)]]),
            })
        };
        both.filter_map(choice).collect()
    };
    readings.naming.as_ref().map(named).unwrap_or_default()
}

/// A grain beside the one that was measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GrainChoice {
    /// Its share of the frame.
    pub share: f64,
    /// About its vectors, nm, in the axes of the results. A region around it chooses it.
    pub lattice_nm: [[f64; 2]; 2],
}

/// The other grains of a file, by the words about it or about its set.
pub fn grains(analysis: &Analysis, file: &str) -> Vec<GrainChoice> {
    let of_set = |set: &SetAnalysis| {
        let line = set.scans.iter().find(|s| s.file == file)?.lines.first()?;
        let told = |caveat: &Caveat| caveat.place == file || caveat.place == set.name;
        let mut told = analysis.caveats.iter().filter(|caveat| told(caveat));
        let others = told.find_map(|caveat| match &caveat.doubt {
            Doubt::Lattice(LatticeDoubt::SeveralGrains { others }) => Some(others),
            _ => None,
        })?;
        let choice = |grain: &OtherGrain| GrainChoice {
            share: grain.share,
            lattice_nm: like(&line.sensor.basis, grain.wavelengths, grain.turned),
        };
        Some(others.iter().map(choice).collect())
    };
    let mut sets = analysis.sets.iter();
    sets.find_map(of_set).unwrap_or_default()
}

/// A lattice of these wavelengths that is turned against another one by an angle: a start, which may be some degrees off.
fn like(lattice: &Matrix2<f64>, [a, b, c]: [f64; 3], turned: f64) -> [[f64; 2]; 2] {
    let between = ((a * a + b * b - c * c) / (2.0 * a * b)).clamp(-1.0, 1.0);
    let half = 0.5 * between.acos().copysign(lattice.determinant());
    let middle = lattice.column(0).normalize() + lattice.column(1).normalize();
    let middle = middle.y.atan2(middle.x) + turned;
    let at = |length: f64, angle: f64| [length * angle.cos(), length * angle.sin()];
    [at(a, middle - half), at(b, middle + half)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grain_is_told_by_its_wavelengths_and_its_turn() {
        let lattice = Matrix2::new(10.0, 4.0, 1.0, 9.5);
        let turned = 0.4_f64;
        let (sin, cos) = turned.sin_cos();
        for mirrored in [1.0, -1.0] {
            let here =
                Matrix2::from_columns(&[lattice.column(0) * 1.0, lattice.column(1) * mirrored]);
            let there = 1.1 * Matrix2::new(cos, -sin, sin, cos) * here;
            let lengths = [
                there.column(0).norm(),
                there.column(1).norm(),
                (there.column(1) - there.column(0)).norm(),
            ];
            let found = like(&here, lengths, turned);
            for (column, vector) in found.iter().enumerate() {
                for (row, number) in vector.iter().enumerate() {
                    assert!((number - there[(row, column)]).abs() < 1e-9);
                }
            }
        }
    }
}

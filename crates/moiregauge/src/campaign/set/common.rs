//! Errors that all images of a set have alike.

use nalgebra::{Matrix2, Matrix4, Vector4};

use crate::campaign::set::ground::of_ground;
use crate::scan::measured::{MeasuredLine, MeasuredScan};

/// The covariance (nm²) that the lattice of a set has beside that of its fit, in which the errors of images are independent.
pub(crate) fn common(used: &[&MeasuredScan], reference: &Matrix2<f64>) -> Matrix4<f64> {
    let lines: Vec<&MeasuredLine> = used.iter().flat_map(|scan| &scan.lines).collect();
    let found = lines.iter().map(|line| line.common(reference));
    let found: Vec<(Vector4<f64>, Matrix4<f64>)> = found.map(Option::unwrap_or_default).collect();
    let n = found.len().max(1) as f64;
    let off = found.iter().map(|(off, _)| off).sum::<Vector4<f64>>() / n;
    let edges = found.iter().map(|(_, edges)| edges).sum::<Matrix4<f64>>() / n;
    let off = off * off.transpose() * beyond_chance(&off, found.iter().map(|(off, _)| off));
    // Each image has it once; the mean of n keeps one part in n of that.
    (off + edges) * (1.0 - 1.0 / n) + of_ground(used, reference)
}

/// The share of the square of a mean that its scatter does not explain; all of it where there is none.
fn beyond_chance<'a>(mean: &Vector4<f64>, all: impl Iterator<Item = &'a Vector4<f64>>) -> f64 {
    let squares: Vec<f64> = all.map(|one| (one - mean).norm_squared()).collect();
    let n = squares.len() as f64;
    let by_chance = squares.iter().sum::<f64>() / (n * (n - 1.0)).max(1.0);
    if by_chance == 0.0 {
        return 1.0;
    }
    (1.0 - by_chance / mean.norm_squared()).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What all images say counts; what half of them say with the opposite sign is noise.
    #[test]
    fn what_is_common_is_no_noise() {
        let one = Vector4::new(1.0, -2.0, 0.5, 0.0);
        let share = |all: &[Vector4<f64>]| {
            let mean = all.iter().sum::<Vector4<f64>>() / all.len() as f64;
            beyond_chance(&mean, all.iter())
        };
        assert_eq!(share(&[one; 4]), 1.0);
        assert_eq!(share(&[one]), 1.0);
        assert_eq!(share(&[one, -one, one, -one * 0.9]), 0.0);
        let nearly = share(&[one, one * 1.2, one * 0.8, one]);
        assert!((0.98..1.0).contains(&nearly), "{nearly}");
    }
}

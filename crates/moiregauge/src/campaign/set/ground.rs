//! What frames of one sample show beside its lattice, and what that does to the error of their mean.
//!
//! Rough ground and stripes are in every frame. The noise that they make is read by each fit, but the mean of n frames is no better for it
//! than one: `v (ρ + (1 − ρ)/n)` for frames of variance v whose errors have the correlation ρ.

use heterostrain::lattice::{Lattice, Px, labelled_like};
use nalgebra::{Matrix2, Matrix4};

use crate::lattice::LatticeFit;
use crate::scan::measured::{MeasuredLine, MeasuredScan};
use crate::scan::shared::correlation_of_frames;

/// Number of following frames that a frame is compared with: all pairs of many frames would add nothing.
const NEXT: usize = 4;
/// Frames whose axes differ by more (cosine of 25°) are not compared: their pixels lie otherwise.
const ALONG: f64 = 0.9;

/// The covariance (nm²) that the lattice of a set has beside that of its fit, in which the errors of frames are independent.
pub(crate) fn of_ground(used: &[&MeasuredScan], reference: &Matrix2<f64>) -> Matrix4<f64> {
    let (mut all, mut lines) = (Matrix4::zeros(), 0.0_f64);
    let share = share(used);
    if share == 0.0 {
        return all;
    }
    for scan in used {
        // Errors of trace and retrace are enlarged already by what they share, which is this as well.
        let alone = if scan.lines.len() > 1 {
            1.0 + share
        } else {
            1.0
        };
        for line in &scan.lines {
            let pixels = &line.lattice.pixels;
            let common = Lattice::<Px>::new(pixels.basis, pixels.covariance * (share / alone));
            all += labelled_like(&common.in_nm(&line.geometry.pixel_to_nm), reference).covariance;
            lines += 1.0;
        }
    }
    let frames = used.len() as f64;
    all / lines.max(1.0) * (1.0 - frames.recip())
}

/// The mean correlation of the errors of two frames.
fn share(used: &[&MeasuredScan]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (i, first) in used.iter().enumerate() {
        for second in used.iter().skip(i + 1).take(NEXT) {
            for (a, b) in pairs(first, second) {
                sum += correlation_of_frames(a, b);
                count += 1.0;
            }
        }
    }
    if count > 0.0 { sum / count } else { 0.0 }
}

/// The fits to their images of one line direction, where the pixels lie alike.
fn pairs<'a>(
    first: &'a MeasuredScan,
    second: &'a MeasuredScan,
) -> impl Iterator<Item = (&'a LatticeFit, &'a LatticeFit)> {
    let of_line = |a: &'a MeasuredLine| {
        let b = second.lines.iter().find(|b| b.line == a.line)?;
        lie_alike(a, b).then_some(())?;
        Some((a.lattice.fit.as_ref()?, b.lattice.fit.as_ref()?))
    };
    first.lines.iter().filter_map(of_line)
}

/// Whether lines and columns of two images point the same way.
fn lie_alike(a: &MeasuredLine, b: &MeasuredLine) -> bool {
    let [a, b] = [a, b].map(|line| line.geometry.pixel_to_nm);
    (0..2).all(|i| {
        let (a, b) = (a.column(i), b.column(i));
        a.dot(&b) > ALONG * a.norm() * b.norm()
    })
}

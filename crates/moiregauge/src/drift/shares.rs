//! The covariance of a lattice, split by where it comes from.
//!
//! A least-squares fit of lattice and drift to independent observations with covariances
//! `C_i = image_i + sensor_i` has the covariance Σ. Held at a known drift it would be
//! `P = (Σ C_i⁻¹)⁻¹` (the Schur complement), which is never larger; `Σ − P` is what the drift adds. P
//! itself is `P Σ C_i⁻¹ C_i C_i⁻¹ P`, a sum over observations that splits like the `C_i`. So the three
//! parts add up to Σ exactly.

use nalgebra::Matrix4;

/// Covariances of lattice vectors `(a1x, a1y, a2x, a2y)` that add up to that of the lattice, nm².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Statistical {
    /// Image noise, drift and sensors known.
    pub image: Matrix4<f64>,
    /// What not knowing the drift adds; NaN where a drift is left in and nothing tells how much.
    pub drift: Matrix4<f64>,
    /// Sensor noise, drift known.
    pub sensor: Matrix4<f64>,
}

impl Statistical {
    /// From the parts at known drift (image, sensor), enlarged by `scale`, and the whole.
    pub fn at_known_drift(parts: [Matrix4<f64>; 2], scale: f64, whole: &Matrix4<f64>) -> Self {
        let [image, sensor] = parts.map(|part| part * scale);
        Self {
            image,
            drift: whole - image - sensor,
            sensor,
        }
    }

    /// From the parts of a mean in which the drift is left.
    pub fn without_drift(image: &Matrix4<f64>, sensor: &Matrix4<f64>) -> Self {
        Self {
            image: *image,
            drift: Matrix4::from_element(f64::NAN),
            sensor: *sensor,
        }
    }

    /// All three together.
    pub fn whole(&self) -> Matrix4<f64> {
        self.image + self.drift + self.sensor
    }

    /// The parts of the weighted mean of independent lattices, enlarged by `scale`.
    pub fn of_mean(parts: &[Self], scale: f64) -> Option<Self> {
        let wholes: Vec<Matrix4<f64>> = parts.iter().map(Self::whole).collect();
        let part = |of: fn(&Self) -> Matrix4<f64>| {
            let pairs = wholes.iter().zip(parts);
            let pairs: Vec<_> = pairs.map(|(whole, p)| (*whole, of(p))).collect();
            weighted_mean(&pairs, 0.0).map(|(_, share)| share * scale)
        };
        Some(Self {
            image: part(|p| p.image)?,
            drift: part(|p| p.drift)?,
            sensor: part(|p| p.sensor)?,
        })
    }
}

/// Covariance of the weighted mean of observations, and the part of it that comes from a part of each
/// of their covariances: pairs of (whole, part). `floor` is a variance that is added to each whole.
pub(crate) fn weighted_mean(
    observed: &[(Matrix4<f64>, Matrix4<f64>)],
    floor: f64,
) -> Option<(Matrix4<f64>, Matrix4<f64>)> {
    let mut normal = Matrix4::zeros();
    let mut shares = Matrix4::zeros();
    for (whole, part) in observed {
        let weight = (whole + Matrix4::identity() * floor).try_inverse()?;
        normal += weight;
        shares += weight * part * weight;
    }
    let mean = normal.try_inverse()?;
    Some((mean, mean * shares * mean))
}

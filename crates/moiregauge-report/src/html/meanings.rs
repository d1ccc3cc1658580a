//! What else a lattice can mean, in words.

use serde::Serialize;

use super::words::{plain, shown};
use crate::draw::scale::fixed;
use crate::format::two_digits;
use crate::results::{ReadingsResult, SolutionResult, StrainTensorResult, TensorNumbers};

/// The readings of a lattice.
#[derive(Debug, Serialize)]
pub(super) struct Meanings {
    differ: bool,
    /// What takes the place of the twist in the headline, and why: the tensor's, or all readings.
    headline: Option<[String; 2]>,
    /// Twist, strain and axis of every solution that a user has to choose from.
    choices: Vec<[String; 3]>,
    /// Isotropic strain and what it does to the twist.
    shifts: Vec<[String; 2]>,
    prior: String,
    interval: Option<[String; 2]>,
    tensor: Option<Tensor>,
}

/// The strain tensor.
#[derive(Debug, Serialize)]
struct Tensor {
    twist: String,
    twist_total: String,
    mean: String,
    mean_total: String,
    shear: String,
    shear_total: String,
    axis: String,
    lattice_angle: String,
    /// Uniaxial part, its axis, biaxial part.
    splits: Vec<[String; 3]>,
    /// Twist and mean strain.
    alternatives: Vec<[String; 2]>,
}

impl Meanings {
    pub(super) fn new(readings: &ReadingsResult) -> Self {
        let choices: Vec<[String; 3]> = readings
            .solutions
            .iter()
            .filter(|s| !s.strain_dominated && s.twist_deg.value.is_some_and(|t| t > 0.0))
            .map(choice)
            .collect();
        let headline = match &readings.strain_tensor {
            Some(tensor) => Some([
                "with the orientation of a layer".to_owned(),
                format!("({})°", shown(tensor.found.twist_deg)),
            ]),
            None if readings.layers_differ && !choices.is_empty() => {
                let twists: Vec<&str> = choices.iter().map(|c| c[0].as_str()).collect();
                Some(["the layers differ".to_owned(), twists.join(" or ")])
            }
            None => None,
        };
        let isotropic = readings.isotropic_strain.as_ref();
        Self {
            differ: readings.layers_differ,
            headline,
            choices,
            shifts: isotropic.map_or_else(Vec::new, |found| {
                let shifts = found.shifts.iter();
                shifts
                    .map(|s| {
                        let change = s
                            .twist_change_deg
                            .map_or_else(|| "no twist".to_owned(), |c| signed(c, 4, "°"));
                        [signed(s.isotropic_strain_percent, 1, " %"), change]
                    })
                    .collect()
            }),
            prior: isotropic.map_or_else(String::new, |found| format!("{} %", found.prior_percent)),
            interval: isotropic.map(|found| {
                found
                    .twist_interval_deg
                    .map(|end| format!("{}°", plain(end, 4)))
            }),
            tensor: readings.strain_tensor.as_ref().map(tensor),
        }
    }
}

fn choice(solution: &SolutionResult) -> [String; 3] {
    [
        format!("({})°", shown(solution.twist_deg)),
        format!("({}) %", shown(solution.strain_percent)),
        format!("{}°", plain(solution.strain_axis_lab_deg, 2)),
    ]
}

fn tensor(found: &StrainTensorResult) -> Tensor {
    let TensorNumbers {
        twist_deg,
        lattice_angle_deg,
        mean_strain_percent,
        shear_percent,
        axis_lab_deg,
        ..
    } = found.found;
    let total = |sigma: Option<f64>, unit: &str| {
        sigma.map_or_else(|| "–".to_owned(), |s| format!("{}{unit}", two_digits(s)))
    };
    Tensor {
        twist: format!("({})°", shown(twist_deg)),
        twist_total: total(found.total.twist_deg, "°"),
        mean: format!("({}) %", shown(mean_strain_percent)),
        mean_total: total(found.total.mean_strain_percent, " %"),
        shear: format!("({}) %", shown(shear_percent)),
        shear_total: total(found.total.shear_percent, " %"),
        axis: axis_lab_deg.map_or_else(
            || "not significant".to_owned(),
            |a| format!("({})°", shown(a)),
        ),
        lattice_angle: format!("({})°", shown(lattice_angle_deg)),
        splits: found
            .splits
            .iter()
            .map(|s| {
                [
                    format!("({}) %", shown(s.uniaxial_percent)),
                    s.axis_lab_deg
                        .map_or_else(|| "–".to_owned(), |a| format!("({})°", shown(a))),
                    format!("({}) %", shown(s.biaxial_percent)),
                ]
            })
            .collect(),
        alternatives: found
            .alternatives
            .iter()
            .map(|a| {
                let twist = format!("({})°", shown(a.twist_deg));
                [twist, format!("({}) %", shown(a.mean_strain_percent))]
            })
            .collect(),
    }
}

/// A number with its sign.
fn signed(value: f64, decimals: usize, unit: &str) -> String {
    let sign = if value > 0.0 { "+" } else { "" };
    format!("{sign}{}{unit}", fixed(value, decimals))
}

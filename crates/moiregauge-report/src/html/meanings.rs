//! What else a lattice can mean, in words.

use serde::Serialize;

use super::words::{plain, shown, statistical};
use crate::draw::scale::fixed;
use crate::results::{ReadingsResult, SolutionResult, StrainTensorResult, TensorNumbers};

/// The readings of a lattice.
#[derive(Debug, Serialize)]
pub(super) struct Meanings {
    differ: bool,
    /// Why, what takes the place of the twist in the headline (the tensor's, or all readings), and its statistical
    /// part.
    headline: Option<[String; 3]>,
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
    mean: String,
    shear: String,
    /// The same with their statistical σ.
    statistical: [String; 3],
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
                format!("({})°", statistical(tensor.found.twist_deg)),
            ]),
            None if readings.layers_differ && !choices.is_empty() => {
                let twists: Vec<&str> = choices.iter().map(|c| c[0].as_str()).collect();
                Some([
                    "the layers differ".to_owned(),
                    twists.join(" or "),
                    "the σ shown".to_owned(),
                ])
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
    Tensor {
        twist: format!("({})°", shown(twist_deg)),
        mean: format!("({}) %", shown(mean_strain_percent)),
        shear: format!("({}) %", shown(shear_percent)),
        statistical: [
            format!("({})°", statistical(twist_deg)),
            format!("({}) %", statistical(mean_strain_percent)),
            format!("({}) %", statistical(shear_percent)),
        ],
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

//! What else a lattice can mean, in words.

use serde::Serialize;

use super::words::{plain, shown, statistical};
use crate::draw::scale::fixed;
use crate::results::{NamesResult, ReadingsResult, SolutionResult, SplitResult, TensorNumbers};

/// The solutions of a lattice.
#[derive(Debug, Serialize)]
pub(super) struct Meanings {
    differ: bool,
    /// Why, what takes the place of the twist in the headline (the tensor's, or all solutions), and its statistical
    /// part.
    headline: Option<[String; 3]>,
    /// Twist, strain and axis of every solution that a user has to choose from.
    choices: Vec<[String; 3]>,
    /// Isotropic strain and what it does to the twist.
    shifts: Vec<[String; 2]>,
    /// Names of the lattice that are open, with what decided: chosen by, then twist and strain of each.
    names: Option<(String, Vec<[String; 2]>)>,
    prior: String,
    interval: Option<[String; 2]>,
    tensor: Option<Tensor>,
    /// The tensor for the other sense of the twist, and the magnitudes that are open, where the sense is.
    other_sense: Option<(Tensor, [String; 2])>,
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
            .filter(|s| {
                readings
                    .names
                    .as_ref()
                    .is_none_or(|n| n.names[0].waves == s.waves)
            })
            .map(choice)
            .collect();
        let headline = match &readings.strain_tensor {
            Some(tensor) => {
                let twist = |e| format!("({})°", shown(e));
                let part = |e| format!("({})°", statistical(e));
                let first = tensor.found.twist_deg;
                Some(match &tensor.other_sense {
                    None => [
                        "with the orientation of a layer".to_owned(),
                        twist(first),
                        part(first),
                    ],
                    Some(other) => [
                        "with the orientation of a layer; the sense is open".to_owned(),
                        format!("{} or {}", twist(first), twist(other.found.twist_deg)),
                        format!("{} or {}", part(first), part(other.found.twist_deg)),
                    ],
                })
            }
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
            names: readings.names.as_ref().and_then(names),
            prior: isotropic.map_or_else(String::new, |found| format!("{} %", found.prior_percent)),
            interval: isotropic.map(|found| {
                found
                    .twist_interval_deg
                    .map(|end| format!("{}°", plain(end, 4)))
            }),
            tensor: readings.strain_tensor.as_ref().map(|found| Tensor {
                alternatives: found.alternatives.iter().map(alternative).collect(),
                ..tensor(&found.found, &found.splits)
            }),
            other_sense: readings.strain_tensor.as_ref().and_then(|found| {
                let other = found.other_sense.as_ref()?;
                let ends = other.twist_interval_deg;
                Some((
                    tensor(&other.found, &other.splits),
                    ends.map(|end| format!("{}°", plain(end, 4))),
                ))
            }),
        }
    }
}

/// What chose the name of the lattice, and the names that are open; nothing where only one is plausible.
fn names(found: &NamesResult) -> Option<(String, Vec<[String; 2]>)> {
    let open: Vec<[String; 2]> = found
        .names
        .iter()
        .filter(|n| n.standing == "open" || n.standing == "reported")
        .map(|n| {
            [
                format!("{}°", fixed(n.twist_deg, 4)),
                format!("{} %", fixed(n.strain_percent, 3)),
            ]
        })
        .collect();
    let chosen_by = match found.chosen_by.as_str() {
        "image" => "the image: every other plausible pair has a wave that is too weak",
        "orientation" => "the orientation of a layer: other pairs need isotropic strain",
        "user" => "the user",
        _ => "the least strain",
    };
    (open.len() > 1 || found.chosen_by != "least-strain").then(|| (chosen_by.to_owned(), open))
}

fn choice(solution: &SolutionResult) -> [String; 3] {
    [
        format!("({})°", shown(solution.twist_deg)),
        format!("({}) %", shown(solution.strain_percent)),
        format!("{}°", plain(solution.strain_axis_lab_deg, 2)),
    ]
}

fn alternative(found: &TensorNumbers) -> [String; 2] {
    let twist = format!("({})°", shown(found.twist_deg));
    [twist, format!("({}) %", shown(found.mean_strain_percent))]
}

fn tensor(found: &TensorNumbers, splits: &[SplitResult; 2]) -> Tensor {
    let &TensorNumbers {
        twist_deg,
        lattice_angle_deg,
        mean_strain_percent,
        shear_percent,
        axis_lab_deg,
        ..
    } = found;
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
        splits: splits
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
        alternatives: Vec::new(),
    }
}

/// A number with its sign.
fn signed(value: f64, decimals: usize, unit: &str) -> String {
    let sign = if value > 0.0 { "+" } else { "" };
    format!("{sign}{}{unit}", fixed(value, decimals))
}

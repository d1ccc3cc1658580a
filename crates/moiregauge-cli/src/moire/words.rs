//! What `moiregauge moire` prints.

use std::fmt::Write as _;

use heterostrain::Estimate;
use heterostrain::material::Material;
use heterostrain::strain::{Branch, StrainTensor};
use moiregauge::meaning::Readings;
use moiregauge_report::{CellResult, MoireDocument, fixed, plus_minus};

/// Solutions by other pairs of waves that are printed.
const SHOWN: usize = 8;

/// The cell, and what it means.
pub(super) fn answer(document: &MoireDocument, readings: Option<&Readings>, axes: &str) -> String {
    let mut text = format!("{}: {}\n", document.layers, document.input);
    cell(&mut text, &document.cell);
    if let Some(readings) = readings {
        meaning(&mut text, document, readings, axes);
    }
    text
}

fn cell(text: &mut String, cell: &CellResult) {
    let three = |values: &[f64; 3]| values.map(|v| fixed(v, 4)).join(", ");
    let vectors = |values: &[[f64; 2]; 3], decimals: usize| {
        values
            .map(|[x, y]| format!("({}, {})", fixed(x, decimals), fixed(y, decimals)))
            .join(" ")
    };
    let _ = writeln!(
        text,
        "  L1, L2, L2 − L1     {} nm",
        vectors(&cell.vectors_nm, 4)
    );
    let _ = writeln!(
        text,
        "  wavelengths         {} nm",
        three(&cell.wavelengths_nm)
    );
    let _ = writeln!(
        text,
        "  angle L1 to L2      {:.4}°; directions {}°",
        cell.angle_deg,
        three(&cell.polar_angles_deg)
    );
    let _ = writeln!(
        text,
        "  K1, K2, K2 − K1     {} rad/nm",
        vectors(&cell.wave_vectors_rad_per_nm, 5)
    );
    let _ = writeln!(
        text,
        "  4π/(√3|K|)          {} nm",
        three(&cell.k_space_wavelengths_nm)
    );
    let _ = writeln!(text, "  cell area           {:.4} nm²", cell.area_nm2);
    let _ = writeln!(
        text,
        "  carrier density     {:.4e} /cm² for one electron per cell, {:.4e} /cm² for {} (full filling{})",
        cell.density_per_electron_cm2,
        cell.density_full_cm2,
        cell.band_degeneracy,
        if cell.band_degeneracy == 4.0 {
            " of a band with two spins and two valleys, as in graphene"
        } else {
            ""
        }
    );
}

fn meaning(text: &mut String, document: &MoireDocument, readings: &Readings, axes: &str) {
    let degree = 1f64.to_degrees();
    let _ = writeln!(
        text,
        "\nsolutions with uniaxial strain alone (axis counted from {axes}):"
    );
    if readings.solutions.is_empty() {
        let sigma = document.twist_strain.and_then(|t| t.twist_deg.sigma);
        let _ = writeln!(
            text,
            "  none: the moiré is larger than any twist can make it; the nearest solution is aligned layers, twist 0 ± \
             {:.3}°",
            sigma.unwrap_or(f64::INFINITY)
        );
    }
    let first = readings.solutions.first().map(|b| b.name);
    let (own, others): (Vec<&Branch>, Vec<&Branch>) = readings
        .solutions
        .iter()
        .partition(|b| readings.naming.is_none() || Some(b.name) == first);
    for branch in own {
        solution(text, branch);
    }
    let others: Vec<&&Branch> = others.iter().filter(|b| b.twist >= 0.0).collect();
    if !others.is_empty() {
        let _ = writeln!(
            text,
            "other solutions of the same lattice, by other pairs of its waves (θ > 0; --json lists all with up to {:.2} \
             % of strain):",
            100.0 * readings.complete_to
        );
    }
    for branch in others.into_iter().take(SHOWN) {
        solution(text, branch);
    }
    if let Some(found) = &readings.degeneracy {
        text.push_str("isotropic strain of layer 2 changes the twist:");
        for (strain, change) in &found.shifts {
            let change = change.map_or_else(
                || "no twist".to_owned(),
                |c| format!("{}°", signed(c * degree, 4)),
            );
            let _ = write!(text, " {} % {change};", signed(100.0 * strain, 1));
        }
        let [low, high] = found.interval;
        let _ = writeln!(
            text,
            "\n  {}° to {}° are possible (95 %) with isotropic strains of {:.3} % (1 σ) and either sign of the strain",
            fixed(low * degree, 4),
            fixed(high * degree, 4),
            100.0 * found.prior
        );
    }
    if let Some(tensor) = &readings.tensor {
        let percent = |e: Estimate| plus_minus(e.scaled(100.0));
        text.push_str("with the orientation of the layer:\n");
        strain_tensor(text, &tensor.best, tensor.poisson_ratio);
        if let Some(opposite) = &tensor.opposite {
            text.push_str("  equally good, with the other sense of the twist:\n");
            strain_tensor(text, &opposite.found, tensor.poisson_ratio);
        }
        for other in tensor.alternatives.iter().map(|other| &other.found) {
            let _ = writeln!(
                text,
                "  or twist {}°, mean strain {} %",
                plus_minus(other.twist().scaled(degree)),
                percent(other.mean())
            );
        }
    }
}

fn strain_tensor(text: &mut String, found: &StrainTensor, poisson_ratio: f64) {
    let degree = 1f64.to_degrees();
    let percent = |e: Estimate| plus_minus(e.scaled(100.0));
    let _ = writeln!(
        text,
        "  twist {}°, mean strain {} %, shear part {} %{}",
        plus_minus(found.twist().scaled(degree)),
        percent(found.mean()),
        percent(found.shear()),
        found.axis_lab().map_or_else(String::new, |a| format!(
            ", axis {}°",
            plus_minus(a.scaled(degree))
        ))
    );
    for split in found.splits(poisson_ratio) {
        let _ = writeln!(
            text,
            "  = uniaxial {} % and biaxial {} %",
            percent(split.uniaxial),
            percent(split.biaxial)
        );
    }
}

/// A change, with its sign.
fn signed(value: f64, decimals: usize) -> String {
    let text = fixed(value, decimals);
    if text.starts_with('−') {
        text
    } else {
        format!("+{text}")
    }
}

fn solution(text: &mut String, branch: &Branch) {
    let degree = 1f64.to_degrees();
    // Without σ, as many digits as the two meanings of a wavelength and a strain by eye need.
    let number = |value: f64, sigma: f64, decimals: usize| {
        if sigma > 0.0 {
            plus_minus(Estimate::new(value, sigma))
        } else {
            fixed(value, decimals)
        }
    };
    let _ = writeln!(
        text,
        "  twist {}°, strain {} % along {}°{}",
        number(branch.twist * degree, branch.twist_sigma * degree, 4),
        number(branch.strain * 100.0, branch.strain_sigma * 100.0, 4),
        fixed(branch.axis_lab * degree, 2),
        if branch.strain_dominated {
            " (made by strain, distorted by twist)"
        } else {
            ""
        }
    );
}

/// The layers known by name.
pub(super) fn list(all: &[Material]) -> String {
    let mut text = String::new();
    for material in all {
        let cell = match (material.lattice_constant_b_nm, material.cell_angle_deg) {
            (Some(b), Some(angle)) => format!(" × {b} nm, {angle}°"),
            _ => " nm".to_owned(),
        };
        let _ = writeln!(
            text,
            "{:10} a = {}{cell} (± {}), ν = {} (± {}); {}",
            material.name,
            material.lattice_constant_nm,
            material.lattice_constant_sigma_nm,
            material.poisson_ratio,
            material.poisson_ratio_sigma,
            material.source
        );
    }
    text
}

//! What stands in which column. The same list makes the table and its explanation.

use super::csv::{Column, number};
use crate::results::{
    AssumedDriftResult, BudgetColumn, BudgetResult, LatticeVector, MeanResult, ResultEstimate,
    Results, ScanResult, SetResult, TwistStrainResult,
};

/// A kind of row.
pub(super) trait Row<'a>: Sized + 'a {
    /// What one row is.
    const ABOUT: &'static str;
    const COLUMNS: &'a [Column<Self>];
    fn rows(results: &'a Results) -> Vec<Self>;
}

macro_rules! columns {
    ($($name:literal, $about:literal, $value:expr;)*) => {
        &[$(Column { name: $name, about: $about, value: $value }),*]
    };
}

pub(super) use columns;

fn value(estimate: Option<ResultEstimate>) -> String {
    number(estimate.and_then(|e| e.value))
}

fn sigma(estimate: Option<ResultEstimate>) -> String {
    number(estimate.and_then(|e| e.sigma))
}

fn total(column: Option<BudgetColumn>) -> String {
    number(column.and_then(|c| c.total))
}

fn count(number: usize) -> String {
    number.to_string()
}

/// One vector of one scan in one kind of coordinates.
pub(super) struct VectorRow<'a> {
    set: &'a SetResult,
    number: usize,
    scan: &'a ScanResult,
    name: &'a str,
    coordinates: &'static str,
    vector: &'a LatticeVector,
}

impl<'a> Row<'a> for VectorRow<'a> {
    const ABOUT: &'static str = "One row per scan, lattice vector and kind of coordinates. σ of single scans is the \
                                 statistical part alone; calibration and model add what budget.csv lists for the set.";
    const COLUMNS: &'a [Column<Self>] = columns! {
        "set", "name of the set", |r| r.set.name.clone();
        "scan", "number of the scan in its set, from 1", |r| count(r.number);
        "file", "the file as it was named", |r| r.scan.file.clone();
        "frame_direction", "`up`: bottom line first; `down`: top line first; `unknown`", |r| r.scan.frame_direction.clone();
        "vector", "L1, L2, or L3 = L2 − L1", |r| r.name.to_owned();
        "coordinates", "`nominal`: stated size; `sensor`: position sensors; `drift_corrected`: sensors, drift removed", |r| r.coordinates.to_owned();
        "x_nm", "component to the right", |r| number(r.vector.x_nm);
        "y_nm", "component up", |r| number(r.vector.y_nm);
        "variance_x_nm2", "variance of x", |r| number(r.vector.covariance_nm2[0][0]);
        "variance_y_nm2", "variance of y", |r| number(r.vector.covariance_nm2[1][1]);
        "covariance_xy_nm2", "covariance of x and y", |r| number(r.vector.covariance_nm2[0][1]);
        "wavelength_nm", "length", |r| number(r.vector.wavelength_nm.value);
        "wavelength_sigma_nm", "its statistical σ", |r| number(r.vector.wavelength_nm.sigma);
        "polar_angle_ccw_from_x_deg", "direction", |r| number(r.vector.polar_angle_deg);
        "polar_angle_sigma_deg", "its statistical σ", |r| number(r.vector.polar_angle_sigma_deg);
        "naive_twist_deg", "2 arcsin(a/2λ), the twist without strain", |r| number(r.vector.naive_twist_deg.value);
        "naive_twist_sigma_deg", "its statistical σ", |r| number(r.vector.naive_twist_deg.sigma);
    };

    fn rows(results: &'a Results) -> Vec<Self> {
        let mut rows = Vec::new();
        for (set, number, scan) in scans(results) {
            for vector in &scan.vectors {
                let kinds = [
                    ("nominal", vector.nominal.as_ref()),
                    ("sensor", Some(&vector.sensor)),
                    ("drift_corrected", vector.drift_corrected.as_ref()),
                ];
                rows.extend(kinds.into_iter().filter_map(|(coordinates, found)| {
                    found.map(|found| Self {
                        set,
                        number,
                        scan,
                        name: &vector.name,
                        coordinates,
                        vector: found,
                    })
                }));
            }
        }
        rows
    }
}

/// Every scan with its set and its number.
fn scans(results: &Results) -> impl Iterator<Item = (&SetResult, usize, &ScanResult)> {
    results.sets.iter().flat_map(|set| {
        set.scans
            .iter()
            .enumerate()
            .map(move |(index, scan)| (set, index + 1, scan))
    })
}

/// One scan, before or after drift correction.
pub(super) struct ScanRow<'a> {
    set: &'a SetResult,
    number: usize,
    scan: &'a ScanResult,
    coordinates: &'static str,
    result: Option<&'a TwistStrainResult>,
}

impl<'a> Row<'a> for ScanRow<'a> {
    const ABOUT: &'static str = "One row per scan and kind of coordinates. σ of single scans is the statistical part \
                                 alone; calibration and model add what budget.csv lists for the set.";
    const COLUMNS: &'a [Column<Self>] = columns! {
        "set", "name of the set", |r| r.set.name.clone();
        "scan", "number of the scan in its set, from 1", |r| count(r.number);
        "file", "the file as it was named", |r| r.scan.file.clone();
        "acquired", "date and time by the instrument's clock", |r| r.scan.acquired.clone().unwrap_or_default();
        "frame_direction", "`up`: bottom line first; `down`: top line first; `unknown`", |r| r.scan.frame_direction.clone();
        "slow_axis", "`x` or `y`", |r| r.set.slow_axis.clone();
        "line_rate_hz", "lines per second", |r| number(r.set.line_rate_hz);
        "window_centre_x_nm", "centre of the scanned window", |r| number(r.scan.window.centre_nm[0]);
        "window_centre_y_nm", "centre of the scanned window", |r| number(r.scan.window.centre_nm[1]);
        "window_extent_x_nm", "length of the side nearer to x", |r| number(r.scan.window.extent_nm[0]);
        "window_extent_y_nm", "length of the side nearer to y", |r| number(r.scan.window.extent_nm[1]);
        "tip_velocity_fast_nm_per_s", "along a line", |r| number(r.scan.tip_velocity_nm_per_s.fast.value);
        "tip_velocity_fast_spread_nm_per_s", "standard deviation over the lines", |r| number(r.scan.tip_velocity_nm_per_s.fast.sigma);
        "tip_velocity_slow_nm_per_s", "from line to line", |r| number(r.scan.tip_velocity_nm_per_s.slow.value);
        "tip_velocity_slow_spread_nm_per_s", "standard deviation", |r| number(r.scan.tip_velocity_nm_per_s.slow.sigma);
        "coordinates", "`sensor`: not corrected; `drift_corrected`: drift removed", |r| r.coordinates.to_owned();
        "twist_deg", "twist θ", |r| value(r.result.map(|t| t.twist_deg));
        "twist_sigma_deg", "its statistical σ", |r| sigma(r.result.map(|t| t.twist_deg));
        "heterostrain_percent", "ε, noise bias removed", |r| value(r.result.map(|t| t.heterostrain_percent));
        "heterostrain_sigma_percent", "its statistical σ", |r| sigma(r.result.map(|t| t.heterostrain_percent));
        "strain_e1_percent", "ε cos 2φ_lab", |r| number(r.result.and_then(|t| t.strain_vector_percent[0]));
        "strain_e2_percent", "ε sin 2φ_lab", |r| number(r.result.and_then(|t| t.strain_vector_percent[1]));
        "strain_axis_lab_ccw_from_x_deg", "φ_lab; empty unless p < 0.01", |r| value(r.result.and_then(|t| t.strain_axis_lab_deg));
        "strain_axis_lab_sigma_deg", "its statistical σ", |r| sigma(r.result.and_then(|t| t.strain_axis_lab_deg));
        "strain_axis_lattice_deg", "φ from layer 1; empty unless p < 0.01", |r| value(r.result.and_then(|t| t.strain_axis_lattice_deg));
        "strain_axis_lattice_sigma_deg", "its statistical σ", |r| sigma(r.result.and_then(|t| t.strain_axis_lattice_deg));
        "strain_p_value", "probability that noise alone gives such a strain", |r| number(r.result.and_then(|t| t.strain_p_value));
        "lattice_angle_deg", "orientation α of layer 1, modulo 60°", |r| value(r.result.map(|t| t.lattice_angle_deg));
        "lattice_angle_sigma_deg", "its statistical σ", |r| sigma(r.result.map(|t| t.lattice_angle_deg));
        "residual_chi2", "χ² of the scan against the fit of all others; empty without a joint fit", |r| number(r.scan.residual.and_then(|s| s.chi2));
        "residual_degrees_of_freedom", "its degrees of freedom", |r| r.scan.residual.map_or(String::new(), |s| count(s.degrees_of_freedom));
        "residual_p_value", "probability of so large a χ² by chance", |r| number(r.scan.residual.and_then(|s| s.p_value));
        "displacement_x_nm", "distance of the lattice in this scan from the place that the other scans predict", |r| number(r.scan.residual.and_then(|s| s.displacement_nm?[0]));
        "displacement_y_nm", "the same along y", |r| number(r.scan.residual.and_then(|s| s.displacement_nm?[1]));
        "excluded", "why the scan was not used for its set; empty where it was", |r| r.scan.excluded.clone().unwrap_or_default();
    };

    fn rows(results: &'a Results) -> Vec<Self> {
        let both = scans(results).flat_map(|(set, number, scan)| {
            let kinds = [
                ("sensor", scan.twist_strain.sensor.as_ref()),
                (
                    "drift_corrected",
                    scan.twist_strain.drift_corrected.as_ref(),
                ),
            ];
            kinds.map(|(coordinates, result)| Self {
                set,
                number,
                scan,
                coordinates,
                result,
            })
        });
        both.collect()
    }
}

/// One set, corrected for drift.
pub(super) struct SetRow<'a> {
    set: &'a SetResult,
}

impl SetRow<'_> {
    fn mean(&self) -> Option<&MeanResult> {
        self.set.mean.as_ref()
    }

    fn result(&self) -> Option<&TwistStrainResult> {
        self.mean().map(|m| &m.twist_strain)
    }

    fn assumed(&self) -> Option<AssumedDriftResult> {
        let alone = || self.set.lattice.as_ref()?.drift_assumed;
        self.mean().map_or_else(alone, |m| m.drift_assumed)
    }

    fn chi2_per_dof(&self) -> Option<f64> {
        let alone = || self.set.lattice.as_ref()?.chi2_per_dof;
        self.mean().map_or_else(alone, |m| m.chi2_per_dof)
    }

    /// Of one of the three vectors, with twist and strain or without.
    fn length(&self, index: usize) -> Option<ResultEstimate> {
        let alone = self.set.lattice.as_ref().map(|l| &l.vectors);
        let vectors = self.mean().map(|m| &m.vectors).or(alone)?;
        Some(vectors[index].wavelength_nm)
    }

    fn budget(&self) -> Option<&BudgetResult> {
        self.mean().map(|m| &m.budget)
    }
}

impl<'a> Row<'a> for SetRow<'a> {
    const ABOUT: &'static str = "One row per set: drift, and twist and strain of all its scans together, drift removed or, where nothing tells it, in the errors.";
    const COLUMNS: &'a [Column<Self>] = columns! {
        "set", "name of the set", |r| r.set.name.clone();
        "slow_axis", "`x` or `y`", |r| r.set.slow_axis.clone();
        "line_rate_hz", "lines per second", |r| number(r.set.line_rate_hz);
        "channel", "the analysed channel", |r| r.set.channel.clone();
        "scans", "number of scans", |r| count(r.set.scans.len());
        "drift_x_nm_per_min", "drift to the right", |r| value(r.set.drift.as_ref().map(|d| d.x_nm_per_min));
        "drift_x_sigma_nm_per_min", "its statistical σ", |r| sigma(r.set.drift.as_ref().map(|d| d.x_nm_per_min));
        "drift_x_total_sigma_nm_per_min", "its total σ, with the calibration of the scanner", |r| number(r.set.drift.as_ref().and_then(|d| d.x_nm_per_min.sigma_total));
        "drift_y_nm_per_min", "drift up", |r| value(r.set.drift.as_ref().map(|d| d.y_nm_per_min));
        "drift_y_sigma_nm_per_min", "its statistical σ", |r| sigma(r.set.drift.as_ref().map(|d| d.y_nm_per_min));
        "drift_y_total_sigma_nm_per_min", "its total σ, with the calibration of the scanner", |r| number(r.set.drift.as_ref().and_then(|d| d.y_nm_per_min.sigma_total));
        "drift_correlation", "correlation coefficient of the two", |r| number(r.set.drift.as_ref().and_then(|d| d.correlation));
        "drift_given", "whether the user gave the drift", |r| r.set.drift.as_ref().map_or_else(String::new, |d| d.given.to_string());
        "drift_assumed_sigma_nm_per_min", "σ of each component of a drift of 0 that was assumed; empty where the drift was measured or given", |r| number(r.assumed().and_then(|a| a.sigma_nm_per_min));
        "twist_deg", "twist θ", |r| value(r.result().map(|t| t.twist_deg));
        "twist_sigma_deg", "its statistical σ: image noise, drift and sensor noise", |r| sigma(r.result().map(|t| t.twist_deg));
        "twist_total_sigma_deg", "its total σ, calibration and model included, see budget.csv (publish this one)", |r| total(r.budget().map(|b| b.twist_deg));
        "twist_scatter_deg", "standard deviation over the scans", |r| number(r.mean().and_then(|m| m.twist_scatter_deg));
        "heterostrain_percent", "ε, noise bias removed", |r| value(r.result().map(|t| t.heterostrain_percent));
        "heterostrain_sigma_percent", "its statistical σ", |r| sigma(r.result().map(|t| t.heterostrain_percent));
        "heterostrain_total_sigma_percent", "its total σ", |r| total(r.budget().map(|b| b.heterostrain_percent));
        "strain_e1_percent", "ε cos 2φ_lab", |r| number(r.result().and_then(|t| t.strain_vector_percent[0]));
        "strain_e2_percent", "ε sin 2φ_lab", |r| number(r.result().and_then(|t| t.strain_vector_percent[1]));
        "strain_e1_total_sigma_percent", "total σ of E₁", |r| total(r.budget().map(|b| b.strain_e1_percent));
        "strain_e2_total_sigma_percent", "total σ of E₂", |r| total(r.budget().map(|b| b.strain_e2_percent));
        "strain_variance_e1_percent2", "statistical variance of E₁", |r| number(r.result().and_then(|t| t.strain_vector_covariance[0][0]));
        "strain_variance_e2_percent2", "statistical variance of E₂", |r| number(r.result().and_then(|t| t.strain_vector_covariance[1][1]));
        "strain_covariance_e1_e2_percent2", "statistical covariance of E₁ and E₂", |r| number(r.result().and_then(|t| t.strain_vector_covariance[0][1]));
        "strain_scatter_percent", "deviation per component over the scans", |r| number(r.mean().and_then(|m| m.strain_scatter_percent));
        "strain_axis_lab_ccw_from_x_deg", "φ_lab; empty unless p < 0.01", |r| value(r.result().and_then(|t| t.strain_axis_lab_deg));
        "strain_axis_lab_sigma_deg", "its statistical σ", |r| sigma(r.result().and_then(|t| t.strain_axis_lab_deg));
        "strain_axis_lab_total_sigma_deg", "its total σ", |r| total(r.budget().and_then(|b| b.strain_axis_lab_deg));
        "strain_p_value", "probability that noise alone gives such a strain", |r| number(r.result().and_then(|t| t.strain_p_value));
        "strain_interval_95_low_percent", "lower end of the 95 % interval of ε", |r| number(r.result().and_then(|t| t.strain_interval_95_percent[0]));
        "strain_interval_95_high_percent", "its upper end", |r| number(r.result().and_then(|t| t.strain_interval_95_percent[1]));
        "strain_upper_limit_95_percent", "not exceeded with 95 % confidence", |r| number(r.result().and_then(|t| t.strain_upper_limit_95_percent));
        "lattice_angle_deg", "orientation α of layer 1, modulo 60°", |r| value(r.result().map(|t| t.lattice_angle_deg));
        "lattice_angle_sigma_deg", "its statistical σ", |r| sigma(r.result().map(|t| t.lattice_angle_deg));
        "lattice_angle_total_sigma_deg", "its total σ", |r| total(r.budget().map(|b| b.lattice_angle_deg));
        "chi2_per_dof", "χ² per degree of freedom of the scans against the common lattice; every σ is enlarged by its square root where it is significantly above 1 (p < 0.05)", |r| number(r.chi2_per_dof());
        "wavelength_l1_nm", "length of L1 of all scans together", |r| value(r.length(0));
        "wavelength_l1_sigma_nm", "its statistical σ", |r| sigma(r.length(0));
        "wavelength_l1_total_sigma_nm", "its total σ", |r| number(r.length(0).and_then(|l| l.sigma_total));
        "wavelength_l2_nm", "length of L2", |r| value(r.length(1));
        "wavelength_l2_sigma_nm", "its statistical σ", |r| sigma(r.length(1));
        "wavelength_l2_total_sigma_nm", "its total σ", |r| number(r.length(1).and_then(|l| l.sigma_total));
        "wavelength_l3_nm", "length of L3", |r| value(r.length(2));
        "wavelength_l3_sigma_nm", "its statistical σ", |r| sigma(r.length(2));
        "wavelength_l3_total_sigma_nm", "its total σ", |r| number(r.length(2).and_then(|l| l.sigma_total));
        "within_one_percent", "whether all wavelengths lie within ±1 % of the common ones", |r| r.mean().map_or_else(String::new, |m| m.within_one_percent.to_string());
    };

    fn rows(results: &'a Results) -> Vec<Self> {
        results.sets.iter().map(|set| Self { set }).collect()
    }
}

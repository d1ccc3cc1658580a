//! What stands in which column of `budget.csv`: one row for each source of error.

use moiregauge::meaning::Source;

use super::columns::{Row, columns};
use super::csv::{Column, number};
use crate::results::{BudgetColumn, BudgetResult, Results, source_name};

/// One source of error, or all together, of one lattice.
pub(super) struct BudgetRow<'a> {
    set: &'a str,
    coordinates: &'static str,
    /// `None` for all together.
    source: Option<Source>,
    budget: &'a BudgetResult,
}

impl BudgetRow<'_> {
    fn of(&self, column: &BudgetColumn) -> String {
        number(match self.source {
            Some(source) => column.get(source),
            None => column.total,
        })
    }
}

impl BudgetRow<'_> {
    fn source_name(&self) -> &'static str {
        match self.source {
            Some(Source::Drift) if self.budget.drift_assumed => "drift (assumed)",
            source => source.map_or("total", source_name),
        }
    }
}

impl<'a> Row<'a> for BudgetRow<'a> {
    const ABOUT: &'static str = "One row per set and source of error, the last row of each set is `total`. Each number \
                                 is one standard deviation. The squares of `image`, `drift` and `sensor` add up to the \
                                 square of σ; the squares of all sources add up to the square of `total`.";
    const COLUMNS: &'a [Column<Self>] = columns! {
        "set", "name of the set, or `all sets together`", |r| r.set.to_owned();
        "coordinates", "`sensor`: not corrected for drift, the contribution of the drift is not known; \
                        `drift_corrected`: drift removed, or assumed", |r| r.coordinates.to_owned();
        "source", "where the error comes from; `drift (assumed)`: of the prior of a drift that the scans do not tell", |r| r.source_name().to_owned();
        "twist_sigma_deg", "of the twist", |r| r.of(&r.budget.twist_deg);
        "heterostrain_sigma_percent", "of the magnitude of the strain", |r| r.of(&r.budget.heterostrain_percent);
        "strain_e1_sigma_percent", "of ε cos 2φ_lab", |r| r.of(&r.budget.strain_e1_percent);
        "strain_e2_sigma_percent", "of ε sin 2φ_lab", |r| r.of(&r.budget.strain_e2_percent);
        "strain_axis_lab_sigma_deg", "of φ_lab; empty unless p < 0.01", |r| r.budget.strain_axis_lab_deg.as_ref().map_or_else(String::new, |c| r.of(c));
        "lattice_angle_sigma_deg", "of the orientation α of layer 1", |r| r.of(&r.budget.lattice_angle_deg);
        "wavelength_l1_sigma_nm", "of the length of L1", |r| r.of(&r.budget.wavelengths_nm[0]);
        "wavelength_l2_sigma_nm", "of the length of L2", |r| r.of(&r.budget.wavelengths_nm[1]);
        "wavelength_l3_sigma_nm", "of the length of L3", |r| r.of(&r.budget.wavelengths_nm[2]);
    };

    fn rows(results: &'a Results) -> Vec<Self> {
        let sets = results.sets.iter().flat_map(|set| {
            let kinds = [
                ("sensor", set.uncorrected.as_ref()),
                ("drift_corrected", set.mean.as_ref()),
            ];
            let found = kinds
                .into_iter()
                .filter_map(|(kind, mean)| Some((kind, &mean?.budget)));
            found.map(|(coordinates, budget)| (set.name.as_str(), coordinates, budget))
        });
        let together = results
            .combined
            .iter()
            .map(|c| ("all sets together", "drift_corrected", &c.budget));
        sets.chain(together)
            .flat_map(|(set, coordinates, budget)| {
                let rare = [Source::Pitch, Source::Shape, Source::RulerStrain];
                let shown = Source::ALL
                    .into_iter()
                    .filter(move |s| !rare.contains(s) || budget.twist_deg.get(*s).is_some());
                let sources = shown.map(Some).chain([None]);
                sources.map(move |source| Self {
                    set,
                    coordinates,
                    source,
                    budget,
                })
            })
            .collect()
    }
}

//! The pattern of one image as its map shows it: undistorted, and the mean of its cells.

use spmfile::{LineDirection, Scan};

use crate::campaign::analysis::ScanAnalysis;
use crate::map::cell::{MeanCell, mean_cell};
use crate::map::followed::Followed;
use crate::map::gauge::Gauge;
use crate::map::undistorted::{Undistorted, undistorted};
use crate::scan::channel::{channels, flat_image_of};
use crate::settings::knobs::Settings;
use crate::survey::mapping::{LineMap, drifted, place_of, still};

/// An image that its own map puts on the mean lattice; to be shown, nothing is measured from it.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct MappedPattern {
    /// The file as the user named it.
    pub file: String,
    /// Trace or retrace.
    pub line: LineDirection,
    /// Name of the channel.
    pub channel: String,
    /// Its unit.
    pub unit: String,
    /// Whether the drift is taken off.
    pub drift_corrected: bool,
    /// The mean lattice and a node of it.
    pub gauge: Gauge,
    /// The image, background removed, as it would be with the mean lattice everywhere.
    pub undistorted: Undistorted,
    /// The mean over all cells, background removed; `None` where fewer than two of them are known.
    pub cell: Option<MeanCell>,
}

/// The pattern of the image behind `map`; `origin` as for [`crate::survey::mapping::map_scan`], whose places `map` has.
///
/// `None` where no phase could be followed: maps by tiles have none.
pub fn pattern_of_scan(
    scan: &Scan,
    analysed: &ScanAnalysis,
    origin: Option<f64>,
    settings: &Settings,
    map: &LineMap,
) -> Option<MappedPattern> {
    let followed = Followed::new(&map.map)?;
    let of_line =
        |c: &&spmfile::Channel| c.line_direction.unwrap_or(LineDirection::Trace) == map.line;
    let channel = channels(scan, settings).ok()?.into_iter().find(of_line)?;
    let (place, found) = place_of(scan, channel, analysed, settings)?;
    let mut placed = still(&place, found, analysed).unwrap_or(place.geometry);
    placed.origin -= drifted(analysed, origin);
    let image = flat_image_of(channel, settings.background);
    Some(MappedPattern {
        file: analysed.file.clone(),
        line: map.line,
        channel: channel.name.clone(),
        unit: channel.plain_unit(),
        drift_corrected: map.drift_corrected,
        gauge: followed.gauge,
        undistorted: undistorted(&image, &placed, &followed)?,
        cell: mean_cell(&image, &placed, &followed),
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector2};

    use super::pattern_of_scan;
    use crate::campaign::analyse;
    use crate::map::nodes::Grid;
    use crate::map::registry::RegistryMap;
    use crate::scan::measure::measure_scan;
    use crate::settings::knobs::Settings;
    use crate::simulate::bend::Bend;
    use crate::simulate::reference::Reference;
    use crate::simulate::{SampleFeature, Simulation, Simulator};
    use crate::survey::averaging::average_maps;
    use crate::survey::mapping::{MapMethod, map_scan};
    use crate::window::types::Resolution;

    /// A frame of 240 nm at rest.
    fn simulation(sample: &str, seed: u64) -> Simulation {
        let mut simulation = Simulation {
            seed,
            features: SampleFeature::parse(sample).unwrap(),
            ..Simulation::default()
        };
        simulation.raster.pixels = [384, 384];
        simulation.raster.scans = 1;
        simulation.raster.nominal_size_nm = [240.0, 240.0];
        simulation.drift.velocity_nm_per_min = [0.0, 0.0];
        simulation
    }

    /// The registry that trace and retrace of a frame give.
    fn registry(simulation: &Simulation) -> (RegistryMap, Grid) {
        let settings = Settings {
            drift_draws: 0,
            strain_draws: 0,
            ..Settings::default()
        };
        let scan = Simulator::new(simulation.clone()).unwrap().frame(0);
        let measured = measure_scan("scan", &scan, &settings, None).unwrap();
        let analysis = analyse(vec![measured], &settings);
        let analysed = &analysis.sets[0].scans[0];
        let (method, resolution) = (MapMethod::Demodulation, Resolution::default());
        let maps = map_scan(&scan, analysed, None, &settings, method, &resolution).unwrap();
        let pattern = pattern_of_scan(&scan, analysed, None, &settings, &maps[0]).unwrap();
        assert!(pattern.undistorted.known > 0.3 && pattern.cell.unwrap().all_cells > 100);
        let (average, _) = average_maps(&maps).unwrap();
        let found = average.registry(
            &maps[0].whole,
            settings.bilayer(),
            settings.strain_convention,
        );
        (found.unwrap(), average.grid)
    }

    /// Layer 2 lies on layer 1 as `F` has it and is then displaced by u: atoms at r come from `F⁻¹(r − u)`, and the registry is
    /// `r − F⁻¹(r − u)`. The maps of simulated frames say so, with sign and frame, at every node within its errors, up to a lattice
    /// vector of layer 1 that is the same for all.
    #[test]
    fn registries_are_those_of_the_layers() {
        for sample in [
            "twist-wave",
            "twist-gradient:change=0.06",
            "strain-gradient",
        ] {
            let (mut chi2, mut count) = (0.0, 0.0);
            for seed in 1..4 {
                let simulation = simulation(sample, seed);
                let (found, grid) = registry(&simulation);
                let layers = &simulation.sample;
                let [first, second] = layers
                    .stacking()
                    .atoms(layers.bilayer(), layers.strain_convention)
                    .unwrap();
                let reference = Reference::new(&simulation);
                let nu = layers.bilayer().stretched.poisson_ratio;
                let bend = Bend::of(&simulation.features[0], &reference, nu).unwrap();
                let back = first * second.try_inverse().unwrap();
                let origin = Vector2::from(layers.origin_nm);
                // Layer 1 lies as it is said to lie, under one of its names.
                let names = first.try_inverse().unwrap() * found.layers.atoms;
                let whole = names.map(f64::round);
                assert!(
                    (names - whole).norm() < 0.02 && whole.determinant() == 1.0,
                    "{names}"
                );
                let mut turns: Option<Vector2<f64>> = None;
                for node in 0..grid.len() {
                    let shares = [0, 1].map(|i| f64::from(found.shares[i].value[node]));
                    if !shares[0].is_finite() {
                        continue;
                    }
                    let at = grid.place(node);
                    let from = at - origin;
                    let truth = from - back * (from - bend.displacement(at));
                    let miss = first * whole * Vector2::from(shares) - truth;
                    // In nm as they stand, too: turned by what noise makes of the orientation.
                    let plain =
                        Vector2::from([0, 1].map(|i| f64::from(found.registry[i].value[node])));
                    let turned = plain - first * whole * Vector2::from(shares);
                    assert!(turned.norm() < 0.01 * plain.norm() + 1e-6);
                    let steps = first.try_inverse().unwrap() * miss;
                    let own = *turns.get_or_insert(steps.map(f64::round));
                    let miss = miss - first * own;
                    let covariance = f64::from(found.covariance[node]);
                    let [a, b] = [0, 1].map(|i| f64::from(found.registry[i].sigma[node]).powi(2));
                    let covariance = Matrix2::new(a, covariance, covariance, b);
                    chi2 += (miss.transpose() * covariance.try_inverse().unwrap() * miss)[0];
                    count += 2.0;
                }
            }
            let per_number = chi2 / count;
            println!("{sample}: χ² per number {per_number:.3} of {count}");
            assert!((0.75..1.3).contains(&per_number), "{sample}: {per_number}");
        }
    }
}

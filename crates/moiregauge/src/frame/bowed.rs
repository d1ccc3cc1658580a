//! What a plane leaves of a position sensor → its smooth departure, chosen by what predicts lines that were held out.
//!
//! Each line is described by Legendre polynomials along it. How the coefficient of each degree runs from line to line is described by
//! such polynomials across the lines and, where the frame creeps, by a logarithm of the time since it began. Blocks of lines are held
//! out in turn. If the description that predicts them best does so better than the plane by more than chance, all descriptions are
//! averaged, each weighted by how well it predicts; how far they are from one another is part of the error, since the choice of one
//! follows the noise. A straight scanner keeps its plane.
//!
//! # References
//! Stone, J. R. Stat. Soc. B 36, 111 (1974), cross-validation; Buckland, Burnham & Augustin, Biometrics 53, 603 (1997), errors of a
//! mean of descriptions.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use crate::frame::departure::{Across, legendre};
use crate::frame::image::Image;
use crate::frame::line_steps::correlated;
use crate::frame::plane::PlaneFit;
use crate::numbers::dot::dot;

/// Largest degrees along a line and across the lines: such a sum follows a creep or a hysteresis to a thousandth.
const DEGREES: [usize; 2] = [8, 8];
/// Blocks of lines that are held out in turn.
const BLOCKS: usize = 24;
/// By so much, in units of what it leaves of a line, a description has to predict the lines that were held out better than the plane: e⁻²⁵ by chance,
/// the search included.
const BEYOND_CHANCE: f64 = 50.0;
/// The same of other degrees of a sensor that is bent: e⁻⁶.
const BESIDE: f64 = 12.0;
/// Departures of less than this share of the frame are rounding, and harm nobody.
const HARMLESS: f64 = 1e-7;
/// Descriptions of a smaller share in the mean are left out of it.
const NEGLIGIBLE: f64 = 1e-3;
/// Steps of the times after which creep is logarithmic, as shares of the frame: factors of two down to a line.
const HALVES: i32 = 9;

/// A line that was described: its v and the coefficients of the degrees along it.
struct Line {
    v: f64,
    /// The polynomials across the lines at v.
    powers: Vec<f64>,
    sizes: Vec<f64>,
}

/// What describes one degree along the lines: functions across them, their sizes, nm, and the covariance of these.
#[derive(Debug)]
pub(crate) struct Described {
    pub(crate) along: usize,
    pub(crate) across: Vec<Across>,
    pub(crate) sizes: DVector<f64>,
    pub(crate) covariance: DMatrix<f64>,
}

/// The departure of one sensor, degree by degree; none of a straight one.
pub(crate) fn departure(image: &Image, plane: &PlaneFit, used: &Range<usize>) -> Vec<Described> {
    let lines = lines(image, plane, used);
    if lines.len() < 2 * BLOCKS {
        return Vec::new();
    }
    let all: Vec<Across> = (0..=DEGREES[1]).map(Across::Power).collect();
    let design = design(&lines, &all);
    let of_block = |b| design.rows_range(block(&lines, b));
    let normals: Vec<_> = (0..BLOCKS)
        .map(|b| of_block(b).tr_mul(&of_block(b)))
        .collect();
    let span = (plane.per_column * image.columns as f64).hypot(plane.per_row * image.rows as f64);
    let found: Vec<(f64, Described)> = (0..=DEGREES[0])
        .filter_map(|along| of_degree(&lines, &normals, along, HARMLESS * span))
        .collect();
    if found.iter().all(|(gain, _)| *gain < BEYOND_CHANCE) {
        return Vec::new();
    }
    found.into_iter().map(|(_, described)| described).collect()
}

/// Every line of which most pixels are there.
fn lines(image: &Image, plane: &PlaneFit, used: &Range<usize>) -> Vec<Line> {
    let degrees = DEGREES[0] + 1;
    if used.len() < 4 * degrees || image.rows < 2 {
        return Vec::new();
    }
    let side = (used.len() - 1) as f64;
    let along: Vec<Vec<f64>> = (0..used.len())
        .map(|c| {
            let all = legendre(2.0 * c as f64 / side - 1.0, DEGREES[0]);
            all.into_iter().map(|[value, _]| value).collect()
        })
        .collect();
    let normal = |there: &dyn Fn(usize) -> bool| {
        let mut normal = DMatrix::zeros(degrees, degrees);
        for row in along.iter().enumerate().filter(|(c, _)| there(*c)) {
            let row = DVector::from_column_slice(row.1);
            normal.syger(1.0, &row, &row, 1.0);
        }
        normal.fill_upper_triangle_with_lower_triangle();
        normal.cholesky()
    };
    let Some(whole) = normal(&|_| true) else {
        return Vec::new();
    };
    let polynomials: Vec<Vec<f64>> = (0..degrees)
        .map(|degree| along.iter().map(|all| all[degree]).collect())
        .collect();
    let mut lines = Vec::with_capacity(image.rows);
    for row in 0..image.rows {
        let values = &image.row(row)[used.clone()];
        let count = values.iter().filter(|v| v.is_finite()).count();
        let beside = |(c, value): (usize, &f64)| {
            if value.is_finite() {
                value - plane.at((used.start + c) as f64, row as f64)
            } else {
                0.0
            }
        };
        let left: Vec<f64> = values.iter().enumerate().map(beside).collect();
        let right = polynomials.iter().map(|p| dot(p, &left));
        let right = DVector::from_iterator(degrees, right);
        let sizes = if count == values.len() {
            Some(whole.solve(&right))
        } else if 2 * count > values.len() {
            normal(&|c| values[c].is_finite()).map(|n| n.solve(&right))
        } else {
            None
        };
        if let Some(sizes) = sizes {
            let v = 2.0 * row as f64 / (image.rows - 1) as f64 - 1.0;
            let powers = legendre(v, DEGREES[1]).into_iter();
            lines.push(Line {
                v,
                powers: powers.map(|[value, _]| value).collect(),
                sizes: sizes.as_slice().to_vec(),
            });
        }
    }
    lines
}

/// How one degree may run across the lines.
struct Tried {
    across: Vec<Across>,
    /// What lines that were held out have beside it.
    left: f64,
    /// Its share before anything is known: all that creep together have that of one.
    share: f64,
}

/// How one degree along the lines runs across them, and by how much that predicts lines better than the plane. What may be chance is
/// left to the plane.
fn of_degree(
    lines: &[Line],
    normals: &[DMatrix<f64>],
    along: usize,
    least: f64,
) -> Option<(f64, Described)> {
    let values = DVector::from_iterator(lines.len(), lines.iter().map(|l| l.sizes[along]));
    let powers = |n: usize| (0..n).map(Across::Power).collect::<Vec<_>>();
    let tried = |across: Vec<Across>, share: f64| {
        let left = held_out(lines, normals, &values, &across)?;
        Some(Tried {
            across,
            left,
            share,
        })
    };
    // What the plane has already.
    let plane = [2, 1].get(along).copied().unwrap_or(0);
    let straight = tried(powers(plane), 1.0)?;
    let more = (plane + 1..=DEGREES[1] + 1).filter_map(|n| tried(powers(n), 1.0));
    let mut all: Vec<Tried> = more.collect();
    let sharp = sharpness(lines, &values, &best(&all)?.across, least)?;
    let mut gained = sharp * (straight.left - best(&all)?.left);
    let pays = gained > BESIDE;
    if !pays {
        if plane == 0 {
            return None;
        }
        // The plane leaves outliers out: what it misses of the rest belongs to the departure.
        all = vec![straight];
    } else if along == 0 {
        // Creep is a matter of whole lines.
        let ends = [false, true].into_iter();
        let times = ends.flat_map(|last| (1..=HALVES).map(move |halves| (last, halves)));
        let logs = times.flat_map(|(from_last, halves)| {
            let tau = 0.5f64.powi(halves);
            let log = Across::Log { tau, from_last };
            (2..=DEGREES[1] / 2 + 1).map(move |n| powers(n).into_iter().chain([log]).collect())
        });
        let logs: Vec<Vec<Across>> = logs.collect();
        let share = 1.0 / logs.len() as f64;
        all.extend(logs.into_iter().filter_map(|log| tried(log, share)));
        let best = best(&all)?;
        gained = sharpness(lines, &values, &best.across, least)? * (straight.left - best.left);
    }
    let mut described = mean(lines, along, &values, &all, least)?;
    if plane > 0 {
        // What the plane does not know is told with the plane.
        let noise = 1.0 / sharpness(lines, &values, &best(&all)?.across, 0.0)?;
        let mut own = described.covariance.view_mut((0, 0), (plane, plane));
        own -= inverse(&design(lines, &powers(plane)))? * noise;
    }
    Some((gained, described))
}

/// That which predicts best.
fn best(all: &[Tried]) -> Option<&Tried> {
    all.iter().min_by(|a, b| a.left.total_cmp(&b.left))
}

/// The mean of all, each weighted by the likelihood of what was held out; its covariance is that of each and how far they are from it.
fn mean(
    lines: &[Line],
    along: usize,
    values: &DVector<f64>,
    all: &[Tried],
    least: f64,
) -> Option<Described> {
    let best = best(all)?;
    let sharp = sharpness(lines, values, &best.across, least)?;
    let noise = 1.0 / sharpness(lines, values, &best.across, 0.0)?;
    let weight = |t: &Tried| {
        let worse = t.left - best.left;
        // Without noise only the best counts.
        t.share
            * if worse > 0.0 {
                (-0.5 * sharp * worse).exp()
            } else {
                1.0
            }
    };
    let most = all.iter().map(weight).fold(0.0, f64::max);
    let all = all.iter().map(|t| (weight(t) / most, t));
    let all: Vec<(f64, &Tried)> = all.filter(|(weight, _)| *weight > NEGLIGIBLE).collect();
    let total: f64 = all.iter().map(|(weight, _)| weight).sum();
    let mut across: Vec<Across> = Vec::new();
    for function in all.iter().flat_map(|(_, t)| &t.across) {
        if !across.contains(function) {
            across.push(*function);
        }
    }
    let place = |function| across.iter().position(|other| other == function);
    let mut told = Vec::with_capacity(all.len());
    let mut mean = DVector::zeros(across.len());
    let mut covariance = DMatrix::zeros(across.len(), across.len());
    for (weight, t) in all {
        let weight = weight / total;
        let to_all = t.across.iter().map(place).collect::<Option<Vec<_>>>()?;
        let own = inverse(&design(lines, &t.across))? * (weight * noise);
        let mut sizes = DVector::zeros(across.len());
        for (i, size) in self::sizes(lines, values, &t.across)?.iter().enumerate() {
            sizes[to_all[i]] = *size;
            for (j, at) in to_all.iter().enumerate() {
                covariance[(to_all[i], *at)] += own[(i, j)];
            }
        }
        mean += &sizes * weight;
        told.push((weight, sizes));
    }
    for (weight, sizes) in told {
        let off = sizes - &mean;
        covariance.syger(weight, &off, &off, 1.0);
    }
    covariance.fill_upper_triangle_with_lower_triangle();
    Some(Described {
        along,
        across,
        sizes: mean,
        covariance,
    })
}

fn inverse(design: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    design.tr_mul(design).try_inverse()
}

/// One over what chance gains: lines are as noisy, and as correlated, as a description leaves them; `least` of noise is always there.
fn sharpness(lines: &[Line], values: &DVector<f64>, across: &[Across], least: f64) -> Option<f64> {
    let left = match across {
        [] => values.clone(),
        _ => values - design(lines, across) * sizes(lines, values, across)?,
    };
    let variance = left.norm_squared() / (left.len() - across.len()) as f64;
    Some(1.0 / (variance * correlated(left.as_slice()) + least * least))
}

/// The sizes of some functions by least squares.
fn sizes(lines: &[Line], values: &DVector<f64>, across: &[Across]) -> Option<DVector<f64>> {
    let design = design(lines, across);
    solved(&design.tr_mul(&design), &design.tr_mul(values))
}

fn design(lines: &[Line], across: &[Across]) -> DMatrix<f64> {
    DMatrix::from_fn(lines.len(), across.len(), |i, j| match across[j] {
        Across::Power(degree) => lines[i].powers[degree],
        log @ Across::Log { .. } => log.at(lines[i].v)[0],
    })
}

fn solved(normal: &DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    Some(normal.clone().cholesky()?.solve(right))
}

/// A block of lines.
fn block(lines: &[Line], b: usize) -> Range<usize> {
    b * lines.len() / BLOCKS..(b + 1) * lines.len() / BLOCKS
}

/// Sum of the squares of what each block of lines has beside what the other blocks predict of it. `normals`: the products of all powers in each block.
fn held_out(
    lines: &[Line],
    normals: &[DMatrix<f64>],
    values: &DVector<f64>,
    across: &[Across],
) -> Option<f64> {
    if across.is_empty() {
        return Some(values.norm_squared());
    }
    let design = design(lines, across);
    let parts = (0..BLOCKS).map(|b| {
        (
            design.rows_range(block(lines, b)),
            values.rows_range(block(lines, b)),
        )
    });
    let parts: Vec<_> = parts.collect();
    let n = across.len();
    let known = across.iter().all(|f| matches!(f, Across::Power(_)));
    let normal = |b: usize| {
        if known {
            normals[b].view((0, 0), (n, n)).into_owned()
        } else {
            parts[b].0.tr_mul(&parts[b].0)
        }
    };
    let own: Vec<_> = (0..BLOCKS)
        .map(|b| (normal(b), parts[b].0.tr_mul(&parts[b].1)))
        .collect();
    let normal: DMatrix<f64> = own.iter().map(|(normal, _)| normal).sum();
    let right: DVector<f64> = own.iter().map(|(_, right)| right).sum();
    let left = parts.iter().zip(&own).map(|((part, values), own)| {
        let sizes = solved(&(&normal - &own.0), &(&right - &own.1))?;
        Some((values - part * sizes).norm_squared())
    });
    left.sum()
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector2};

    use super::*;
    use crate::frame::fit_plane::fit_plane;
    use crate::frame::sensors::from_sensors;
    use crate::numbers::rng::normals;

    const SIZE: [usize; 2] = [96, 120];

    /// A sensor of a steady scan with a departure of (u, v), white noise (nm) and noise of whole lines.
    fn sensor(seed: u64, bent: impl Fn(f64, f64) -> f64, lines: f64) -> Image {
        let mut normal = normals(seed, "bowed", 0);
        let mut values = Vec::new();
        for row in 0..SIZE[1] {
            let of_line = lines * normal();
            for column in 0..SIZE[0] {
                let [u, v] = [(column, SIZE[0]), (row, SIZE[1])]
                    .map(|(i, n)| 2.0 * i as f64 / (n - 1) as f64 - 1.0);
                values.push(30.0 * u + 0.4 * v + bent(u, v) + of_line + 0.2 * normal());
            }
        }
        Image::new(SIZE[1], SIZE[0], values)
    }

    fn found(image: &Image) -> Vec<Described> {
        let used = 0..image.columns;
        departure(image, &fit_plane(image, used.clone()).unwrap(), &used)
    }

    /// Straight scanners keep their planes: white noise, and lines that scatter as a whole.
    #[test]
    fn straight_sensors_keep_their_planes() {
        for seed in 0..60 {
            let image = sensor(seed, |_, _| 0.0, if seed % 2 == 0 { 0.0 } else { 0.1 });
            assert!(found(&image).is_empty(), "{seed}");
        }
    }

    /// Steps over the lower left quarter of a bowed frame, and at one of its places, are as uncertain as the noise of the departure and of
    /// the plane says: mean square pulls of two hundred frames, which are known to a tenth, between 0.8 and 1.25.
    #[test]
    fn noise_of_a_departure_is_that_of_its_steps() {
        let bow = |u: f64, v: f64| 0.8 * (1.0 - u * u) * (1.0 + 0.3 * v);
        let places: Vec<Vector2<f64>> = (0..300)
            .map(|i| Vector2::new(f64::from(i % 20) * 2.4, f64::from(i / 20) * 4.0))
            .collect();
        let at = Vector2::new(20.0, 30.0);
        let middle = places.iter().sum::<Vector2<f64>>() / places.len() as f64;
        let spread: Matrix2<f64> = places
            .iter()
            .map(|p| (p - middle) * (p - middle).transpose())
            .sum();
        let steps = |value: &dyn Fn(Vector2<f64>) -> f64| {
            let sum: Vector2<f64> = places.iter().map(|p| (p - middle) * value(*p)).sum();
            spread.try_inverse().unwrap() * sum
        };
        let place = |n: Vector2<f64>| {
            let [u, v] = [0, 1].map(|i| 2.0 * n[i] / (SIZE[i] - 1) as f64 - 1.0);
            30.0 * u + 0.4 * v + bow(u, v)
        };
        let slope = |f: &dyn Fn(Vector2<f64>) -> f64| {
            let [x, y] = [Vector2::x(), Vector2::y()].map(|way| 0.5 * (f(at + way) - f(at - way)));
            Vector2::new(x, y)
        };
        let (mut of_steps, mut of_slopes) = (Vector2::zeros(), Vector2::zeros());
        for seed in 0..200 {
            let x = sensor(seed, bow, 0.0);
            let y = Image::new(
                SIZE[1],
                SIZE[0],
                (0..SIZE[0] * SIZE[1])
                    .map(|i| (i / SIZE[0]) as f64)
                    .collect(),
            );
            let g = from_sensors(&x, &y).unwrap().geometry;
            let bent = g.departure.as_deref().unwrap();
            let found = |n: Vector2<f64>| (g.place(n) + bent.at(n)).x;
            let noise = bent.noise_of_steps(&places) + g.covariance;
            let at_place: Matrix2<f64> = bent
                .noise_at(at)
                .iter()
                .map(|(axis, slopes)| slopes * axis.x * axis.x)
                .sum();
            let (off, here) = (steps(&found) - steps(&place), slope(&found) - slope(&place));
            for (i, k) in [(0, 0), (1, 2)] {
                of_steps[i] += off[i] * off[i] / noise[(k, k)] / 200.0;
                of_slopes[i] +=
                    here[i] * here[i] / (at_place[(i, i)] + g.covariance[(k, k)]) / 200.0;
            }
        }
        assert!(
            of_steps.iter().all(|p| (0.8..1.25).contains(p)),
            "{of_steps}"
        );
        assert!(
            of_slopes.iter().all(|p| (0.8..1.25).contains(p)),
            "{of_slopes}"
        );
    }

    /// What a scanner does is found to the noise: a bow of the lines that changes from line to line, and creep. 0.2 nm of noise leave some
    /// 0.2 √(p/N) of a description with p numbers in N samples: 0.01 nm for thirty.
    #[test]
    fn bows_and_creep_are_found() {
        let bent = |u: f64, v: f64| {
            0.8 * (1.0 - u * u) * (1.0 + 0.4 * u - 0.2 * v)
                + 0.3 * (1.0 + 0.5 * (1.0 + v) / 0.02).ln()
        };
        let image = sensor(1, bent, 0.0);
        let plane = fit_plane(&image, 0..SIZE[0]).unwrap();
        let terms = found(&image);
        assert!(terms.iter().any(|t| t.along == 2), "{terms:?}");
        let mut square = 0.0;
        for row in 0..SIZE[1] {
            for column in 0..SIZE[0] {
                let [u, v] = [(column, SIZE[0]), (row, SIZE[1])]
                    .map(|(i, n)| 2.0 * i as f64 / (n - 1) as f64 - 1.0);
                let along = legendre(u, DEGREES[0]);
                let of = |t: &Described| {
                    let sum = t.across.iter().zip(t.sizes.iter());
                    along[t.along][0] * sum.map(|(f, size)| f.at(v)[0] * size).sum::<f64>()
                };
                let told: f64 = terms.iter().map(of).sum();
                let truth = 30.0 * u + 0.4 * v + bent(u, v);
                square += (plane.at(column as f64, row as f64) + told - truth).powi(2);
            }
        }
        let rms = (square / (SIZE[0] * SIZE[1]) as f64).sqrt();
        assert!(rms < 0.015, "{rms} {terms:?}");
    }
}

//! Trace and retrace of one image → how far hysteresis bends the lines, where no sensor recorded it.
//!
//! The same line is seen twice, forwards and backwards. What bends it one way forwards and the other way backwards displaces the images
//! against each other along the lines: the trace shows at column c what lies at `c + b`, the retrace what lies at `c − b`. Least squares on
//! the pixels find the b that brings both together, a sum of Legendre polynomials along the lines and across them. It is taken if it
//! predicts blocks of lines that were held out far better than a shift and a shear do, which are delay and drift.
//!
//! # References
//! Lucas & Kanade, Proc. 7th Int. Joint Conf. Artificial Intelligence, 674 (1981), registration by the slope of the image.

use nalgebra::{DMatrix, DVector, Vector2};

use crate::frame::blur::blurred;
use crate::frame::departure::{Across, Term, legendre};
use crate::frame::image::Image;
use crate::numbers::interrupt;
use crate::numbers::median::median;

/// Polynomials along a line and across the lines.
const COUNTS: [usize; 2] = [7, 3];
/// Blocks of lines that are held out in turn.
const BLOCKS: usize = 24;
/// Columns that are enough: images of more are binned.
const ENOUGH: usize = 256;
/// Shifts and bows that are tried first, as a share of the frame: an open scanner bends by 3 % from trace to retrace.
const LARGEST: f64 = 0.02;
/// Of this many lines one is looked at for these.
const EVERY: usize = 4;
/// Rounds of least squares, each of which leaves half of what was left where noise is as strong as the pattern.
const ROUNDS: usize = 12;
/// Steps of the last round, pixels, that are more than this have not come to rest.
const AT_REST: f64 = 0.05;
/// By so much, in units of noise, a bend has to predict the lines that were held out: e⁻²⁵ by chance.
const BEYOND_CHANCE: f64 = 50.0;
/// Differences beyond this many robust standard deviations are cut off.
const OUTLIER: f64 = 4.0;

/// Normal equations.
type Equations = (DMatrix<f64>, DVector<f64>);

/// Both images on the way to each other.
struct Pair {
    /// Trace and retrace, without the means of their lines.
    images: [Image; 2],
    /// Polynomials along a line at each column, and across the lines at each row.
    along: Vec<Vec<f64>>,
    across: Vec<Vec<f64>>,
}

/// The bend b of the trace, pixels along the lines, between ends that stay where they are; `None` where it is not more than chance.
pub(crate) fn bend(trace: &Image, retrace: &Image) -> Option<Vec<Term>> {
    let bin = trace.columns.div_ceil(ENOUGH).max(1);
    let least = 2 * BLOCKS * bin;
    let alike = (retrace.columns, retrace.rows) == (trace.columns, trace.rows);
    if trace.columns < least || trace.rows < least || !alike {
        return None;
    }
    let pair = Pair::new([trace, retrace], bin);
    let every: Vec<usize> = (0..COUNTS[0] * COUNTS[1]).collect();
    let found = pair.fitted(&every, pair.first())?;
    let (blocks, variance) = pair.sums(&found);
    let chosen = chosen(&blocks, variance, &found)?;
    let start = DVector::from_fn(found.len(), |i, _| {
        if chosen.contains(&i) { found[i] } else { 0.0 }
    });
    let found = pair.fitted(&chosen, start)?;
    // Whole lines are as long as they are meant to be: less P₀ or P₁ each polynomial is nothing at both ends, and has no mean slope.
    let bent = chosen.into_iter().filter(|i| !is_affine(*i));
    let terms = bent.flat_map(|i| {
        let [along, across] = [i / COUNTS[1], i % COUNTS[1]];
        let term = |along: usize, sign: f64| Term {
            along,
            across: Across::Power(across),
            size: Vector2::new(sign * found[i] * bin as f64, 0.0),
        };
        let ends = (along > 1).then(|| term(along % 2, -1.0));
        std::iter::once(term(along, 1.0)).chain(ends)
    });
    Some(terms.collect())
}

/// Whether a term is a shift, a stretch or a shear.
fn is_affine(term: usize) -> bool {
    term / COUNTS[1] + term % COUNTS[1] < 2
}

/// The terms that predict blocks of lines that were held out best; `None` where a shift and a shear do nearly as well.
fn chosen(blocks: &[Equations], variance: f64, found: &DVector<f64>) -> Option<Vec<usize>> {
    let mut score = DVector::<f64>::zeros(found.len());
    let mut sum = DMatrix::<f64>::zeros(found.len(), found.len());
    for (normal, right) in blocks {
        score += right.map(|r| r * r);
        sum += normal;
    }
    // Noise that neighbouring pixels share.
    let shared = score.component_div(&sum.diagonal()).mean() / variance;
    let noise = variance * shared.max(1.0);
    let held_out = |terms: &[usize]| -> Option<f64> {
        let own = |(normal, right): &Equations| {
            let right = right + normal * found;
            let normal = normal.select_rows(terms).select_columns(terms);
            (normal, right.select_rows(terms))
        };
        let own: Vec<Equations> = blocks.iter().map(own).collect();
        let zero = own[0].0.map(|_| 0.0);
        let normal = own.iter().fold(zero, |sum, b| sum + &b.0);
        let right = own.iter().fold(own[0].1.map(|_| 0.0), |sum, b| sum + &b.1);
        let of = |b: &Equations| {
            let sizes = (&normal - &b.0).cholesky()?.solve(&(&right - &b.1));
            Some(sizes.dot(&(&b.0 * &sizes)) - 2.0 * sizes.dot(&b.1))
        };
        own.iter().map(of).sum()
    };
    let up_to = |along: usize, across: usize| -> Vec<usize> {
        let within = |i: &usize| is_affine(*i) || i / COUNTS[1] < along && i % COUNTS[1] < across;
        (0..found.len()).filter(within).collect()
    };
    let straight = held_out(&up_to(0, 0))?;
    let degrees = (3..=COUNTS[0]).flat_map(|along| (1..=COUNTS[1]).map(move |n| (along, n)));
    let tried = degrees.filter_map(|(along, across)| {
        let terms = up_to(along, across);
        Some((held_out(&terms)?, terms))
    });
    let (left, terms) = tried.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (straight - left > BEYOND_CHANCE * noise).then_some(terms)
}

impl Pair {
    fn new(images: [&Image; 2], bin: usize) -> Self {
        let (columns, rows) = (images[0].columns, images[0].rows);
        let images = images.map(|image| {
            let mut image = image.binned(bin);
            let width = image.columns;
            for line in image.values.chunks_mut(width) {
                let there = || line.iter().filter(|v| v.is_finite());
                let mean = there().sum::<f64>() / there().count().max(1) as f64;
                for v in line {
                    *v -= mean;
                }
            }
            image
        });
        let polynomials = |count: usize, pixels: usize, degrees: usize| {
            let at = |i: usize| (i as f64 + 0.5) * bin as f64 - 0.5;
            let all = (0..count).map(|i| 2.0 * at(i) / (pixels - 1) as f64 - 1.0);
            let values = |u: f64| legendre(u, degrees - 1).into_iter().map(|[value, _]| value);
            all.map(|u| values(u).collect()).collect::<Vec<Vec<f64>>>()
        };
        Self {
            along: polynomials(images[0].columns, columns, COUNTS[0]),
            across: polynomials(images[0].rows, rows, COUNTS[1]),
            images,
        }
    }

    /// Trace and retrace of a line, each moved to where the other shows the same.
    fn moved(&self, row: usize, found: &DVector<f64>) -> [Vec<f64>; 2] {
        let sizes: Vec<f64> = (found.as_slice().chunks(COUNTS[1]))
            .map(|sizes| {
                sizes
                    .iter()
                    .zip(&self.across[row])
                    .map(|(s, q)| s * q)
                    .sum()
            })
            .collect();
        let bends: Vec<f64> = (self.along.iter())
            .map(|along| along.iter().zip(&sizes).map(|(p, s)| p * s).sum())
            .collect();
        [(0, -1.0), (1, 1.0)].map(|(way, sign)| {
            let line = self.images[way].row(row);
            let moved = |(c, bend): (usize, &f64)| {
                let at = c as f64 + sign * bend;
                let first = at.floor();
                if !(first >= 0.0 && first + 1.0 < line.len() as f64) {
                    return f64::NAN;
                }
                let (i, share) = (first as usize, at - first);
                line[i] + share * (line[i + 1] - line[i])
            };
            bends.iter().enumerate().map(moved).collect()
        })
    }

    /// The shift and the bow that bring both nearest to each other.
    fn first(&self) -> DVector<f64> {
        let steps = (LARGEST * self.along.len() as f64).ceil() as i32;
        let every = (-steps..=steps).flat_map(|a| (-steps..=steps).map(move |b| [a, b]));
        let start = |[shift, bow]: [i32; 2]| {
            let mut found = DVector::zeros(COUNTS[0] * COUNTS[1]);
            // 1 − u² = 2/3 (P₀ − P₂).
            let bow = f64::from(bow) * 2.0 / 3.0;
            found[0] = f64::from(shift) + bow;
            found[2 * COUNTS[1]] = -bow;
            found
        };
        let far = |found: &DVector<f64>| {
            interrupt::check();
            let (mut squares, mut count) = (0.0, 0.0);
            for row in (0..self.across.len()).step_by(EVERY) {
                let [trace, retrace] = self.moved(row, found);
                for off in trace.iter().zip(&retrace).map(|(t, r)| t - r) {
                    if off.is_finite() {
                        squares += off * off;
                        count += 1.0;
                    }
                }
            }
            squares / count
        };
        let all = every.map(start).map(|found| (far(&found), found));
        let nearest = all.min_by(|a, b| a.0.total_cmp(&b.0));
        nearest.map(|(_, found)| found).unwrap_or_default()
    }

    /// Least squares for some terms, from a start.
    fn fitted(&self, terms: &[usize], start: DVector<f64>) -> Option<DVector<f64>> {
        let mut found = start;
        let mut last = f64::INFINITY;
        for _ in 0..ROUNDS {
            let (blocks, _) = self.sums(&found);
            let mut normal = DMatrix::zeros(terms.len(), terms.len());
            let mut right = DVector::zeros(terms.len());
            for (n, r) in &blocks {
                normal += n.select_rows(terms).select_columns(terms);
                right += r.select_rows(terms);
            }
            let step = normal.cholesky()?.solve(&right);
            last = step.amax();
            for (i, step) in terms.iter().zip(step.iter()) {
                found[*i] += step;
            }
        }
        (last < AT_REST).then_some(found)
    }

    /// Normal equations of a step for each block of lines, and the mean square of what is left.
    fn sums(&self, found: &DVector<f64>) -> (Vec<Equations>, f64) {
        interrupt::check();
        let (columns, rows) = (self.along.len(), self.across.len());
        let lines: Vec<[Vec<f64>; 2]> = (0..rows).map(|row| self.moved(row, found)).collect();
        let both = |of: fn(f64, f64) -> f64| {
            let pixels = lines.iter().flat_map(|[t, r]| t.iter().zip(r));
            Image::new(rows, columns, pixels.map(|(t, r)| of(*t, *r)).collect())
        };
        let off = both(|t, r| t - r);
        let mean = both(|t, r| 0.5 * (t + r));
        let mean = Image::new(rows, columns, blurred(&mean, [1.0; 2]));
        let mut sizes: Vec<f64> = off.finite().into_iter().map(f64::abs).collect();
        let limit = if sizes.is_empty() {
            0.0
        } else {
            OUTLIER * 1.4826 * median(&mut sizes)
        };
        let count = COUNTS[0] * COUNTS[1];
        let (mut squares, mut pixels) = (0.0, 0.0);
        let block = |b: usize| {
            let mut normal = DMatrix::zeros(count, count);
            let mut right = DVector::zeros(count);
            for row in b * rows / BLOCKS..(b + 1) * rows / BLOCKS {
                let mut products = DMatrix::<f64>::zeros(COUNTS[0], COUNTS[0]);
                let mut sums = DVector::<f64>::zeros(COUNTS[0]);
                let (mean, off) = (mean.row(row), off.row(row));
                for c in 1..columns - 1 {
                    if !off[c].is_finite() {
                        continue;
                    }
                    let slope = mean[c + 1] - mean[c - 1];
                    let off = off[c].clamp(-limit, limit);
                    squares += off * off;
                    pixels += 1.0;
                    for (i, p) in self.along[c].iter().enumerate() {
                        sums[i] += slope * off * p;
                        for (j, q) in self.along[c][..=i].iter().enumerate() {
                            products[(i, j)] += slope * slope * p * q;
                        }
                    }
                }
                products.fill_upper_triangle_with_lower_triangle();
                let across = DVector::from_column_slice(&self.across[row]);
                normal += products.kronecker(&(&across * across.transpose()));
                right += sums.kronecker(&across);
            }
            (normal, right)
        };
        let blocks = (0..BLOCKS).map(block).collect();
        (blocks, squares / f64::max(pixels, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::departure::Departure;
    use crate::numbers::rng::normals;

    const SIZE: [usize; 2] = [150, 130];

    /// Trace and retrace of a lattice in noise, whose lines are bent by ±b; the retrace is shifted and sheared against the trace.
    fn images(seed: u64, b: impl Fn(f64, f64) -> f64) -> [Image; 2] {
        let mut normal = normals(seed, "hysteresis", 0);
        [1.0, -1.0].map(|way| {
            let value = |i: usize| {
                let (column, row) = ((i % SIZE[0]) as f64, (i / SIZE[0]) as f64);
                let [u, v] = [(column, SIZE[0]), (row, SIZE[1])]
                    .map(|(at, n)| 2.0 * at / (n - 1) as f64 - 1.0);
                let x = column + way * (b(u, v) + 0.7 + 0.2 * u - 0.1 * v);
                let (p, q) = (0.5 * x + 0.1 * row, 0.17 * x + 0.52 * row);
                let wave = p.cos() + q.cos() + (p - q).cos();
                wave + 0.5 * normal()
                    + if (i / SIZE[0]).is_multiple_of(9) {
                        way
                    } else {
                        0.0
                    }
            };
            let values = (0..SIZE[0] * SIZE[1]).map(value).collect();
            Image::new(SIZE[1], SIZE[0], values)
        })
    }

    /// A shift, a stretch and a shear are no hysteresis.
    #[test]
    fn straight_lines_stay_straight() {
        for seed in 0..12 {
            let [trace, retrace] = images(seed, |_, _| 0.0);
            assert_eq!(bend(&trace, &retrace), None, "{seed}");
        }
    }

    /// Bows of 0.3 to 2.4 pixels are found to a tenth of a pixel; 0.5 of noise at slopes of some 0.5 per pixel leave √(2 · 10/20,000) · 1 =
    /// 0.03 pixels of ten numbers.
    #[test]
    fn bows_are_found() {
        for (seed, size) in [0.3, -0.9, 2.4].into_iter().enumerate() {
            let b = |u: f64, v: f64| size * (1.0 - u * u) * (1.0 + 0.4 * u - 0.2 * v);
            let [trace, retrace] = images(seed as u64, b);
            let terms = bend(&trace, &retrace).unwrap();
            let found = Departure::new(terms, [0, SIZE[0] - 1], [0, SIZE[1] - 1]);
            let mut squares = 0.0;
            for row in 0..SIZE[1] {
                let v = 2.0 * row as f64 / (SIZE[1] - 1) as f64 - 1.0;
                for (column, off) in found.line(row, SIZE[0]).iter().enumerate() {
                    let u = 2.0 * column as f64 / (SIZE[0] - 1) as f64 - 1.0;
                    squares += (off.x - b(u, v)).powi(2);
                }
            }
            let rms = (squares / (SIZE[0] * SIZE[1]) as f64).sqrt();
            assert!(rms < 0.1, "{size}: {rms}");
        }
    }
}

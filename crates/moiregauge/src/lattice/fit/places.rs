//! Where in a frame noise lies, and how much more, or less, it moves the wave vectors there.
//!
//! Noise is read under a Hann window, which sees the middle of a frame; a wave vector is moved by noise in proportion to its distance from the
//! middle. Where noise is the same everywhere that makes no difference. What a bump leaves in the middle moves a wave vector by a third of what the
//! window says, and in a corner by three times as much.
//!
//! The power of the residual times X around a harmonic is, over `Σ X²`, the noise as it acts on the x component, wherever it lies; the same
//! with Y, and with 1 for the phase. Its ratio to the power under the Hann window in the same bins is the factor that is wanted, and is taken
//! as far as chance does not explain it.
//!
//! # References
//! White, Econometrica 48, 817 (1980): the covariance of a fit with errors that are larger in some places.

use std::f64::consts::PI;
use std::ops::RangeInclusive;

use nalgebra::{Matrix2, Vector2};
use rustfft::num_complex::Complex64;

use crate::lattice::fit::frame::{Frame, turns, wave};
use crate::lattice::fit::left::LeftOver;
use crate::lattice::fit::model::Model;
use crate::lattice::fit::noise::BESIDE;
use crate::numbers::dot::dot;
use crate::spectrum::hann::hann;
use crate::spectrum::shells::FIRST_SHELL;

/// Bins on either side of a harmonic across the lines; along them, one.
const ACROSS: i64 = 16;
/// Bins nearer than this to a point of the lattice hold what the fit has emptied, or what it has left of a harmonic.
const NEAR: f64 = 2.0;
/// Slower waves are background, and what whole lines do.
const SLOWEST: f64 = 3.0;
/// Standard deviations of the logarithm of a ratio that chance explains.
const CHANCE: f64 = 2.0;

/// Weights under which the residual is looked at: 1, X, Y, the Hann window, and the distance from the middle.
const WEIGHTS: usize = 5;
/// The place of the last two among them.
const HANN: usize = 3;
const DISTANCE: usize = 4;

/// The frequencies that are looked at: around each first harmonic.
pub(crate) struct Places {
    around: Vec<Around>,
    x: Vec<f64>,
    y: Vec<f64>,
    hann: [Vec<f64>; 2],
    /// Sums of the squares of the weights over the pixels that count.
    squares: [f64; WEIGHTS],
    /// Lines have offsets, which take up their means.
    offsets: bool,
}

/// Bins around one harmonic, cycles per frame.
struct Around {
    /// Columns of the transform, with cosine and sine of each along the lines.
    columns: Vec<(i64, [Vec<f64>; 2])>,
    /// Those of them that tell what images share, beside what whole lines do.
    shared: Vec<i64>,
    rows: RangeInclusive<i64>,
}

/// Sums over one line under each weight, of each column around each harmonic.
pub(crate) type OfLine = Vec<[Complex64; WEIGHTS]>;

/// What the lines say together.
pub(crate) struct InPlaces {
    /// By how much noise is more than what the Hann window says, as it acts along x, along y and on the phases.
    pub(crate) factors: [f64; 3],
    /// What is left around each first harmonic, weighted with the distance from the middle.
    pub(crate) left: [LeftOver; 3],
}

impl Places {
    pub(crate) fn new(frame: &Frame, model: &Model, offsets: bool) -> Self {
        let middle = frame.middle();
        let x: Vec<f64> = frame.x.iter().map(|x| x - middle.x).collect();
        let y: Vec<f64> = frame.y.iter().map(|y| y - middle.y).collect();
        let hann = [frame.image.columns, frame.image.rows].map(hann);
        let first = model.basis.indices.iter().take(FIRST_SHELL.len());
        let around = first.map(|&index| Around::new(frame, wave(&model.pair, index), offsets));
        Self {
            around: around.collect(),
            squares: squares(frame, &x, &y, &hann),
            x,
            y,
            hann,
            offsets,
        }
    }

    /// The sums over a line of the residual, 0 where pixels do not count.
    pub(crate) fn of_line(&self, row: usize, line: &[f64], pixels: &[f64]) -> OfLine {
        let there = || {
            line.iter()
                .zip(pixels)
                .enumerate()
                .filter(|(_, (_, pixel))| pixel.is_finite())
        };
        let mean = if self.offsets {
            there().map(|(_, (value, _))| value).sum::<f64>() / there().count().max(1) as f64
        } else {
            0.0
        };
        let [mut plain, mut tilted, mut windowed, mut distant] =
            [0; 4].map(|_| vec![0.0; line.len()]);
        let (y, up) = (self.y[row], self.hann[1][row]);
        for (i, (value, _)) in there() {
            let value = value - mean;
            plain[i] = value;
            tilted[i] = value * self.x[i];
            windowed[i] = value * self.hann[0][i];
            distant[i] = value * self.x[i].hypot(y);
        }
        let columns = self.around.iter().flat_map(|around| &around.columns);
        let of_column = |(_, [cos, sin]): &(i64, [Vec<f64>; 2])| {
            let sum = |line: &[f64]| Complex64::new(dot(line, cos), dot(line, sin));
            let here = sum(&plain);
            [
                here,
                sum(&tilted),
                here * y,
                sum(&windowed) * up,
                sum(&distant),
            ]
        };
        columns.map(of_column).collect()
    }

    /// What all lines say; those that do not count say nothing.
    pub(crate) fn of_lines(
        &self,
        frame: &Frame,
        model: &Model,
        lines: &[Option<OfLine>],
    ) -> InPlaces {
        let inverse = (model.pair / PI).try_inverse();
        let is_noise = |k: Vector2<f64>| {
            let from_lattice = |inverse: Matrix2<f64>| {
                (k - model.pair * (inverse * k).map(f64::round) / PI).norm()
            };
            k.x.abs() > 1.0 && k.norm() > SLOWEST && inverse.map_or(0.0, from_lattice) > NEAR
        };
        let mut powers = Powers::default();
        let mut first = 0;
        let left: Vec<LeftOver> = (self.around.iter())
            .map(|around| {
                let up = around.rows.clone().map(|y| turns(-PI * y as f64, &frame.y));
                let up: Vec<Vec<Complex64>> = up.collect();
                let column = |c: usize| {
                    let sums = up.iter().map(|up| transform(lines, first + c, up));
                    sums.collect::<Vec<_>>()
                };
                let columns: Vec<_> = (0..around.columns.len()).map(column).collect();
                first += columns.len();
                for ((x, _), column) in around.columns.iter().zip(&columns) {
                    for (y, sums) in around.rows.clone().zip(column) {
                        if is_noise(Vector2::new(*x as f64, y as f64)) {
                            powers.add(std::array::from_fn(|w| {
                                sums[w].norm_sqr() / self.squares[w]
                            }));
                        }
                    }
                }
                LeftOver::new(around.shared.clone(), around.rows.clone(), |x, y| {
                    let column = around.columns.iter().position(|(column, _)| *column == x);
                    let row = (y - around.rows.start()) as usize;
                    column.map_or(Complex64::ZERO, |column| columns[column][row][DISTANCE])
                })
            })
            .collect();
        InPlaces {
            factors: powers.factors(),
            left: left.try_into().unwrap_or_default(),
        }
    }
}

impl Around {
    /// Around a harmonic with such a phase at the edges.
    fn new(frame: &Frame, p: Vector2<f64>, offsets: bool) -> Self {
        let centre = (p / PI).map(|k| k.round() as i64);
        // Noise of whole lines stands at kx = 0 alone, and beside it where the lines end: what lies at another kx says nothing of it.
        let (columns, shared) = if offsets && centre.x.abs() < BESIDE {
            (vec![-BESIDE, BESIDE, BESIDE + 1], vec![-BESIDE, BESIDE])
        } else {
            let columns: Vec<i64> = (centre.x - 1..=centre.x + 1).collect();
            (columns.clone(), columns)
        };
        let turned = |k: i64| {
            let turns = turns(-PI * k as f64, &frame.x);
            let (cos, sin) = turns.iter().map(|turn| (turn.re, turn.im)).unzip();
            (k, [cos, sin])
        };
        Self {
            columns: columns.into_iter().map(turned).collect(),
            shared,
            rows: centre.y - ACROSS..=centre.y + ACROSS,
        }
    }
}

/// The transform at a row, whose turns are given, in one of the columns.
fn transform(lines: &[Option<OfLine>], column: usize, up: &[Complex64]) -> [Complex64; WEIGHTS] {
    let mut sums = [Complex64::ZERO; WEIGHTS];
    for (line, turn) in lines.iter().zip(up) {
        for (sum, value) in sums
            .iter_mut()
            .zip(line.iter().flat_map(|line| &line[column]))
        {
            *sum += value * turn;
        }
    }
    sums
}

/// Sums of the squares of the weights over the pixels that count.
fn squares(frame: &Frame, x: &[f64], y: &[f64], hann: &[Vec<f64>; 2]) -> [f64; WEIGHTS] {
    let square = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
    let [mut one, mut along, mut across, mut windowed] = [0.0; 4];
    let (columns, all_x, all_hann) = (x.len() as f64, square(x), square(&hann[0]));
    for row in (0..y.len()).filter(|row| frame.present[*row] > 0) {
        one += columns;
        along += all_x;
        across += columns * y[row].powi(2);
        windowed += all_hann * hann[1][row].powi(2);
    }
    for &[row, column] in &frame.missing {
        one -= 1.0;
        along -= x[column].powi(2);
        across -= y[row].powi(2);
        windowed -= (hann[0][column] * hann[1][row]).powi(2);
    }
    [one, along, across, windowed, along + across]
}

/// Powers in bins of noise under each weight, over the sums of the squares of the weights.
#[derive(Default)]
struct Powers {
    sums: [f64; WEIGHTS],
    squares: [f64; WEIGHTS],
}

impl Powers {
    fn add(&mut self, powers: [f64; WEIGHTS]) {
        for ((sum, squares), power) in self.sums.iter_mut().zip(&mut self.squares).zip(powers) {
            *sum += power;
            *squares += power * power;
        }
    }

    /// The ratio of the power with X, with Y and with 1 to that under the Hann window, each nearer to 1 by what chance may do.
    fn factors(&self) -> [f64; 3] {
        // Variance of the logarithm of a sum of powers.
        let scatter = |w: usize| self.squares[w] / self.sums[w].powi(2);
        [1, 2, 0].map(|w| {
            let ratio = (self.sums[w] / self.sums[HANN]).ln();
            let chance = CHANCE * (scatter(w) + scatter(HANN)).sqrt();
            let told = ratio.abs() - chance;
            if told > 0.0 && told.is_finite() {
                (told * ratio.signum()).exp()
            } else {
                1.0
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::background::Background;
    use crate::frame::image::Image;
    use crate::lattice::fit::fitted::LatticeFit;
    use crate::lattice::fit::measure::measure;
    use crate::numbers::rng::normals;
    use crate::spectrum::harmonics::Windowed;
    use crate::spectrum::shells::shells;

    const SIZE: [usize; 2] = [128, 112];
    const SEEDS: u64 = 40;

    fn pair() -> Matrix2<f64> {
        Matrix2::new(0.45, -0.02, 0.21, 0.52)
    }

    /// A lattice in noise of a standard deviation that depends on the place (X, Y).
    fn fitted(seed: u64, sigma: impl Fn(f64, f64) -> f64) -> LatticeFit {
        let mut normal = normals(seed, "places", 0);
        let value = |i: usize| {
            let at = Vector2::new((i % SIZE[0]) as f64, (i / SIZE[0]) as f64);
            let [a, b] = [0, 1].map(|j| pair().column(j).dot(&at));
            let place = [0, 1].map(|axis| 2.0 * at[axis] / SIZE[axis] as f64 - 1.0);
            a.cos() + b.cos() + (b - a).cos() + sigma(place[0], place[1]) * normal()
        };
        let image = Image::new(
            SIZE[1],
            SIZE[0],
            (0..SIZE[0] * SIZE[1]).map(value).collect(),
        );
        let start = Windowed::new(&image).fit(&image, &pair(), Background::Plane, shells(3));
        measure(&image, &start.unwrap(), Background::Plane, None)
            .unwrap()
            .fit
    }

    /// Mean squares of the errors along x and y over their variances, and the mean variances.
    fn pulls(sigma: impl Fn(f64, f64) -> f64) -> ([f64; 2], [f64; 2]) {
        let (mut pulls, mut variances) = ([0.0; 2], [0.0; 2]);
        for seed in 0..SEEDS {
            let found = fitted(seed, &sigma).wave_vectors;
            let off = found.basis - pair();
            for axis in 0..2 {
                for wave in 0..2 {
                    let variance = found.covariance[(2 * wave + axis, 2 * wave + axis)];
                    let share = 1.0 / (2.0 * SEEDS as f64);
                    pulls[axis] += share * off[(axis, wave)].powi(2) / variance;
                    variances[axis] += share * variance;
                }
            }
        }
        (pulls, variances)
    }

    /// Errors are right where noise lies in the middle, at two sides, or in one corner; what X and Y do to them is told apart. The rms pull
    /// of eighty waves is known to a twelfth.
    #[test]
    fn errors_know_where_noise_lies() {
        let inside = |x: f64, y: f64, half: f64| x.abs().max(y.abs()) < half;
        let places: [&dyn Fn(f64, f64) -> f64; 3] = [
            &|x, y| if inside(x, y, 0.3) { 2.5 } else { 0.2 },
            &|x, _| if x.abs() > 0.8 { 2.0 } else { 0.2 },
            &|x, y| {
                if inside(x - 0.7, y - 0.7, 0.3) {
                    2.5
                } else {
                    0.2
                }
            },
        ];
        for (n, sigma) in places.iter().enumerate() {
            let (pulls, variances) = pulls(sigma);
            let rms = pulls.map(f64::sqrt);
            assert!(
                rms.iter().all(|rms| (0.75..1.3).contains(rms)),
                "{n}: {rms:?}"
            );
            if n == 1 {
                // Σ X² over the two strips over Σ X² of the frame is 0.81 · 3; of Y² it is 1.
                let ratio = variances[0] / variances[1] * (SIZE[0] as f64 / SIZE[1] as f64).powi(2);
                assert!((1.7..3.0).contains(&ratio), "{ratio}");
            }
        }
    }

    /// Noise that is the same everywhere changes nothing.
    #[test]
    fn even_noise_is_left_as_it_is() {
        let even = Powers {
            sums: [100.0, 104.0, 95.0, 100.0, 100.0],
            squares: [200.0; WEIGHTS],
        };
        assert_eq!(even.factors(), [1.0; 3]);
        assert_eq!(Powers::default().factors(), [1.0; 3]);
        let (rms, _) = pulls(|_, _| 0.5);
        assert!(
            rms.iter().all(|rms| (0.75..1.3).contains(&rms.sqrt())),
            "{rms:?}"
        );
    }
}

//! The neighbourhood of a node: interpolation, the mean node, and the fit of one to the other.

use nalgebra::{Matrix6, Vector2, Vector6};

use crate::frame::blur::blurred;
use crate::frame::image::Image;

/// Smoothing of the mean node (standard deviation), share of the radius of a patch: less than a node is wide. On the scenes of docs/constants.md half
/// and double change results by at most 0.21 σ.
const SMOOTH: f64 = 0.1;

/// An image between its pixels: Catmull–Rom, with slopes. `None` at edges and beside missing pixels.
pub(crate) fn sample(image: &Image, at: Vector2<f64>) -> Option<[f64; 3]> {
    let (column, row) = (at.x.floor(), at.y.floor());
    let fits = |first: f64, count: usize| first >= 1.0 && first + 2.0 < count as f64;
    if !(fits(column, image.columns) && fits(row, image.rows)) {
        return None;
    }
    let ((wx, dx), (wy, dy)) = (weights(at.x - column), weights(at.y - row));
    let (column, row) = (column as usize, row as usize);
    let mut sum = [0.0; 3];
    for j in 0..4 {
        let line = &image.row(row + j - 1)[column - 1..column + 3];
        let along: f64 = line.iter().zip(wx).map(|(v, w)| v * w).sum();
        let slope: f64 = line.iter().zip(dx).map(|(v, w)| v * w).sum();
        sum[0] += wy[j] * along;
        sum[1] += wy[j] * slope;
        sum[2] += dy[j] * along;
    }
    sum[0].is_finite().then_some(sum)
}

/// Weights of four neighbours at `t` beyond the second one, and their slopes.
fn weights(t: f64) -> ([f64; 4], [f64; 4]) {
    let (t2, t3) = (t * t, t * t * t);
    (
        [
            0.5 * (-t3 + 2.0 * t2 - t),
            0.5 * (3.0 * t3 - 5.0 * t2 + 2.0),
            0.5 * (-3.0 * t3 + 4.0 * t2 + t),
            0.5 * (t3 - t2),
        ],
        [
            0.5 * (-3.0 * t2 + 4.0 * t - 1.0),
            0.5 * (9.0 * t2 - 10.0 * t),
            0.5 * (-9.0 * t2 + 8.0 * t + 1.0),
            0.5 * (3.0 * t2 - 2.0 * t),
        ],
    )
}

/// The mean of the image about nodes, and the pixels that are fitted.
pub(crate) struct Template {
    /// Half a side of the picture, pixels.
    half: usize,
    picture: Image,
    /// The same smoothed, for slopes.
    smooth: Image,
    /// Radii of the fitted ellipse along columns and rows, pixels.
    radius: [f64; 2],
    /// Whether every line of a patch has an offset of its own.
    pub(crate) lines: bool,
}

/// A node fitted to a template.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fit {
    pub(crate) place: Vector2<f64>,
    pub(crate) amplitude: f64,
    /// Inverse normal matrix: amplitude, place, offset, slopes; times the variance of a pixel it is the covariance.
    pub(crate) inverse: Matrix6<f64>,
    pub(crate) variance: f64,
    /// Share of the ellipse that lies within the image.
    pub(crate) share: f64,
    /// Variance of the mean residuals of lines over what white noise gives.
    pub(crate) line_excess: f64,
    /// Correlation of the residuals of neighbours along columns and rows.
    pub(crate) correlation: [f64; 2],
}

impl Template {
    /// The mean of the image about these places, less its own mean.
    pub(crate) fn mean(image: &Image, places: &[Vector2<f64>], radius: [f64; 2]) -> Option<Self> {
        let half = radius[0].max(radius[1]).ceil() as usize + 4;
        let side = 2 * half + 1;
        let (mut sum, mut count) = (vec![0.0; side * side], vec![0.0f64; side * side]);
        for place in places {
            for (n, (sum, count)) in sum.iter_mut().zip(&mut count).enumerate() {
                let step = Vector2::new((n % side) as f64, (n / side) as f64);
                let at = place + step - Vector2::repeat(half as f64);
                if let Some([value, ..]) = sample(image, at) {
                    *sum += value;
                    *count += 1.0;
                }
            }
        }
        if count.iter().any(|c| *c < 1.0) {
            return None;
        }
        let values: Vec<f64> = sum.iter().zip(&count).map(|(s, c)| s / c).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let picture = Image::new(side, side, values.iter().map(|v| v - mean).collect());
        // Slopes of noise left in the mean would pass for slopes of the node: places would seem too certain.
        let smooth = blurred(&picture, radius.map(|r| SMOOTH * r));
        Some(Self {
            half,
            smooth: Image::new(side, side, smooth),
            picture,
            radius,
            lines: false,
        })
    }

    /// Moves a node until the template fits: `b + c·(r − r₀) + a T(r − r₀)`, Gauss–Newton.
    pub(crate) fn fit(&self, image: &Image, start: Vector2<f64>) -> Option<Fit> {
        let mut place = start;
        let mut amplitude = 1.0;
        let mut last = None;
        for _ in 0..12 {
            let (fit, step) = self.step(image, place, amplitude)?;
            // Steps are held within a fifth of the radius.
            let limit = 0.2 * self.radius[0].min(self.radius[1]);
            let step = step * (limit / step.norm()).min(1.0);
            place += step;
            amplitude = fit.amplitude.max(0.05);
            last = Some(fit);
            if step.norm() < 1e-4 {
                break;
            }
            if (place - start).norm() > self.radius[0].max(self.radius[1]) {
                return None;
            }
        }
        last.map(|fit| Fit { place, ..fit })
    }

    /// One linear solution about a place; amplitude as it comes out, step of the place.
    fn step(
        &self,
        image: &Image,
        place: Vector2<f64>,
        amplitude: f64,
    ) -> Option<(Fit, Vector2<f64>)> {
        let (rows, all) = self.pixels(image, place, amplitude);
        // Instrumental variables: noise in the slopes of the mean node is not in the probes.
        let (mut normal, mut right, mut count) = (Matrix6::zeros(), Vector6::zeros(), 0.0);
        let mut probes = Matrix6::zeros();
        for pixel in rows.iter().flatten() {
            normal += pixel.probe * pixel.gradient.transpose();
            probes += pixel.probe * pixel.probe.transpose();
            right += pixel.probe * pixel.value;
            count += 1.0;
        }
        if self.lines {
            // The offset and the slope along columns are those of the lines.
            for gone in [3, 5] {
                normal[(gone, gone)] += 1.0;
            }
        }
        let inverse = normal.try_inverse()?;
        let found = inverse * right;
        let inverse = inverse * probes * inverse.transpose();
        let used = rows.iter().filter(|l| !l.is_empty()).count() as f64;
        let free = count - if self.lines { used + 4.0 } else { 6.0 };
        if free < 10.0 {
            return None;
        }
        let residuals: Vec<Vec<(f64, f64)>> = rows
            .iter()
            .map(|l| {
                l.iter()
                    .map(|p| (p.column, p.value - p.gradient.dot(&found)))
                    .collect()
            })
            .collect();
        let variance = residuals.iter().flatten().map(|r| r.1 * r.1).sum::<f64>() / free;
        let (line_excess, correlation) = structure(&residuals, variance);
        let fit = Fit {
            place,
            amplitude: found[0],
            inverse,
            variance,
            share: count / all.max(1.0),
            line_excess,
            correlation,
        };
        Some((fit, Vector2::new(found[1], found[2])))
    }

    /// The pixels of a patch line by line, less the means of lines that have offsets; and how many there would be.
    fn pixels(&self, image: &Image, place: Vector2<f64>, amplitude: f64) -> (Vec<Vec<Pixel>>, f64) {
        let low = (place - Vector2::from(self.radius)).map(f64::ceil);
        let high = (place + Vector2::from(self.radius)).map(f64::floor);
        let (mut rows, mut all): (Vec<Vec<Pixel>>, f64) = (Vec::new(), 0.0);
        let mut row = low.y;
        while row <= high.y {
            let mut line = Vec::new();
            let mut column = low.x;
            while column <= high.x {
                let away = Vector2::new(column, row) - place;
                let inside =
                    (away.x / self.radius[0]).powi(2) + (away.y / self.radius[1]).powi(2) <= 1.0;
                if inside {
                    all += 1.0;
                    if let Some(pixel) = self.pixel(image, [column, row], away, amplitude) {
                        line.push(pixel);
                    }
                }
                column += 1.0;
            }
            rows.push(line);
            row += 1.0;
        }
        if self.lines {
            for line in &mut rows {
                less_mean(line);
            }
        }
        (rows, all)
    }

    fn pixel(
        &self,
        image: &Image,
        [column, row]: [f64; 2],
        away: Vector2<f64>,
        amplitude: f64,
    ) -> Option<Pixel> {
        let inside = |v: f64, count: usize| v >= 0.0 && v < count as f64;
        if !(inside(column, image.columns) && inside(row, image.rows)) {
            return None;
        }
        let value = image.row(row as usize)[column as usize];
        let at = away + Vector2::repeat(self.half as f64);
        let [t, x, y] = sample(&self.picture, at)?;
        let [_, sx, sy] = sample(&self.smooth, at)?;
        value.is_finite().then(|| Pixel {
            column,
            value,
            // A node moved by d shows T(r − r₀ − d) = T − ∇T·d.
            gradient: Vector6::new(t, -amplitude * x, -amplitude * y, 1.0, away.x, away.y),
            probe: Vector6::new(t, -amplitude * sx, -amplitude * sy, 1.0, away.x, away.y),
        })
    }
}

struct Pixel {
    column: f64,
    value: f64,
    /// What the parameters change.
    gradient: Vector6<f64>,
    /// What they are measured with: the same with slopes of the smoothed mean node.
    probe: Vector6<f64>,
}

fn less_mean(line: &mut [Pixel]) {
    let count = line.len().max(1) as f64;
    let value = line.iter().map(|p| p.value).sum::<f64>() / count;
    let gradient = line.iter().map(|p| p.gradient).sum::<Vector6<f64>>() / count;
    let probe = line.iter().map(|p| p.probe).sum::<Vector6<f64>>() / count;
    for pixel in line {
        pixel.value -= value;
        pixel.gradient -= gradient;
        pixel.probe -= probe;
    }
}

/// How much lines share, and how alike neighbours are, in the residuals of a patch (column, residual).
fn structure(rows: &[Vec<(f64, f64)>], variance: f64) -> (f64, [f64; 2]) {
    let (mut excess, mut lines) = (0.0, 0.0f64);
    let (mut along, mut up, mut pairs) = (0.0, 0.0, [0.0f64; 2]);
    for (i, row) in rows.iter().enumerate() {
        if row.len() > 4 {
            let mean = row.iter().map(|r| r.1).sum::<f64>() / row.len() as f64;
            excess += mean * mean * row.len() as f64 / variance.max(f64::MIN_POSITIVE);
            lines += 1.0;
        }
        for two in row.windows(2).filter(|w| w[1].0 - w[0].0 == 1.0) {
            along += two[0].1 * two[1].1;
            pairs[0] += 1.0;
        }
        let Some(next) = rows.get(i + 1) else {
            continue;
        };
        let mut above = next.iter().peekable();
        for (column, value) in row {
            while above.next_if(|n| n.0 < *column).is_some() {}
            if let Some((_, other)) = above.peek().filter(|n| n.0 == *column) {
                up += value * other;
                pairs[1] += 1.0;
            }
        }
    }
    let share = |sum: f64, count: f64| sum / count.max(1.0) / variance.max(f64::MIN_POSITIVE);
    (
        excess / lines.max(1.0),
        [share(along, pairs[0]), share(up, pairs[1])],
    )
}

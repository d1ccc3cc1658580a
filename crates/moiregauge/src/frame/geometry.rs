//! Where each pixel really was, and when.
//!
//! A frame is an affine map of pixel indices `n = (column, row)`: position `r = r₀ + J n` (nm) and
//! time `t = t₀ + τ·n` (s). `J` comes from a plane fit to the position sensors, or from the nominal
//! size and rotation. It may be a sheared, rotated parallelogram.
//!
//! # References
//! Plane fit and tip velocities: Tran et al., arXiv:2406.08681. With N pixels the extent is
//! `(N − 1)·|column of J|`: positions are those of pixel centres.

use std::sync::Arc;

use heterostrain::lattice::both;
use nalgebra::{Matrix2, Matrix4, Vector2};
use serde::{Deserialize, Serialize};
use spmfile::{FrameDirection, LineDirection, Scan};

use crate::frame::axis::Axis;
use crate::frame::departure::Departure;
use crate::frame::grid_errors::Bends;
use crate::numbers::exact;

/// The affine map from pixels to nm.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Geometry {
    /// Number of samples in a line and of lines.
    pub size: [usize; 2],
    /// `J`: columns are the steps from column to column and from row to row, nm.
    #[serde(with = "exact")]
    pub pixel_to_nm: Matrix2<f64>,
    /// Position of pixel (0, 0), nm.
    #[serde(with = "exact")]
    pub origin: Vector2<f64>,
    /// Covariance of the entries of `J`, `(J₁₁, J₂₁, J₁₂, J₂₂)`.
    #[serde(with = "exact")]
    pub covariance: Matrix4<f64>,
    /// Whether it comes from position sensors.
    pub from_sensors: bool,
    /// What the sensors say beside the affine map, nm; `None` of a straight scanner. It belongs to the pixels and is not stored
    /// with what was measured in them.
    #[serde(skip)]
    pub departure: Option<Arc<Departure>>,
}

/// When each pixel was recorded, as a linear function of its index.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// τ: signed time from column to column and from row to row, s.
    #[serde(with = "exact")]
    pub per_pixel: Vector2<f64>,
}

impl Geometry {
    /// The geometry of pixels that are `pitch` (along the lines, across them; nm) apart, rotated.
    pub fn of_pitch(
        size: [usize; 2],
        pitch: [f64; 2],
        rotation_rad: f64,
        centre: Vector2<f64>,
    ) -> Option<Self> {
        let [columns, rows] = [size[0] as f64, size[1] as f64];
        let [fast, slow] = pitch;
        if size[0] < 2 || size[1] < 2 || !(fast > 0.0 && slow > 0.0) {
            return None;
        }
        let (s, c) = rotation_rad.sin_cos();
        let pixel_to_nm = Matrix2::new(c, -s, s, c) * Matrix2::new(fast, 0.0, 0.0, slow);
        let middle = Vector2::new((columns - 1.0) / 2.0, (rows - 1.0) / 2.0);
        Some(Self {
            size,
            pixel_to_nm,
            origin: centre - pixel_to_nm * middle,
            covariance: Matrix4::zeros(),
            from_sensors: false,
            departure: None,
        })
    }

    /// The geometry of a frame whose width is that of the outermost pixel centres, so that the
    /// pitch is `width/(N − 1)`; lines have the pitch that the nominal aspect ratio gives them,
    /// also where the frame is unfinished.
    pub fn nominal(
        size: [usize; 2],
        width_nm: f64,
        height_nm: f64,
        rotation_rad: f64,
        centre: Vector2<f64>,
    ) -> Option<Self> {
        let [columns, rows] = [size[0] as f64, size[1] as f64];
        let fast = width_nm / (columns - 1.0);
        let slow = fast * (height_nm / rows) / (width_nm / columns);
        Self::of_pitch(size, [fast, slow], rotation_rad, centre)
    }

    /// Step from column to column, nm.
    pub fn fast_step(&self) -> Vector2<f64> {
        self.pixel_to_nm.column(0).into_owned()
    }

    /// Step from row to row, nm.
    pub fn slow_step(&self) -> Vector2<f64> {
        self.pixel_to_nm.column(1).into_owned()
    }

    /// Position of the middle of the frame, nm.
    pub fn centre(&self) -> Vector2<f64> {
        let [columns, rows] = self.size;
        let middle = Vector2::new((columns as f64 - 1.0) / 2.0, (rows as f64 - 1.0) / 2.0);
        self.origin + self.pixel_to_nm * middle
    }

    /// How x and y may bend in the frame.
    pub fn bends(&self) -> Bends {
        let sides = Vector2::from(self.size.map(|n| n as f64 - 1.0));
        Bends {
            centre: self.centre(),
            range: self.pixel_to_nm.abs() * sides,
            from_sensors: self.from_sensors,
        }
    }

    /// Position of a pixel on the straight grid, nm.
    pub(crate) fn place(&self, at: Vector2<f64>) -> Vector2<f64> {
        self.origin + self.pixel_to_nm * at
    }

    /// Where the scanner was at a pixel, nm.
    pub fn at(&self, pixel: Vector2<f64>) -> Vector2<f64> {
        let off = self.departure.as_deref().map(|d| d.at(pixel));
        self.place(pixel) + off.unwrap_or_default()
    }

    /// The pixel at which it was at a place (nm), and `None` where the map is singular. A departure is much smaller than the frame: each step of
    /// the iteration leaves its slope, some per cent, of what was left.
    pub fn pixel_of(&self) -> Option<impl Fn(Vector2<f64>) -> Vector2<f64> + Sync + '_> {
        let inverse = self.pixel_to_nm.try_inverse()?;
        Some(move |place: Vector2<f64>| {
            let straight = inverse * (place - self.origin);
            let Some(departure) = self.departure.as_deref() else {
                return straight;
            };
            (0..8).fold(straight, |at, _| straight - inverse * departure.at(at))
        })
    }

    /// Lengths of the fast and slow sides from first to last pixel centre, nm.
    pub fn extent(&self) -> [f64; 2] {
        [
            (self.size[0].max(1) - 1) as f64 * self.fast_step().norm(),
            (self.size[1].max(1) - 1) as f64 * self.slow_step().norm(),
        ]
    }

    /// The laboratory axis along which lines follow each other.
    pub fn slow_axis(&self) -> Axis {
        let slow = self.slow_step();
        if slow.x.abs() > slow.y.abs() {
            Axis::X
        } else {
            Axis::Y
        }
    }

    /// The same map for a block of pixels that starts at (column, row).
    #[must_use]
    pub fn cropped(&self, first: [usize; 2], size: [usize; 2]) -> Self {
        let shift = Vector2::new(first[0] as f64, first[1] as f64);
        Self {
            size,
            origin: self.origin + self.pixel_to_nm * shift,
            departure: self.departed(|departure| departure.cropped(first)),
            ..self.clone()
        }
    }

    /// The same map for bins of `bin × bin` pixels; those that fill no bin are left out.
    #[must_use]
    pub fn in_bins(&self, bin: usize) -> Self {
        let pixels = bin as f64;
        let middle = Vector2::repeat((pixels - 1.0) / 2.0);
        Self {
            size: self.size.map(|n| n / bin),
            pixel_to_nm: self.pixel_to_nm * pixels,
            origin: self.origin + self.pixel_to_nm * middle,
            covariance: self.covariance * (pixels * pixels),
            from_sensors: self.from_sensors,
            departure: self.departed(|departure| departure.in_bins(bin)),
        }
    }

    fn departed(&self, change: impl Fn(&Departure) -> Departure) -> Option<Arc<Departure>> {
        let departure = self.departure.as_deref()?;
        Some(Arc::new(change(departure)))
    }

    /// How far from its own place each pixel is on a straight grid, pixels; `None` of a straight scanner.
    pub(crate) fn displacement(&self) -> Option<Departure> {
        let departure = self.departure.as_deref()?;
        Some(departure.mapped(&self.pixel_to_nm.try_inverse()?))
    }

    /// The same pixels in coordinates that are `map` times these (known exactly).
    #[must_use]
    pub fn mapped(&self, map: &Matrix2<f64>) -> Self {
        let both = both(map);
        Self {
            pixel_to_nm: map * self.pixel_to_nm,
            origin: map * self.origin,
            covariance: both * self.covariance * both.transpose(),
            departure: self.departed(|departure| departure.mapped(map)),
            ..self.clone()
        }
    }

    /// Tip speeds along the fast and slow axes, nm/s, from the step sizes and pixel times.
    pub fn speeds(&self, timing: &Timing) -> [f64; 2] {
        [
            self.fast_step().norm() / timing.per_pixel.x.abs(),
            self.slow_step().norm() / timing.per_pixel.y.abs(),
        ]
    }

    /// Gradient of acquisition time in the image plane, `u = J^{−T} τ`, s/nm.
    ///
    /// `None` where J is singular.
    pub fn time_gradient(&self, timing: &Timing) -> Option<Vector2<f64>> {
        Some(self.pixel_to_nm.try_inverse()?.transpose() * timing.per_pixel)
    }
}

impl Timing {
    /// τ of a scan, from the times of its lines where the file gives them, otherwise by [`Timing::new`].
    ///
    /// A line that takes `T` from the first to the last pixel has `τ_fast = T/(N − 1)`. Trace and
    /// retrace may differ; lines follow each other at the line rate, which is `1/(T_trace +
    /// T_retrace)` unless the file says otherwise. `None` where the file does not tell.
    pub fn of_scan(
        scan: &Scan,
        columns: usize,
        frame: FrameDirection,
        line: LineDirection,
    ) -> Option<Self> {
        let Some([trace, retrace]) = scan.line_times_s else {
            return Self::new(
                columns,
                scan.line_rate_hz?,
                scan.rounding.unwrap_or(0.0),
                frame,
                line,
            );
        };
        let time = match line {
            LineDirection::Trace => trace,
            LineDirection::Retrace => retrace,
        };
        let rate = scan.line_rate_hz.unwrap_or(1.0 / (trace + retrace));
        let mut timing = Self::new(columns, rate, 0.0, frame, line)?;
        if !(time > 0.0) || time * rate > 1.0 + 1e-6 {
            return None;
        }
        timing.per_pixel.x = (time / (columns - 1) as f64).copysign(timing.per_pixel.x);
        Some(timing)
    }

    /// τ of a frame of `columns` samples per line.
    ///
    /// A line is acquired in half its period, shortened by the overscan `rounding`; lines follow
    /// each other at `line_rate_hz`.
    pub fn new(
        columns: usize,
        line_rate_hz: f64,
        rounding: f64,
        frame: FrameDirection,
        line: LineDirection,
    ) -> Option<Self> {
        if columns < 2 || !(line_rate_hz > 0.0) || !(rounding >= 0.0) {
            return None;
        }
        let fast = 1.0 / (2.0 * line_rate_hz * (1.0 + rounding) * (columns - 1) as f64);
        let along = match line {
            LineDirection::Trace => fast,
            LineDirection::Retrace => -fast,
        };
        let across = match frame {
            FrameDirection::Up => 1.0 / line_rate_hz,
            FrameDirection::Down => -1.0 / line_rate_hz,
        };
        Some(Self {
            per_pixel: Vector2::new(along, across),
        })
    }
}

/// The geometry that a frame would have had on a sample at rest, `R = r − D t`.
///
/// `drift` D (nm/s) is the velocity of the sample; the time t counts from the middle of the frame,
/// where nothing moves. Exact for constant drift: see the module `drift`.
#[must_use]
pub(crate) fn at_rest(geometry: &Geometry, timing: &Timing, drift: Vector2<f64>) -> Geometry {
    let centre = geometry.centre();
    let pixel_to_nm = geometry.pixel_to_nm - drift * timing.per_pixel.transpose();
    let [columns, rows] = geometry.size;
    let middle = Vector2::new((columns as f64 - 1.0) / 2.0, (rows as f64 - 1.0) / 2.0);
    Geometry {
        pixel_to_nm,
        origin: centre - pixel_to_nm * middle,
        ..geometry.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::departure::{Across, Term};

    /// The velocities `V_fast = 2 f (1+ρ) L_f`, `V_slow = L_s f / N`, and the time gradient of a
    /// rectangle, `(s_f/V_fast, s_s/V_slow)`, for both slow axes, written out independently.
    #[test]
    fn speeds_and_time_gradients_of_a_rectangle() {
        let (n, f, rounding) = (512, 8.0, 0.1);
        for rotation in [0.0, std::f64::consts::FRAC_PI_2] {
            let g = Geometry::nominal([n, n], 55.0, 55.0, rotation, Vector2::zeros()).unwrap();
            let timing =
                Timing::new(n, f, rounding, FrameDirection::Down, LineDirection::Retrace).unwrap();
            let [fast, slow] = g.speeds(&timing);
            let pitch = 55.0 / 511.0;
            assert!((fast - 2.0 * f * 1.1 * 55.0).abs() < 1e-9);
            assert!((slow - f * pitch).abs() < 1e-12);
            let u = g.time_gradient(&timing).unwrap();
            let expected = Matrix2::new(
                rotation.cos(),
                -rotation.sin(),
                rotation.sin(),
                rotation.cos(),
            ) * Vector2::new(-1.0 / fast, -1.0 / slow);
            assert!((u - expected).norm() < 1e-12);
            assert_eq!(
                g.slow_axis(),
                if rotation == 0.0 { Axis::Y } else { Axis::X }
            );
        }
    }

    /// Sensors that bend by a thousandth of their range: straight lines through what they show of a part of the frame are too long by
    /// the stretch in its middle, and right over the whole frame.
    #[test]
    fn bends_stretch_parts_of_a_frame() {
        let g = Geometry::of_pitch([201, 151], [0.4, 0.5], 0.3, Vector2::new(7.0, 2.0)).unwrap();
        let place = |n| g.place(n);
        let corners = [[0.0, 0.0], [200.0, 0.0], [0.0, 150.0], [200.0, 150.0]];
        let corners = corners.map(|[c, r]| place(Vector2::new(c, r)));
        for axis in [0, 1] {
            let along = corners.map(|c| c[axis]);
            let (low, high) = along
                .iter()
                .fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
            let range = high - low;
            let bent = |x: f64| x + 0.001 * range * (2.0 * (x - g.centre()[axis]) / range).powi(2);
            let middle = Vector2::new(160.0, 40.0);
            let sides = [-9.0, 9.0].map(|d| place(middle + Vector2::new(d, 0.0))[axis]);
            let slope = (bent(sides[1]) - bent(sides[0])) / (sides[1] - sides[0]) - 1.0;
            assert!((slope / (0.001 * g.bends().stretch(place(middle))[axis]) - 1.0).abs() < 1e-9);
        }
        assert!(g.bends().stretch(g.centre()).norm() < 1e-12);
    }

    /// A pixel of a bowed frame is found from where the scanner was there, to a hundred thousandth.
    #[test]
    fn pixels_of_places_on_a_curved_grid() {
        let mut g =
            Geometry::of_pitch([201, 151], [0.4, 0.5], 0.3, Vector2::new(7.0, 2.0)).unwrap();
        let term = |along, across, x, y| Term {
            along,
            across: Across::Power(across),
            size: Vector2::new(x, y),
        };
        let terms = vec![
            term(2, 0, 0.8, 0.1),
            term(0, 2, -0.3, 0.6),
            term(1, 3, 0.2, -0.2),
        ];
        g.departure = Some(Arc::new(Departure::new(terms, [0, 200], [0, 150])));
        let pixel = g.pixel_of().unwrap();
        for at in [
            Vector2::new(12.0, 140.0),
            Vector2::new(100.5, 75.0),
            Vector2::new(200.0, 0.0),
        ] {
            assert!((g.at(at) - g.place(at)).norm() > 0.1);
            assert!((pixel(g.at(at)) - at).norm() < 1e-5);
        }
    }

    /// 25 s there and 0.2 s back, as a slow instrument does it: each line has its own time.
    #[test]
    fn lines_of_different_times() {
        let scan = Scan {
            line_times_s: Some([25.0, 0.2]),
            line_rate_hz: Some(1.0 / 25.2),
            ..Scan::default()
        };
        let of = |line| Timing::of_scan(&scan, 96, FrameDirection::Up, line).unwrap();
        let (trace, retrace) = (of(LineDirection::Trace), of(LineDirection::Retrace));
        assert!((trace.per_pixel - Vector2::new(25.0 / 95.0, 25.2)).norm() < 1e-12);
        assert!((retrace.per_pixel - Vector2::new(-0.2 / 95.0, 25.2)).norm() < 1e-12);
        // Two equal halves are the same as an overscan of nothing.
        let halves = Scan {
            line_times_s: Some([0.25, 0.25]),
            ..Scan::default()
        };
        let down = FrameDirection::Down;
        assert_eq!(
            Timing::of_scan(&halves, 512, down, LineDirection::Retrace),
            Timing::new(512, 2.0, 0.0, down, LineDirection::Retrace)
        );
        // A line longer than its period, or no time at all, is no timing.
        for times in [[3.0, 0.1], [0.0, 1.0], [f64::NAN, 1.0]] {
            let odd = Scan {
                line_times_s: Some(times),
                line_rate_hz: Some(1.0),
                ..Scan::default()
            };
            assert_eq!(
                Timing::of_scan(&odd, 96, FrameDirection::Up, LineDirection::Trace),
                None
            );
        }
        assert_eq!(
            Timing::of_scan(
                &Scan::default(),
                96,
                FrameDirection::Up,
                LineDirection::Trace
            ),
            None
        );
    }

    /// An unfinished frame keeps its pitch, and the frame is centred where it should be.
    #[test]
    fn nominal_pitch_of_an_unfinished_frame() {
        let centre = Vector2::new(3.0, -4.0);
        let g = Geometry::nominal([512, 128], 70.0, 17.5, 0.0, centre).unwrap();
        assert!((g.fast_step().norm() - 70.0 / 511.0).abs() < 1e-12);
        assert!((g.slow_step().norm() - 70.0 / 511.0).abs() < 1e-12);
        assert!((g.centre() - centre).norm() < 1e-12);
    }
}

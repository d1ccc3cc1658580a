//! The region that all scans of a series have in common.

use nalgebra::{Matrix2, Vector2};
use spmfile::Scan;

use crate::frame::geometry::Geometry;
use crate::scan::channel::channels;
use crate::scan::place::Place;
use crate::settings::knobs::Settings;

/// A rectangle along the fast and slow directions of the first scan, nm.
#[derive(Clone, Copy, Debug)]
pub struct Window {
    /// Laboratory → (fast, slow) coordinates.
    axes: Matrix2<f64>,
    low: Vector2<f64>,
    high: Vector2<f64>,
}

impl Window {
    /// The window of one scan; `None` where it has no geometry.
    pub fn of(scan: &Scan, settings: &Settings) -> Option<Self> {
        let channel = *channels(scan, settings).ok()?.first()?;
        let place = Place::of("", scan, channel, settings, &mut Vec::new())?;
        Self::around(&place.recorded)
    }

    fn around(geometry: &Geometry) -> Option<Self> {
        let fast = geometry.fast_step().try_normalize(0.0)?;
        let slow = geometry.slow_step().try_normalize(0.0)?;
        let axes = Matrix2::from_columns(&[fast, slow]).try_inverse()?;
        let (a, b) = (
            axes * geometry.origin,
            axes * (2.0 * geometry.centre() - geometry.origin),
        );
        Some(Self {
            axes,
            low: a.inf(&b),
            high: a.sup(&b),
        })
    }

    /// First pixel (column, row) and size of the block whose pixels all lie in the window.
    pub(crate) fn pixels(&self, geometry: &Geometry) -> Option<([usize; 2], [usize; 2])> {
        let corners = [
            Vector2::new(self.low.x, self.low.y),
            Vector2::new(self.high.x, self.low.y),
            Vector2::new(self.low.x, self.high.y),
            Vector2::new(self.high.x, self.high.y),
        ];
        let (back, inverse) = (
            self.axes.try_inverse()?,
            geometry.pixel_to_nm.try_inverse()?,
        );
        let in_pixels = corners.map(|c| inverse * (back * c - geometry.origin));
        let mut first = [0; 2];
        let mut size = [0; 2];
        for axis in 0..2 {
            // The block inside the (slightly sheared) image of the rectangle: inner corners count.
            let mut values = in_pixels.map(|p| p[axis]);
            values.sort_by(f64::total_cmp);
            let start = values[1].max(0.0).ceil();
            let end = values[2].min(geometry.size[axis] as f64 - 1.0).floor();
            if end - start < 1.0 {
                return None;
            }
            first[axis] = start as usize;
            size[axis] = (end - start) as usize + 1;
        }
        Some((first, size))
    }
}

/// The region common to all windows; `None` where there is none.
///
/// All windows are taken along the axes of the first one.
pub fn common_window(windows: &[Window]) -> Option<Window> {
    let mut common = *windows.first()?;
    for window in &windows[1..] {
        let turn = common.axes * window.axes.try_inverse()?;
        let (a, b) = (turn * window.low, turn * window.high);
        common.low = common.low.sup(&a.inf(&b));
        common.high = common.high.inf(&a.sup(&b));
    }
    (common.high.x > common.low.x && common.high.y > common.low.y).then_some(common)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(centre: Vector2<f64>, rotation: f64) -> Geometry {
        Geometry::nominal([101, 101], 100.0, 100.0, rotation, centre).unwrap()
    }

    /// Two frames shifted by (10, −20) nm share 90 × 80 nm, also where one is turned by 90°.
    #[test]
    fn shifted_frames_share_a_rectangle() {
        for rotation in [0.0, std::f64::consts::FRAC_PI_2] {
            let a = frame(Vector2::zeros(), 0.0);
            let b = frame(Vector2::new(10.0, -20.0), rotation);
            let windows = [Window::around(&a).unwrap(), Window::around(&b).unwrap()];
            let common = common_window(&windows).unwrap();
            let (first, size) = common.pixels(&a).unwrap();
            assert_eq!((first, size), ([10, 0], [91, 81]));
            let (_, size) = common.pixels(&b).unwrap();
            let mut size = size;
            size.sort_unstable();
            // Rounding to whole pixels may cost one at either end.
            assert!(
                size[0].abs_diff(81) <= 1 && size[1].abs_diff(91) <= 1,
                "{size:?}"
            );
        }
        let far = [
            Window::around(&frame(Vector2::zeros(), 0.0)).unwrap(),
            Window::around(&frame(Vector2::new(200.0, 0.0), 0.0)).unwrap(),
        ];
        assert!(common_window(&far).is_none());
    }
}

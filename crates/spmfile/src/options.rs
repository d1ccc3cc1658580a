//! What a reader is told beside the bytes.

use crate::scan::{FrameDirection, LineDirection};

/// What only the user knows of an array.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ArrayOptions {
    /// Width and height of the image, edge to edge, nm.
    pub size_nm: Option<[f64; 2]>,
    /// Whether the bottom or the top line was acquired first.
    pub frame_direction: Option<FrameDirection>,
    /// Whether the lines are those of the way forth or back; names such as `phase_retrace` tell
    /// it themselves.
    pub line_direction: Option<LineDirection>,
    /// Lines per second, a line being trace and retrace together.
    pub line_rate_hz: Option<f64>,
    /// See [`crate::Scan::line_times_s`].
    pub line_times_s: Option<[f64; 2]>,
    /// Rotation of the fast axis against x, counter-clockwise, rad.
    pub rotation_rad: Option<f64>,
    /// The unit of the values.
    pub unit: Option<String>,
    /// The unit of arrays named as position sensors (`x_sensor`).
    pub sensor_unit: Option<String>,
}

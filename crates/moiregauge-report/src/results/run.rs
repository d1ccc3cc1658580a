//! What was asked: enough to ask it again.

use moiregauge::settings::Settings;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::choice::Choice;
use crate::input::{FailedInput, InputFile};

/// A run of the program: what a repetition needs beside the files themselves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Run {
    /// `analyze` or `map`.
    pub command: String,
    /// The arguments as they were typed, the command first; what cannot change results is left out: where they go, how
    /// many threads, what is printed.
    pub arguments: Vec<String>,
    /// The settings that were asked for: before a channel was chosen or an orientation measured.
    pub settings: Settings,
    /// What the user said about the files.
    #[serde(default)]
    pub known: UserSpecified,
    /// Sets made by hand.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sets: Vec<NamedSet>,
    /// Images in which the orientation of a layer was to be measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub atomic: Option<AtomicImages>,
    /// An image of a larger area to mark the scans in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub survey_image: Option<String>,
    /// Which parts of the report were wanted.
    pub report: Choice,
    /// Names of corrected images that were wanted.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub export: Vec<String>,
    /// Whether the tables were wanted as Parquet, too.
    #[serde(default)]
    pub parquet: bool,
    /// The files to measure as they were named, in order, those that could not be used among them.
    pub inputs: Vec<String>,
    /// Files that were read and are not in `provenance.inputs`: those that could not be used, position sensors, logs of
    /// sessions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub other_files: Vec<InputFile>,
    /// Names that were given and not measured: no file, or one that could not be read.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<FailedInput>,
}

/// What files do not tell and the user does.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct UserSpecified {
    /// Width and height of the image from edge to edge, nm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size_nm: Option<[f64; 2]>,
    /// Unit of the values of arrays and pictures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Lines per second, trace and retrace together.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line_rate_hz: Option<f64>,
    /// Sense of the slow motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame_direction: Option<FrameOrder>,
    /// Angle by which the fast axis is turned against x, degrees, counter-clockwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotation_deg: Option<f64>,
    /// Channel that is the position sensor along x.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub x_sensor: Option<String>,
    /// Channel that is the position sensor along y.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub y_sensor: Option<String>,
    /// Unit of the position sensors of arrays.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor_unit: Option<String>,
    /// File that holds the position sensors.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensors: Option<String>,
    /// The block of the image to use.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub crop: Option<Crop>,
}

/// Sense of the slow motion of one file or of a series.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FrameOrder {
    /// The bottom line was first.
    Up,
    /// The top line was first.
    Down,
    /// Up and down in turn, the first file by name up.
    AlternatingUp,
    /// Down and up in turn, the first file by name down.
    AlternatingDown,
}

/// A block of pixels as the screen shows it: row 0 is on top.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Crop {
    /// First column, from the left.
    pub column: usize,
    /// First row, from the top.
    pub top: usize,
    /// Number of columns.
    pub columns: usize,
    /// Number of rows.
    pub rows: usize,
}

/// A set made by hand: all files under a path.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct NamedSet {
    /// Its name.
    pub name: String,
    /// A folder or a file.
    pub path: String,
}

/// Images in which the orientation of a layer is measured.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct AtomicImages {
    /// The files.
    pub files: Vec<String>,
    /// Their channel, where it is another one than that of the scans.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub channel: Option<String>,
    /// The layer that they show.
    pub layer: u8,
}

//! Scanning-probe microscope files: bytes → [`Scan`].
//!
//! What the instrument wrote, and nothing else: no interpretation, no numerics.
//! Images are stored bottom line first (y up), column 0 at the left, whatever the file does.

mod scan;

pub use scan::{
    Channel, DateTime, FrameDirection, LineDirection, Samples, Scan, UnreadableChannel,
};

//! One scan → a few numbers: channels, where its pixels were and when, the lattices of its lines.

pub(crate) mod channel;
pub(crate) mod doubts;
pub(crate) mod fingerprint;
pub(crate) mod fitted;
pub(crate) mod grains;
pub(crate) mod images;
pub(crate) mod measure;
pub(crate) mod measured;
pub(crate) mod moires;
pub(crate) mod overlap;
pub(crate) mod picture;
pub(crate) mod place;
pub(crate) mod positions;
pub(crate) mod scanner;
pub(crate) mod shared;
pub(crate) mod told;
pub(crate) mod written;

pub use channel::{channels_by_preference, choose_channel, plain_name};
pub use fitted::{Fitted, fitted};
pub use images::{image_choice, unusual_channels};
pub use measure::{BYTES_PER_PIXEL, measure_known, measure_moires, measure_scan};
pub use measured::{MeasureError, MeasuredLine, MeasuredLines, MeasuredScan};
pub use moires::sorted_moires;
pub use overlap::{Window, common_window};
pub use picture::{BentSensors, Companion, Illustration, Picture};

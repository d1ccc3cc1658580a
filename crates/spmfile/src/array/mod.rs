//! Plain arrays and pictures; their public face is [`crate::arrays`].

#[cfg(feature = "archives")]
mod archived;
mod axis;
#[cfg(feature = "pictures")]
mod calibration;
#[cfg(all(feature = "hdf5", not(target_family = "wasm")))]
pub(crate) mod nexus;
mod npy;
#[cfg(feature = "pictures")]
mod picture;
mod plane;
mod read;
mod table;
mod text;
#[cfg(feature = "write")]
mod write;

#[cfg(feature = "archives")]
pub(crate) use archived::open as open_npz;
#[cfg(feature = "pictures")]
pub(crate) use read::{open_jpeg, open_png, open_tiff};
pub(crate) use read::{open_npy, open_text};
pub(crate) use table::begins as begins_table;
#[cfg(feature = "write")]
pub use write::csv;
#[cfg(feature = "write")]
pub(crate) use write::csv_between;
#[cfg(all(feature = "write", feature = "archives"))]
pub use write::npz;
#[cfg(all(feature = "write", feature = "archives"))]
pub(crate) use write::npz_between;
#[cfg(all(feature = "write", feature = "pictures"))]
pub use write::tiff;
#[cfg(all(feature = "write", feature = "pictures"))]
pub(crate) use write::tiff_between;

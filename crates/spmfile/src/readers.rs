//! The table of readers: how a format is told, what it is called, who reads it.
//!
//! A new format is a file with `open`, its line in `lib.rs`, its variant of [`Format`], a row here and a
//! row in `FORMATS.md`.

use crate::error::ReadError;
use crate::format::Format;
use crate::outline::{Input, Outline};
use crate::signature::{first_entry, is_matrix};
use crate::{
    agilent, array, createc, gsf, gwy, gxsm, gxyzf, igor, iso28632, jpk, matrix, nanonis,
    nanonis_grid, nanoscope, nid, park, rhk, wsxm,
};

/// One format.
pub(crate) struct Reader {
    pub(crate) format: Format,
    /// What it is called.
    pub(crate) name: &'static str,
    /// What names of its files end with, for people.
    pub(crate) names: &'static [&'static str],
    /// Those of them that nothing else has, by which a file should be a scan.
    pub(crate) own_names: &'static [&'static str],
    pub(crate) signature: Signature,
    pub(crate) kind: Kind,
    /// Whether all that [`Reader::open`] needs is at the start, and lines follow: such files are read
    /// by rows without having their bytes in memory.
    pub(crate) flat: bool,
    pub(crate) open: Open,
}

/// Finds frame, channels and samples of a file.
pub(crate) type Open = for<'a> fn(&Input<'a>) -> Result<Outline<'a>, ReadError>;

/// How a format is told.
pub(crate) enum Signature {
    /// By one of these at the start.
    Magic(&'static [&'static [u8]]),
    /// In some other way.
    By(fn(&[u8]) -> bool),
}

/// What files of a format are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Meant to be scans, readable or not.
    Scan,
    /// Arrays and pictures, which tell nothing of a frame.
    Array,
    /// What goes with scans.
    Companion,
}

impl Signature {
    pub(crate) fn fits(&self, bytes: &[u8]) -> bool {
        match self {
            Self::Magic(magics) => magics.iter().any(|magic| bytes.starts_with(magic)),
            Self::By(told) => told(bytes),
        }
    }
}

impl Reader {
    /// The reader of a format.
    pub(crate) fn of(format: Format) -> Option<&'static Self> {
        READERS.iter().find(|reader| reader.format == format)
    }
}

use Format as F;
use Kind::{Array, Companion, Scan};
use Signature::{By, Magic};

/// A row of the table.
macro_rules! reader {
    ($format:expr, $name:literal, $names:expr, own $own:expr, $signature:expr, $kind:expr, flat $flat:literal, $open:expr) => {
        Reader {
            format: $format,
            name: $name,
            names: &$names,
            own_names: &$own,
            signature: $signature,
            kind: $kind,
            flat: $flat,
            open: $open,
        }
    };
}

/// Every format, those with the surer signs first.
pub(crate) static READERS: &[Reader] = &[
    reader!(F::NanoScopeForce, "NanoScope force curve", ["spm", "pfc"], own [], By(nanoscope::detect_force), Scan, flat false, nanoscope::refuse_force),
    reader!(F::NanoScope, "NanoScope", ["spm", "000"], own ["spm"], By(nanoscope::detect), Scan, flat true, nanoscope::open),
    reader!(F::Nanonis, "Nanonis", ["sxm"], own ["sxm"], Magic(&[b":NANONIS_VERSION:"]), Scan, flat true, nanonis::open),
    reader!(F::NanonisGrid, "Nanonis grid", ["3ds"], own ["3ds"], Magic(&[nanonis_grid::BEGIN]), Scan, flat false, nanonis_grid::open),
    reader!(F::Gwy, "Gwyddion", ["gwy"], own ["gwy"], Magic(&[b"GWYP", b"GWYO"]), Scan, flat false, gwy::open),
    reader!(F::Gsf, "Gwyddion simple field", ["gsf"], own ["gsf"], Magic(&[b"Gwyddion Simple Field"]), Scan, flat true, gsf::open),
    reader!(F::Gxyzf, "Gwyddion XYZ field", ["gxyzf"], own ["gxyzf"], Magic(&[b"Gwyddion XYZ Field"]), Scan, flat false, gxyzf::open),
    reader!(F::Nid, "Nanosurf", ["nid", "ezd"], own ["nid"], Magic(&[b"[DataSet]"]), Scan, flat true, nid::open),
    reader!(F::Wsxm, "WSxM", ["stp", "top"], own ["stp", "top"], Magic(&[b"WSxM file"]), Scan, flat true, wsxm::open),
    reader!(F::Createc, "Createc", ["dat"], own [], By(createc::detect), Scan, flat false, createc::open),
    reader!(F::Gxsm, "GXSM", ["nc"], own [], By(gxsm::detect), Scan, flat false, gxsm::open),
    reader!(F::AgilentMi, "Agilent", ["mi"], own ["mi"], Magic(&[b"fileType "]), Scan, flat true, agilent::open),
    reader!(F::OmicronMatrixLog, "Omicron Matrix log", ["mtrx"], own [], Magic(&[b"ONTMATRX0101ATEM"]), Companion, flat false, matrix::open_alone),
    reader!(F::OmicronMatrix, "Omicron Matrix", ["Z_mtrx", "I_mtrx"], own [], Magic(&[b"ONTMATRX"]), Scan, flat false, matrix::open_alone),
    reader!(F::Iso28632, "ISO 28632", ["spm"], own ["spm"], Magic(&[b"ISO/TC 201 SPM data transfer format"]), Scan, flat false, iso28632::open),
    reader!(F::Npy, "NumPy array", ["npy"], own [], Magic(&[b"\x93NUMPY"]), Array, flat true, array::open_npy),
    reader!(F::Jpeg, "JPEG", ["jpg", "jpeg"], own [], Magic(&[b"\xff\xd8\xff"]), Array, flat false, open_jpeg),
    reader!(F::Png, "PNG", ["png"], own [], Magic(&[b"\x89PNG\r\n\x1a\n"]), Array, flat false, open_png),
    reader!(F::Npz, "NumPy archive", ["npz"], own [], By(|bytes| first_entry(bytes).ends_with(b".npy")), Array, flat false, open_npz),
    reader!(F::JpkZip, "JPK archive", ["jpk-qi-data", "jpk-force-map", "jpk-force"], own [], By(jpk::detect_zip), Scan, flat false, open_jpk_zip),
    #[cfg(all(feature = "hdf5", not(target_family = "wasm")))]
    reader!(F::JpkHdf5, "JPK in HDF5", ["h5-jpk"], own ["h5-jpk"], By(jpk::detect_hdf5), Scan, flat false, jpk::hdf5::open),
    #[cfg(all(feature = "hdf5", not(target_family = "wasm")))]
    reader!(F::Hdf5, "HDF5", ["nxs", "h5", "hdf5"], own [], By(crate::detect::is_plain_hdf5), Array, flat false, array::nexus::open),
    reader!(F::Rhk, "RHK", ["sm4"], own ["sm2", "sm3", "sm4"], By(rhk::detect), Scan, flat false, rhk::open),
    reader!(F::ParkTiff, "Park", ["tiff"], own [], By(park::detect), Scan, flat false, park::open),
    reader!(F::Jpk, "JPK", ["jpk", "jpk-qi-image"], own ["jpk", "jpk-qi-image"], By(jpk::detect), Scan, flat false, jpk::open),
    // BigTIFF, too; no instrument is known to use it.
    reader!(F::Tiff, "TIFF", ["tif", "tiff"], own [], Magic(&[b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"]), Array, flat false, open_tiff),
    reader!(F::Igor, "Igor binary wave", ["ibw"], own ["ibw"], By(igor::detect), Scan, flat false, igor::open),
    reader!(F::TextMatrix, "text matrix", ["txt", "csv"], own [], By(is_matrix), Array, flat false, array::open_text),
];

#[cfg(feature = "pictures")]
use {array::open_jpeg, array::open_png, array::open_tiff};
#[cfg(feature = "archives")]
use {array::open_npz, jpk::open_zip as open_jpk_zip};

/// A reader that this build leaves out.
macro_rules! left_out {
    ($open:ident, $feature:literal, $format:literal) => {
        #[cfg(not(feature = $feature))]
        fn $open<'a>(_: &Input<'a>) -> Result<Outline<'a>, ReadError> {
            Err(ReadError::NotBuilt {
                format: $format,
                feature: $feature,
            })
        }
    };
}

left_out!(open_npz, "archives", "NumPy archive");
left_out!(open_jpk_zip, "archives", "JPK archive");
left_out!(open_png, "pictures", "PNG");
left_out!(open_jpeg, "pictures", "JPEG");
left_out!(open_tiff, "pictures", "TIFF");

//! The kinds of files that are told apart.

/// What the first bytes of a file say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Format {
    /// NanoScope images.
    NanoScope,
    /// NanoScope force curves or a force volume.
    NanoScopeForce,
    /// Nanonis scan (`.sxm`).
    Nanonis,
    /// Nanonis grid of spectra (`.3ds`).
    NanonisGrid,
    /// Gwyddion container (`.gwy`).
    Gwy,
    /// Gwyddion simple field (`.gsf`).
    Gsf,
    /// Gwyddion XYZ field (`.gxyzf`).
    Gxyzf,
    /// GXSM scan (`.nc`), a `NetCDF` file.
    Gxsm,
    /// Igor binary wave (`.ibw`), as of Asylum instruments.
    Igor,
    /// JPK image (`.jpk`, `.jpk-qi-image`), a TIFF container.
    Jpk,
    /// JPK archive (`.jpk-force`, `.jpk-force-map`, `.jpk-qi-data`), a ZIP container.
    JpkZip,
    /// JPK images in HDF5 (`.h5-jpk`).
    JpkHdf5,
    /// Images of `NeXus`, or a single array, in HDF5 (`.nxs`, `.h5`).
    Hdf5,
    /// Nanosurf (`.nid`).
    Nid,
    /// Park Systems (`.tiff`), a TIFF container.
    ParkTiff,
    /// `WSxM` (`.stp`, `.top` …).
    Wsxm,
    /// Createc scan (`.dat`).
    Createc,
    /// RHK (`.sm4` and its elders).
    Rhk,
    /// Agilent, Molecular Imaging (`.mi`).
    AgilentMi,
    /// Omicron Matrix, the file of a channel (`.Z_mtrx`).
    OmicronMatrix,
    /// Omicron Matrix, the log of a session (`_0001.mtrx`).
    OmicronMatrixLog,
    /// ISO 28632 text (`ISO/TC 201 SPM data transfer format`), often named `.spm`.
    Iso28632,
    /// `NumPy` array.
    Npy,
    /// Archive of `NumPy` arrays.
    Npz,
    /// TIFF that no instrument is known for.
    Tiff,
    /// PNG picture.
    Png,
    /// JPEG picture.
    Jpeg,
    /// A matrix of numbers as text.
    TextMatrix,
    /// Some other kind of file, in words.
    Other(&'static str),
    /// Readable text of unknown meaning.
    Text,
    /// No bytes at all.
    Empty,
    /// Nothing known.
    Unknown,
}

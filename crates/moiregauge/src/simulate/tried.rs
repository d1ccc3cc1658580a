//! What a program ought to be tried on.

/// Samples that a program ought to be tried on: one of each class, and images without any lattice. Classes joined by `+`
/// come together.
pub const TRIED: [&str; 27] = [
    "clean",
    "edge",
    "fade",
    "hole",
    "hole:count=8",
    "bump",
    "island",
    "grains",
    "twist-wave",
    "strain-wave",
    "twist-gradient",
    "strain-gradient",
    "walls",
    "second-shell",
    "atoms",
    "step",
    "terrain",
    "stripes",
    "hum",
    "scars",
    "glitches",
    "lag",
    "bare",
    "bare+terrain",
    "bare+ripples",
    "bare+stripes",
    "bare+hum+scars",
];

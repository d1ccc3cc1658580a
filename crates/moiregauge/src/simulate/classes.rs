//! What real samples and instruments have besides a perfect lattice: one table of classes and their numbers.
//!
//! The table makes the help of the program, the ranges that are accepted, and those from which a random sample is drawn.
//! Lengths are in nm, angles in degrees counter-clockwise, heights and amplitudes in degrees of phase (a moiré has
//! [`Sample::contrast_deg`](crate::simulate::Sample::contrast_deg), 1 if nothing else is said). Shares are of the frame.

/// A class of samples: a name, what it is, and its numbers.
#[derive(Clone, Copy, Debug)]
pub struct SampleClass {
    /// As in `--sample hole`.
    pub name: &'static str,
    /// In words.
    pub what: &'static str,
    /// Its numbers.
    pub keys: &'static [Key],
}

/// A number of a class.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    /// As in `hole:share=0.2`.
    pub name: &'static str,
    /// In words, with its unit.
    pub what: &'static str,
    /// Where nothing is said.
    pub usual: f64,
    /// Random samples have values between these.
    pub drawn: [f64; 2],
    /// What is accepted.
    pub allowed: [f64; 2],
}

const fn key(
    name: &'static str,
    what: &'static str,
    usual: f64,
    drawn: [f64; 2],
    allowed: [f64; 2],
) -> Key {
    Key {
        name,
        what,
        usual,
        drawn,
        allowed,
    }
}

const fn class(name: &'static str, what: &'static str, keys: &'static [Key]) -> SampleClass {
    SampleClass { name, what, keys }
}

const TURN: [f64; 2] = [-360.0, 360.0];
const HEIGHT: [f64; 2] = [-100.0, 100.0];
const X: Key = key(
    "x",
    "its middle, right of that of the frame, share of the width",
    0.0,
    [-0.15, 0.15],
    [-1.0, 1.0],
);
const Y: Key = key(
    "y",
    "its middle, above that of the frame, share of the height",
    0.0,
    [-0.15, 0.15],
    [-1.0, 1.0],
);
const WAVE_ANGLE: Key = key(
    "angle",
    "direction in which it changes, °",
    30.0,
    [0.0, 180.0],
    TURN,
);
const WAVE_PHASE: Key = key(
    "phase",
    "phase at the middle of the frame, °",
    0.0,
    [0.0, 360.0],
    TURN,
);
const WAVE_HEIGHT: Key = key("amplitude", "°", 1.0, [0.5, 2.0], [0.0, 1000.0]);
const WAVELENGTH: Key = key("wavelength", "nm", 125.0, [80.0, 250.0], [1.0, 1e6]);

const PERCENT: [f64; 2] = [-50.0, 50.0];
const RECORDED: Key = key(
    "recorded",
    "share of it that the position sensors record",
    1.0,
    [1.0, 1.0],
    [0.0, 1.0],
);

/// All classes.
pub const CLASSES: [SampleClass; 26] = [
    class("clean", "only the lattice", &[]),
    class(
        "edge",
        "part of the frame without moiré, beyond a straight edge",
        &[
            key("share", "share with moiré", 0.5, [0.4, 0.85], [0.02, 0.98]),
            key(
                "angle",
                "direction from the moiré to the empty part, °",
                20.0,
                [0.0, 360.0],
                TURN,
            ),
            key("height", "of the empty part, °", 0.0, [-3.0, 3.0], HEIGHT),
        ],
    ),
    class(
        "fade",
        "the contrast of the moiré falls across a straight line: ten to ninety in a hundred within 4.4 widths",
        &[
            key(
                "share",
                "share with more than half of the contrast",
                0.5,
                [0.4, 0.85],
                [0.02, 0.98],
            ),
            key(
                "angle",
                "direction in which it falls, °",
                20.0,
                [0.0, 360.0],
                TURN,
            ),
            key(
                "width",
                "of the logistic function, share of the frame's side",
                0.05,
                [0.01, 0.1],
                [1e-6, 1.0],
            ),
        ],
    ),
    class(
        "hole",
        "round holes without moiré",
        &[
            key(
                "share",
                "share of all holes together",
                0.13,
                [0.05, 0.35],
                [0.001, 0.9],
            ),
            key(
                "count",
                "number of bumps; several lie at random places",
                1.0,
                [1.0, 1.0],
                [1.0, 1000.0],
            ),
            X,
            Y,
            key("height", "of their bottom, °", -2.0, [-4.0, 4.0], HEIGHT),
        ],
    ),
    class(
        "bump",
        "a smooth bump, as of a bubble: bright and round",
        &[
            key("height", "°", 5.0, [2.0, 10.0], HEIGHT),
            key(
                "size",
                "standard deviation, share of the frame's side",
                0.12,
                [0.06, 0.16],
                [0.001, 1.0],
            ),
            key(
                "keep",
                "share of the contrast of the moiré that is left on its top",
                1.0,
                [0.0, 1.0],
                [0.0, 1.0],
            ),
            X,
            Y,
        ],
    ),
    class(
        "island",
        "moiré inside a disc only",
        &[
            key("share", "share with moiré", 0.25, [0.25, 0.6], [0.01, 0.9]),
            X,
            Y,
            key("height", "of the surroundings, °", 0.0, [-3.0, 3.0], HEIGHT),
        ],
    ),
    class(
        "grains",
        "another lattice beyond a straight boundary; give it twice for three grains",
        &[
            key(
                "share",
                "share of the first lattice",
                0.5,
                [0.35, 0.65],
                [0.02, 0.98],
            ),
            key(
                "angle",
                "direction from the first to the second, °",
                20.0,
                [0.0, 360.0],
                TURN,
            ),
            key(
                "twist",
                "twist of the second minus that of the first, °",
                0.04,
                [-0.05, 0.05],
                [-60.0, 60.0],
            ),
            key(
                "turn",
                "rotation of the second as a whole, °",
                2.0,
                [1.0, 4.0],
                TURN,
            ),
            key(
                "strain",
                "strain of the second minus that of the first, %",
                0.0,
                [0.0, 0.1],
                [-20.0, 20.0],
            ),
            key(
                "shift",
                "step of the phases at the middle of the boundary, periods",
                0.3,
                [0.0, 1.0],
                [-1.0, 1.0],
            ),
        ],
    ),
    class(
        "twist-wave",
        "a transverse wave in layer 2: the twist swings, with a shear of its amplitude",
        &[
            key(
                "amplitude",
                "of the twist, °",
                0.02,
                [0.01, 0.04],
                [-5.0, 5.0],
            ),
            WAVELENGTH,
            WAVE_ANGLE,
            WAVE_PHASE,
        ],
    ),
    class(
        "strain-wave",
        "a longitudinal wave in layer 2: stretched and compressed along its direction",
        &[
            key(
                "amplitude",
                "of the strain, %",
                0.05,
                [0.02, 0.1],
                [-5.0, 5.0],
            ),
            WAVELENGTH,
            WAVE_ANGLE,
            WAVE_PHASE,
        ],
    ),
    class(
        "twist-gradient",
        "layer 2 bent in its plane: the twist changes along, the strain across",
        &[
            key(
                "change",
                "of the twist across the frame, °",
                0.03,
                [0.01, 0.06],
                [-5.0, 5.0],
            ),
            WAVE_ANGLE,
        ],
    ),
    class(
        "strain-gradient",
        "layer 2 stretched by a growing amount: the strain changes along, the twist across",
        &[
            key(
                "change",
                "of the strain across the frame, %",
                0.1,
                [0.03, 0.15],
                [-5.0, 5.0],
            ),
            WAVE_ANGLE,
        ],
    ),
    class(
        "walls",
        "relaxed: triangular domains, sharp walls and nodes instead of smooth waves",
        &[
            key(
                "width",
                "standard deviation of a wall, nm",
                1.0,
                [0.6, 1.6],
                [0.01, 100.0],
            ),
            key(
                "domains",
                "height of AB above BA, °",
                1.0,
                [0.0, 2.0],
                HEIGHT,
            ),
            key(
                "nodes",
                "height of the nodes above the walls, °",
                2.0,
                [0.0, 4.0],
                HEIGHT,
            ),
        ],
    ),
    class(
        "second-shell",
        "a weak first and a strong second shell of waves",
        &[
            key(
                "first",
                "amplitude of the first shell, share of the contrast",
                0.05,
                [0.02, 0.1],
                [0.0, 10.0],
            ),
            key(
                "second",
                "amplitude of the second shell, share of the contrast",
                1.0,
                [0.5, 1.0],
                [0.0, 10.0],
            ),
        ],
    ),
    class(
        "atoms",
        "atoms are visible too; needs pixels below 0.1 nm",
        &[
            key(
                "ratio",
                "amplitude over that of the moiré",
                1.0,
                [0.3, 3.0],
                [0.0, 1000.0],
            ),
            key(
                "layer",
                "the layer that shows: 1, 2, or 3 for both",
                2.0,
                [2.0, 2.0],
                [1.0, 3.0],
            ),
            key(
                "change",
                "by which share of themselves the moiré changes them where it is brightest",
                0.0,
                [0.0, 0.0],
                [0.0, 1.0],
            ),
            key(
                "honeycomb",
                "1 for a honeycomb, 0 for a triangular lattice",
                0.0,
                [0.0, 0.0],
                [0.0, 1.0],
            ),
        ],
    ),
    class(
        "step",
        "a step of the substrate across the frame; the moiré continues on both sides",
        &[
            key("height", "°", 3.0, [1.0, 8.0], HEIGHT),
            key(
                "share",
                "share of the lower side",
                0.5,
                [0.15, 0.85],
                [0.0, 1.0],
            ),
            key(
                "angle",
                "direction up the step, °",
                75.0,
                [0.0, 360.0],
                TURN,
            ),
        ],
    ),
    class(
        "terrain",
        "rough ground with a power-law spectrum",
        &[
            key("rms", "°", 1.5, [0.5, 2.5], [0.0, 1000.0]),
            key(
                "exponent",
                "exponent of Λ in the power of waves of length Λ",
                3.0,
                [2.0, 4.0],
                [0.0, 8.0],
            ),
        ],
    ),
    class(
        "ripples",
        "irregular ripples around one direction and wavelength",
        &[
            WAVE_HEIGHT,
            key("wavelength", "nm", 12.0, [6.0, 25.0], [0.1, 1e6]),
            key(
                "spread",
                "relative, of wavelengths, and of directions in rad",
                0.15,
                [0.05, 0.3],
                [0.0, 1.0],
            ),
            WAVE_ANGLE,
        ],
    ),
    class(
        "stripes",
        "a perfect wave with harmonics",
        &[
            WAVE_HEIGHT,
            key("wavelength", "nm", 10.0, [6.0, 25.0], [0.1, 1e6]),
            key(
                "sharpness",
                "the n-th harmonic has this number to the power n²−1",
                0.3,
                [0.0, 0.6],
                [0.0, 0.99],
            ),
            WAVE_ANGLE,
        ],
    ),
    class(
        "hum",
        "pick-up of the mains or a vibration",
        &[
            key("amplitude", "°", 0.5, [0.2, 1.5], [0.0, 1000.0]),
            key("frequency", "Hz", 50.0, [45.0, 400.0], [0.0, 1e6]),
        ],
    ),
    class(
        "scars",
        "lines in which the tip jumped for a part of the line",
        &[
            key("count", "in a frame", 10.0, [5.0, 40.0], [0.0, 1e5]),
            key(
                "length",
                "mean, share of a line",
                0.3,
                [0.1, 0.5],
                [0.0, 1.0],
            ),
            key("height", "°", 5.0, [2.0, 8.0], HEIGHT),
        ],
    ),
    class(
        "glitches",
        "samples of the position sensors that are wrong (spikes)",
        &[
            key(
                "share",
                "share of the samples",
                0.01,
                [0.001, 0.02],
                [0.0, 0.5],
            ),
            key(
                "size",
                "height of the spikes, nm",
                1000.0,
                [20.0, 2000.0],
                [0.0, 1e5],
            ),
        ],
    ),
    class(
        "lag",
        "position sensors late by a time constant (first order)",
        &[key("time", "ms", 2.0, [0.3, 4.0], [0.0, 1000.0])],
    ),
    class(
        "hysteresis",
        "a scanner whose lines, and whose slow axis, are bowed one way there and the other way back",
        &[
            key(
                "fast",
                "of the lines, against straight ones, % of the width",
                2.0,
                [-3.0, 3.0],
                PERCENT,
            ),
            key(
                "slow",
                "of the slow axis, % of the height",
                1.0,
                [-3.0, 3.0],
                PERCENT,
            ),
            key(
                "skew",
                "how much more at the end than at the start",
                0.3,
                [-0.5, 0.5],
                [-1.0, 1.0],
            ),
            RECORDED,
        ],
    ),
    class(
        "creep",
        "a scanner that goes on by the logarithm of the time since the frame began",
        &[
            key(
                "fast",
                "along the lines, % of the width a decade",
                1.0,
                [-1.5, 1.5],
                PERCENT,
            ),
            key(
                "slow",
                "across the lines, % of the height a decade",
                1.0,
                [-1.5, 1.5],
                PERCENT,
            ),
            key(
                "begin",
                "when it begins to slow down, s",
                1.0,
                [0.3, 3.0],
                [1e-3, 1e6],
            ),
            RECORDED,
        ],
    ),
    class(
        "ringing",
        "a scanner that swings after each turn-around",
        &[
            key("size", "% of the width", 0.3, [0.05, 0.5], PERCENT),
            key("frequency", "Hz", 300.0, [100.0, 600.0], [0.0, 1e6]),
            key(
                "time",
                "in which it falls to 1/e, ms",
                5.0,
                [2.0, 8.0],
                [1e-3, 1e6],
            ),
            RECORDED,
        ],
    ),
    class(
        "bare",
        "no moiré: only noise and the other classes that are given",
        &[],
    ),
];

/// The class of this name.
pub fn sample_class(name: &str) -> Option<&'static SampleClass> {
    CLASSES.iter().find(|class| class.name == name)
}

impl SampleClass {
    /// Its key of this name.
    pub fn key(&self, name: &str) -> Option<&'static Key> {
        self.keys.iter().find(|key| key.name == name)
    }
}

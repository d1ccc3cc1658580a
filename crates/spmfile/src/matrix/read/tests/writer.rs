//! Made-up sessions, byte by byte as the descriptions have it, without the reader's help.

/// A value of a parameter.
#[derive(Clone, Copy)]
pub(crate) enum V {
    Bool(bool),
    Long(i32),
    Double(f64),
    Text(&'static str),
}

/// Keys of axes, quantities and channels have this in their lower half.
const EXPERIMENT: u64 = 0x0044_0043;

pub(crate) fn key(number: u64) -> u64 {
    number << 32 | EXPERIMENT
}

fn text(text: &str) -> Vec<u8> {
    let units: Vec<u16> = text.encode_utf16().collect();
    let mut bytes = (units.len() as u32).to_le_bytes().to_vec();
    bytes.extend(units.iter().flat_map(|unit| unit.to_le_bytes()));
    bytes
}

fn value(value: V) -> Vec<u8> {
    match value {
        V::Bool(yes) => [&b"LOOB"[..], &u32::from(yes).to_le_bytes()].concat(),
        V::Long(n) => [&b"GNOL"[..], &n.to_le_bytes()].concat(),
        V::Double(n) => [&b"BUOD"[..], &n.to_le_bytes()].concat(),
        V::Text(words) => [&b"GRTS"[..], &text(words)].concat(),
    }
}

fn backwards(mark: &str) -> Vec<u8> {
    mark.bytes().rev().collect()
}

/// A block without a time.
fn inner(mark: &str, body: &[u8]) -> Vec<u8> {
    let length = (body.len() as u32).to_le_bytes();
    [&backwards(mark)[..], &length, body].concat()
}

/// The log of a session.
#[derive(Clone)]
pub(crate) struct Log(pub(crate) Vec<u8>);

/// What is recorded: number of the channel, its name and unit, number of its fast axis.
pub(crate) type Recorded<'a> = (u64, &'a str, &'a str, u64);

/// Names, units and values.
pub(crate) type Parameters<'a> = &'a [(&'a str, &'a str, V)];

impl Log {
    pub(crate) fn new() -> Self {
        let program = [
            text("MATRIX"),
            text("V3.2"),
            vec![0; 4],
            text("profile"),
            text("user"),
        ];
        Self(b"ONTMATRX0101".to_vec()).block("META", 1_600_000_000, &program.concat())
    }

    pub(crate) fn block(mut self, mark: &str, time: u64, body: &[u8]) -> Self {
        self.0.extend(backwards(mark));
        self.0.extend((body.len() as u32).to_le_bytes());
        self.0.extend(time.to_le_bytes());
        self.0.extend(body);
        self
    }

    /// All parameters, in groups.
    pub(crate) fn parameters(self, groups: &[(&str, Parameters<'_>)]) -> Self {
        let mut body = vec![0; 4];
        body.extend((groups.len() as u32).to_le_bytes());
        for (group, list) in groups {
            body.extend(text(group));
            body.extend((list.len() as u32).to_le_bytes());
            for &(name, unit, v) in *list {
                body.extend([text(name), text(unit), vec![0; 4], value(v)].concat());
            }
        }
        self.block("EEPA", 1_600_000_001, &body)
    }

    /// A change of a parameter.
    pub(crate) fn change(self, time: u64, group: &str, name: &str, unit: &str, v: V) -> Self {
        let parts = [
            vec![0; 4],
            text(group),
            text(name),
            text(unit),
            vec![0; 4],
            value(v),
            vec![0; 4],
        ];
        self.block("PMOD", time, &parts.concat())
    }

    pub(crate) fn mark(self, words: &str) -> Self {
        self.block("MARK", 1_600_000_002, &text(words))
    }

    pub(crate) fn stored(self, time: u64, file: &str) -> Self {
        self.block("BREF", time, &[vec![0; 4], text(file)].concat())
    }

    pub(crate) fn channels(self, parts: &[Vec<u8>]) -> Self {
        let body = [vec![0; 4], parts.concat()].concat();
        self.block("CCSY", 1_600_000_003, &body)
    }
}

/// X (number 1), Y (2) and an axis of curves (3), mirrored or not, and what is recorded along them. The
/// quantity of channel n has the number 100 + n.
pub(crate) fn dictionary(mirrored: [bool; 2], recorded: &[Recorded<'_>]) -> Vec<u8> {
    let mut body = vec![0; 8];
    let pattern = |mirrored| text(if mirrored { "triangular" } else { "linear" });
    let axes = [
        (1, 2, "Default::XYScanner::X", mirrored[0]),
        (2, 0, "Default::XYScanner::Y", mirrored[1]),
        (3, 0, "Default::Spectroscopy::V", false),
    ];
    body.extend((axes.len() as u32).to_le_bytes());
    for (number, slower, name, mirrored) in axes {
        let slower = if slower == 0 { 0 } else { key(slower) };
        body.extend(key(number).to_le_bytes());
        body.extend(slower.to_le_bytes());
        body.extend([text(name), pattern(mirrored)].concat());
    }
    body.extend((recorded.len() as u32).to_le_bytes());
    for (number, name, unit, axis) in recorded {
        body.extend(key(100 + number).to_le_bytes());
        body.extend(key(*axis).to_le_bytes());
        body.extend([text(name), text(unit)].concat());
    }
    body.extend((recorded.len() as u32).to_le_bytes());
    for (number, name, ..) in recorded {
        body.extend(key(*number).to_le_bytes());
        body.extend(key(100 + number).to_le_bytes());
        body.extend(text(name));
    }
    inner("DICT", &body)
}

/// Samples along X and Y, both ways together.
pub(crate) fn lengths(x: u32, y: u32) -> Vec<u8> {
    let mut body = 2u32.to_le_bytes().to_vec();
    for (number, length) in [(1, x), (2, y)] {
        body.extend(key(number).to_le_bytes());
        body.extend(length.to_le_bytes());
        body.extend([0; 8]);
    }
    body.extend([0; 8]);
    inner("CHCS", &body)
}

/// The transfer function of a channel.
pub(crate) fn transfer(channel: u64, kind: &str, unit: &str, numbers: &[(&str, f64)]) -> Vec<u8> {
    let mut body = key(100 + channel).to_le_bytes().to_vec();
    body.extend([text(kind), text(unit)].concat());
    body.extend((numbers.len() as u32).to_le_bytes());
    for (name, number) in numbers {
        body.extend([text(name), value(V::Double(*number))].concat());
    }
    inner("XFER", &body)
}

/// The file of a channel.
pub(crate) fn data(time: u64, channel: u64, intended: u32, counts: &[i32]) -> Vec<u8> {
    let mut description = key(channel).to_le_bytes().to_vec();
    description.extend([1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]);
    description.extend(intended.to_le_bytes());
    description.extend((counts.len() as u32).to_le_bytes());
    description.extend(text("SI32"));
    for n in [4, 1, 0, intended] {
        description.extend(n.to_le_bytes());
    }
    let samples: Vec<u8> = counts.iter().flat_map(|n| n.to_le_bytes()).collect();
    let blocks = [inner("DESC", &description), inner("DATA", &samples)].concat();
    let mut bytes = b"ONTMATRX0101TLKB".to_vec();
    bytes.extend((blocks.len() as u32 + 4).to_le_bytes());
    bytes.extend(time.to_le_bytes());
    bytes.extend([0; 4]);
    bytes.extend(blocks);
    bytes
}

/// A scanner of 4 × 3 points over 80 nm × 60 nm at 0.01 s, with all ways recorded, and a channel Z (7) of
/// 0.5 nm per count.
pub(crate) fn session() -> Log {
    scanner([true, true]).channels(&[
        dictionary([true, true], &[(7, "Z", "m", 1)]),
        lengths(8, 6),
        transfer(7, "TFF_Linear1D", "m", &[("Factor", 2e9), ("Offset", 10.0)]),
    ])
}

/// The parameters of [`session`], with trace and retrace, up and down as wanted.
pub(crate) fn scanner([retrace, down]: [bool; 2]) -> Log {
    Log::new().parameters(&[
        (
            "GapVoltageControl",
            &[
                ("Voltage", "Volt", V::Double(-1.5)),
                ("Preamp_Range", "--", V::Text("1;3.3e-7")),
            ],
        ),
        (
            "XYScanner",
            &[
                ("Angle", "Degree", V::Long(-30)),
                ("Height", "Meter", V::Double(6e-8)),
                ("Lines", "Count", V::Long(3)),
                ("Points", "Count", V::Long(4)),
                ("Raster_Time", "Second", V::Double(0.01)),
                ("Scan_Constraint", "--", V::Long(0)),
                ("Width", "Meter", V::Double(8e-8)),
                ("X_Offset", "Meter", V::Double(1e-7)),
                ("X_Retrace", "--", V::Bool(retrace)),
                ("Y_Offset", "Meter", V::Double(-2e-7)),
                ("Y_Retrace", "--", V::Bool(down)),
            ],
        ),
    ])
}

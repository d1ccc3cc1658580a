//! Colour maps for images, as tables of 256 colours.

use serde::{Deserialize, Serialize};

/// A colour map for scans.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum ColorMap {
    /// Viridis: perceptually uniform, safe for the colour-blind.
    #[default]
    Viridis,
    /// Black to white.
    Grey,
    /// The brown of the NanoScope software: black, brown, copper, cream.
    Nanoscope,
    /// The default of Gwyddion: black, dark red, orange, yellow, white.
    Gwyddion,
}

impl ColorMap {
    /// Every colour map.
    pub const ALL: [Self; 4] = [Self::Viridis, Self::Grey, Self::Nanoscope, Self::Gwyddion];

    /// The name used on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Viridis => "viridis",
            Self::Grey => "grey",
            Self::Nanoscope => "nanoscope",
            Self::Gwyddion => "gwyddion",
        }
    }

    /// The colours from the lowest value to the highest.
    pub(crate) fn table(self) -> [[u8; 3]; 256] {
        std::array::from_fn(|i| self.colour(i as f64 / 255.0))
    }

    fn colour(self, t: f64) -> [u8; 3] {
        match self {
            Self::Viridis => {
                let c = colorous::VIRIDIS.eval_continuous(t);
                [c.r, c.g, c.b]
            }
            Self::Grey => between(&[(0.0, [0, 0, 0]), (1.0, [255, 255, 255])], t),
            Self::Nanoscope => between(
                &[
                    (0.0, [0, 0, 0]),
                    (0.25, [76, 32, 6]),
                    (0.5, [160, 88, 26]),
                    (0.75, [222, 160, 84]),
                    (1.0, [255, 244, 214]),
                ],
                t,
            ),
            Self::Gwyddion => between(
                &[
                    (0.0, [0, 0, 0]),
                    (0.344_671, [168, 40, 15]),
                    (0.687_075, [243, 194, 93]),
                    (1.0, [255, 255, 255]),
                ],
                t,
            ),
        }
    }
}

impl std::str::FromStr for ColorMap {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|map| map.name() == name);
        found.ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            format!("unknown colour map {name:?}; there are {names}")
        })
    }
}

/// Linear interpolation between colours at increasing positions from 0 to 1.
fn between(stops: &[(f64, [u8; 3])], t: f64) -> [u8; 3] {
    for pair in stops.windows(2) {
        let [(t0, low), (t1, high)] = [pair[0], pair[1]];
        if t <= t1 {
            let share = ((t - t0) / (t1 - t0)).clamp(0.0, 1.0);
            return std::array::from_fn(|i| {
                let (a, b) = (f64::from(low[i]), f64::from(high[i]));
                (a + share * (b - a)).round() as u8
            });
        }
    }
    stops.last().map_or([0; 3], |&(_, colour)| colour)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rec. 709 luminance; a map for heights must never get darker on the way up.
    #[test]
    fn every_map_gets_lighter_all_the_way() {
        for map in ColorMap::ALL {
            let light: Vec<f64> = map
                .table()
                .iter()
                .map(|&[r, g, b]| {
                    0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
                })
                .collect();
            // Half a count: colours are rounded to whole numbers.
            assert!(
                light.windows(2).all(|w| w[1] >= w[0] - 0.5),
                "{}",
                map.name()
            );
            assert!(light[255] - light[0] > 150.0);
        }
    }

    #[test]
    fn names_are_read_back() {
        for map in ColorMap::ALL {
            assert_eq!(map.name().parse(), Ok(map));
        }
        assert!("jet".parse::<ColorMap>().is_err());
    }
}

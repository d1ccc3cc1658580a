//! Values of the reader of files as they are written with a measured scan.

// Serde hands over references.
#![allow(clippy::ref_option, clippy::trivially_copy_pass_by_ref)]

/// A date and time.
pub(super) mod date {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};
    use spmfile::DateTime;

    pub(crate) fn serialize<S: Serializer>(
        at: &Option<DateTime>,
        to: S,
    ) -> Result<S::Ok, S::Error> {
        let parts = at.map(|t| (t.year, [t.month, t.day, t.hour, t.minute, t.second]));
        parts.serialize(to)
    }

    pub(crate) fn deserialize<'a, D: Deserializer<'a>>(
        from: D,
    ) -> Result<Option<DateTime>, D::Error> {
        let parts = Option::<(i32, [u8; 5])>::deserialize(from)?;
        Ok(
            parts.map(|(year, [month, day, hour, minute, second])| DateTime {
                year,
                month,
                day,
                hour,
                minute,
                second,
            }),
        )
    }
}

/// The sense of the slow motion.
pub(super) mod frame_direction {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};
    use spmfile::FrameDirection;

    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    enum Written {
        Up,
        Down,
    }

    pub(crate) fn serialize<S: Serializer>(
        direction: &Option<FrameDirection>,
        to: S,
    ) -> Result<S::Ok, S::Error> {
        let written = direction.map(|direction| match direction {
            FrameDirection::Up => Written::Up,
            FrameDirection::Down => Written::Down,
        });
        written.serialize(to)
    }

    pub(crate) fn deserialize<'a, D: Deserializer<'a>>(
        from: D,
    ) -> Result<Option<FrameDirection>, D::Error> {
        let written = Option::<Written>::deserialize(from)?;
        Ok(written.map(|written| match written {
            Written::Up => FrameDirection::Up,
            Written::Down => FrameDirection::Down,
        }))
    }
}

/// The sense of the fast motion.
pub(super) mod line {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};
    use spmfile::LineDirection;

    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    enum Written {
        Trace,
        Retrace,
    }

    pub(crate) fn serialize<S: Serializer>(line: &LineDirection, to: S) -> Result<S::Ok, S::Error> {
        let written = match line {
            LineDirection::Trace => Written::Trace,
            LineDirection::Retrace => Written::Retrace,
        };
        written.serialize(to)
    }

    pub(crate) fn deserialize<'a, D: Deserializer<'a>>(from: D) -> Result<LineDirection, D::Error> {
        Ok(match Written::deserialize(from)? {
            Written::Trace => LineDirection::Trace,
            Written::Retrace => LineDirection::Retrace,
        })
    }
}

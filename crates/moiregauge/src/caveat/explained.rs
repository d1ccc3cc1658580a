//! What is told of a doubt at length.

use serde::Serialize;

/// How much a doubt weighs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Severity {
    /// How a number was made, or what was assumed for it.
    Note,
    /// A number is less certain than its error says, or can mean something else.
    Warning,
    /// A result is probably wrong, or was left out.
    Serious,
}

impl Severity {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Note => "note",
            Self::Warning => "warning",
            Self::Serious => "serious",
        }
    }

    /// What the grade means.
    pub fn meaning(self) -> &'static str {
        match self {
            Self::Note => "How a number was made, or what was assumed for it.",
            Self::Warning => {
                "A number is less certain than its error says, or can mean something else."
            }
            Self::Serious => "A result is probably wrong, or was left out.",
        }
    }
}

/// What a doubt means and what to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Explained {
    /// Stable kebab-case code.
    pub code: &'static str,
    /// How much it weighs.
    pub severity: Severity,
    /// What it means for the results.
    pub meaning: &'static str,
    /// What helps.
    pub what_to_do: &'static str,
}

/// The table of a subject: of each doubt its code, how much it weighs, what it means, and what to do. A doubt without
/// an entry does not compile.
macro_rules! explain {
    ($subject:ident: $($doubt:ident $code:literal $severity:ident $meaning:literal $what_to_do:literal)+) => {
        impl $subject {
            /// All of them, in order.
            pub(super) const TABLE: &'static [$crate::caveat::Explained] = &[
                $($crate::caveat::Explained {
                    code: $code,
                    severity: $crate::caveat::Severity::$severity,
                    meaning: $meaning,
                    what_to_do: $what_to_do,
                }),+
            ];

            /// What it means and what to do.
            pub(super) fn explained(&self) -> &'static $crate::caveat::Explained {
                match self {
                    $(Self::$doubt { .. } => &$crate::caveat::Explained {
                        code: $code,
                        severity: $crate::caveat::Severity::$severity,
                        meaning: $meaning,
                        what_to_do: $what_to_do,
                    }),+
                }
            }
        }
    };
}

pub(super) use explain;

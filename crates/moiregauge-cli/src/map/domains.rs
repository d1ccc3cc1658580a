//! Whether nodes and triangles are looked for, and what they say.

use clap::ValueEnum;
use moiregauge::caveat::Caveat;
use moiregauge::domains::{Contrast, DomainMap, Regime, RegimeChoice, regime};
use moiregauge::map::{TwistStrainMap, UsedHarmonic};

/// Domain structure at small angles.
#[derive(clap::Args, Clone, Debug)]
#[command(next_help_heading = "Domains at small angles")]
pub(super) struct DomainArgs {
    /// Look for nodes and the triangles between them: twist and strain of each where the lattice relaxes into
    /// domains. auto: only where maps of phases are in doubt (twist below 0.5°, sharp walls, fast changes)
    #[arg(long, value_enum, default_value_t = When::Auto)]
    domains: When,
    /// Whether nodes are bright or dark [default: what the image tells]
    #[arg(long, value_enum)]
    nodes: Option<Look>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum When {
    Auto,
    On,
    Off,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Look {
    Bright,
    Dark,
}

/// What was found.
#[derive(Clone, Debug)]
pub(super) struct Domains {
    pub(super) map: Option<DomainMap>,
    pub(super) regime: Regime,
    pub(super) caveats: Vec<Caveat>,
}

impl DomainArgs {
    /// Looks for domains if they are wanted; `find` gives those of all images.
    pub(super) fn answer(
        &self,
        map: &TwistStrainMap,
        harmonics: &[UsedHarmonic],
        find: impl FnOnce(Contrast) -> Vec<DomainMap>,
    ) -> Option<Domains> {
        let before = regime(map, harmonics, None);
        if self.domains == When::Off || (self.domains == When::Auto && before.reasons.is_empty()) {
            return None;
        }
        let contrast = match self.nodes {
            None => Contrast::Auto,
            Some(Look::Bright) => Contrast::Bright,
            Some(Look::Dark) => Contrast::Dark,
        };
        let found = find(contrast);
        let images = found.len();
        let best = found.into_iter().max_by_key(|d| d.cells.len());
        let regime = regime(map, harmonics, best.as_ref());
        let mut caveats = Vec::new();
        if images > 1 {
            caveats.push(Caveat::new(
                "domains-of-one-image",
                "domains",
                format!("{images} images show domains; the triangles are those of the one with most of them"),
            ));
        }
        match &best {
            None => caveats.push(Caveat::new(
                "no-domains",
                "domains",
                "phases under a window are in doubt here, and nodes could not be found either",
            )),
            Some(d) if !d.contrast_is_clear && self.nodes.is_none() => caveats.push(Caveat::new(
                "nodes-bright-or-dark",
                "domains",
                "the image does not tell whether nodes are bright or dark: triangles may stand on domains instead \
                 of nodes; say --nodes bright or dark",
            )),
            Some(_) if regime.choice == RegimeChoice::Domains => caveats.push(Caveat::new(
                "use-domains",
                "map",
                "the maps of phases mix relaxation with strain here: use the triangles between nodes",
            )),
            Some(_) => {}
        }
        Some(Domains {
            map: best,
            regime,
            caveats,
        })
    }
}

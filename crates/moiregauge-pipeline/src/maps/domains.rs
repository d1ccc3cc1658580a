//! Whether nodes and triangles are looked for, and what they say.

use moiregauge::caveat::{Caveat, PatternDoubt};
use moiregauge::domains::regime;
use moiregauge::domains::{Contrast, DomainMap, Regime, RegimeChoice};
use moiregauge::map::TwistStrainMap;

use super::request::{DomainSearch, When};

/// What was found, and which regime applies.
#[derive(Clone, Debug)]
pub struct Domains {
    /// The best of the images.
    pub map: Option<DomainMap>,
    /// Whether phases or domains are to be used.
    pub regime: Regime,
    /// Doubts.
    pub caveats: Vec<Caveat>,
}

impl Domains {
    /// None are looked for where no layers make the lattice: triangles would read it all the same.
    pub(super) fn none(map: &TwistStrainMap) -> Self {
        Self {
            map: None,
            regime: regime(map, None),
            caveats: Vec::new(),
        }
    }
}

/// Missing and extra nodes beyond this share of all make the mesh doubtful.
const ODD: f64 = 0.15;

impl DomainSearch {
    /// Which regime applies; looks for domains if they are wanted. `find` gives those of all images.
    pub(super) fn answer(
        self,
        map: &TwistStrainMap,
        find: impl FnOnce(Contrast) -> Vec<DomainMap>,
    ) -> Domains {
        let before = regime(map, None);
        let wanted = match self.when {
            When::Off => false,
            When::Auto => before.in_doubt,
            When::On => true,
        };
        if !wanted {
            let caveats = before.in_doubt.then(|| in_doubt(&before));
            return Domains {
                map: None,
                regime: before,
                caveats: caveats.into_iter().collect(),
            };
        }
        let found = find(self.nodes);
        let images = found.len();
        let best = found.into_iter().max_by_key(|d| d.cells.len());
        let regime = regime(map, best.as_ref());
        let mut caveats = Vec::new();
        let mut doubt = |doubt: PatternDoubt| caveats.push(Caveat::new(doubt, "domains"));
        if images > 1 {
            doubt(PatternDoubt::DomainsOfOneImage { images });
        }
        match &best {
            None => doubt(PatternDoubt::NoDomains),
            Some(d) => about_mesh(d, self.nodes == Contrast::Auto, &mut doubt),
        }
        if regime.choice == RegimeChoice::Domains {
            let reasons = regime.reasons.join("; ");
            caveats.push(Caveat::new(PatternDoubt::UseDomains { reasons }, "map"));
        } else if regime.in_doubt {
            caveats.push(in_doubt(&regime));
        }
        Domains {
            map: best,
            regime,
            caveats,
        }
    }
}

/// What is doubtful about a mesh of nodes; `is_open` where nobody said whether nodes are bright or dark.
fn about_mesh(d: &DomainMap, is_open: bool, doubt: &mut impl FnMut(PatternDoubt)) {
    if !d.contrast_is_clear && is_open {
        doubt(PatternDoubt::NodesBrightOrDark);
    }
    let odd = d.missing.len() + d.extra.len();
    if odd as f64 > ODD * d.nodes.len() as f64 {
        let nodes = d.nodes.len();
        doubt(PatternDoubt::MeshWithGaps { odd, nodes });
    }
}

/// Says that phases are not to be believed here without more.
fn in_doubt(regime: &Regime) -> Caveat {
    let reasons = regime.reasons.join("; ");
    Caveat::new(PatternDoubt::PhasesInDoubt { reasons }, "map")
}

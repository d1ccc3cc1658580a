//! Doubts about stripes and domains.

use heterostrain::Estimate;

use crate::caveat::explained::explain;
use crate::numbers::words::plus_minus;

/// Stripes and domains.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PatternDoubt {
    /// There is no lattice.
    #[error(
        "the image shows stripes and no lattice: one wave vector in each pattern, which does not tell twist and strain. \
         The map has wavelength and direction"
    )]
    StripesOnly,
    /// Several patterns of stripes.
    #[error(
        "{} patterns lie side by side ({} of the nodes): each node has the wave of the strongest there; nodes within a \
         window of a boundary are bent",
        .shares.len(), percents(.shares)
    )]
    StripeDomains {
        /// The share of the nodes of each.
        shares: Vec<f64>,
    },
    /// Stripes in a part of the image.
    #[error("the stripes stand out at {:.0} % of the nodes only", 100.0 * .share)]
    StripesInPart {
        /// Of the nodes.
        share: f64,
    },
    /// Stripes that bend or change.
    #[error(
        "one wave has only {:.0} % of the power of the stripes of pattern {pattern}, whose wave vector changes across the \
         frame: the mean of the map is the better number",
        100.0 * .coherence
    )]
    StripesVary {
        /// Its number.
        pattern: usize,
        /// Share of the power.
        coherence: f64,
    },
    /// Map and fit contradict each other.
    #[error(
        "pattern {pattern}: at the middle of the pattern the map less the fit to all its pixels is {} nm and {}°: it \
         changes by more than a plane across the frame",
        plus_minus(*.wavelength), plus_minus(.direction.scaled(1f64.to_degrees()))
    )]
    StripesMapAndFit {
        /// Its number.
        pattern: usize,
        /// Map less fit, nm.
        wavelength: Estimate,
        /// Map less fit, rad.
        direction: Estimate,
    },
    /// One line direction cannot tell stripes from interference.
    #[error(
        "trace or retrace alone: mains pick-up and other interference in time make stripes too, which only the other \
         line direction can tell"
    )]
    StripesOfOneDirection,
    /// The maps of phases may not hold.
    #[error("{reasons}")]
    PhasesInDoubt {
        /// Why.
        reasons: String,
    },
    /// The triangles are the answer.
    #[error("use the triangles between nodes and not the maps of phases: {reasons}")]
    UseDomains {
        /// Why.
        reasons: String,
    },
    /// Several images show domains.
    #[error("{images} images show domains; the triangles are those of the one with most of them")]
    DomainsOfOneImage {
        /// How many.
        images: usize,
    },
    /// No domains were found.
    #[error("no mesh of nodes could be found in the image")]
    NoDomains,
    /// The contrast of nodes is open.
    #[error(
        "the image does not tell whether nodes are bright or dark: triangles may stand on domains instead of nodes"
    )]
    NodesBrightOrDark,
    /// The mesh has gaps.
    #[error(
        "{odd} of {nodes} nodes are missing or fit into no triangle: the mesh may not be that of the lattice"
    )]
    MeshWithGaps {
        /// Missing and extra ones.
        odd: usize,
        /// All that were found.
        nodes: usize,
    },
}

fn percents(shares: &[f64]) -> String {
    let all: Vec<String> = shares
        .iter()
        .map(|share| format!("{:.0} %", 100.0 * share))
        .collect();
    all.join(", ")
}

explain! { PatternDoubt:
    StripesOnly "stripes-only" Warning
        "The image shows stripes and no lattice. One wave vector does not tell twist and strain; the map has wavelength and \
         direction."
        "If the sample should show a lattice, look at other channels, or scan a larger frame with a better tip."
    StripeDomains "stripe-domains" Note
        "Several patterns of stripes lie side by side. Each node has the wave of the strongest there, and those near \
         boundaries are marked as bent."
        "Read the numbers of each pattern by itself."
    StripesInPart "stripes-in-part" Warning
        "The stripes stand out in a part of the image only. The numbers are those of that part."
        "Look at the map for where the stripes are, and scan there."
    StripesVary "stripes-vary" Warning
        "The stripes change across the frame, so that one wave fitted to all of it has a part of their power only."
        "Use the mean of the map in place of the fit of one wave."
    StripesMapAndFit "stripes-map-and-fit" Warning
        "At the middle of a pattern the map and the fit to all pixels differ by more than their errors. The pattern changes \
         in a way that neither single number describes."
        "Use the map itself, or regions of it."
    StripesOfOneDirection "stripes-of-one-direction" Warning
        "Only trace or retrace was measured. Mains pick-up and other interference make stripes, too, and cannot be told \
         from those of the sample."
        "Use trace and retrace: stripes of the sample are the same in both."
    PhasesInDoubt "phases-in-doubt" Warning
        "The lattice relaxes into domains or changes faster than the window of the map resolves. Twist and strain of the map \
         are blurred there."
        "Look for the nodes of the domains and use the triangles between them, or use a narrower window."
    UseDomains "use-domains" Warning
        "The lattice relaxes into domains. Twist and strain of the triangles between nodes are the numbers to use, and not \
         the maps of phases."
        "Use the twist and strain of the triangles."
    DomainsOfOneImage "domains-of-one-image" Note
        "Several images show domains, and the triangles are those of one of them: the one with most."
        "Map the images one by one to compare their triangles."
    NoDomains "no-domains" Serious
        "No mesh of nodes was found in the image. There are no triangles."
        "Say whether nodes are bright or dark, or use a channel that shows them better."
    NodesBrightOrDark "nodes-bright-or-dark" Warning
        "Nodes and domains cannot be told apart by their brightness. If the wrong ones were taken, twist and strain of the \
         triangles are those of the neighbours."
        "Look at the image, and say whether nodes are bright or dark."
    MeshWithGaps "mesh-with-gaps" Warning
        "Many nodes are missing or fit into no triangle. The mesh may not be that of the lattice."
        "Look at the figure of the domains. A better image, or another contrast of the nodes, may close the gaps."
}

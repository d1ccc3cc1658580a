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
        "there is no twist and strain: the image shows stripes and no lattice, and one wave vector does not determine \
         them. The map gives wavelength and direction"
    )]
    StripesOnly,
    /// Several patterns of stripes.
    #[error(
        "each node has the wave of the pattern that is strongest there: {} patterns lie side by side ({} of the \
         nodes). Nodes within one window of a boundary are marked as bent",
        .shares.len(), percents(.shares)
    )]
    StripeDomains {
        /// The share of the nodes of each.
        shares: Vec<f64>,
    },
    /// Stripes in a part of the image.
    #[error("the numbers come from a part of the image: the stripes are significant at {:.0} % of the nodes only", 100.0 * .share)]
    StripesInPart {
        /// Of the nodes.
        share: f64,
    },
    /// Stripes that bend or change.
    #[error(
        "use the mean of the map instead of the fit of one wave: the wave vector of pattern {pattern} changes across \
         the frame, and one wave has only {:.0} % of the power of its stripes",
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
        "no single number describes pattern {pattern}: at its middle the map and the fit to all pixels differ by {} nm \
         and {}°, and it changes across the frame by more than a plane",
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
        "the stripes may be interference, such as mains pick-up: only trace or only retrace was measured. Compare with \
         the other line direction"
    )]
    StripesOfOneDirection,
    /// The maps of phases may not hold.
    #[error("{reasons}")]
    PhasesInDoubt {
        /// Why.
        reasons: String,
    },
    /// The triangles are the answer.
    #[error("use the triangles between nodes instead of the maps of phases: {reasons}")]
    UseDomains {
        /// Why.
        reasons: String,
    },
    /// Several images show domains.
    #[error(
        "the triangles come from one of the {images} images that show domains, the one that has most of them"
    )]
    DomainsOfOneImage {
        /// How many.
        images: usize,
    },
    /// No domains were found.
    #[error("there are no triangles, since no mesh of nodes was found in the image")]
    NoDomains,
    /// The contrast of nodes is open.
    #[error(
        "twist and strain of the triangles may be wrong: the image does not show whether nodes are bright or dark. The \
         corners of the triangles may be domains instead of nodes"
    )]
    NodesBrightOrDark,
    /// The mesh has gaps.
    #[error(
        "the mesh may not be that of the lattice: {odd} of {nodes} nodes are missing or fit into no triangle"
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
        "The image shows stripes and no lattice. One wave vector does not determine twist and strain. The map gives \
         wavelength and direction."
        "If the sample should show a lattice, look at other channels, or scan a larger frame with a better tip."
    StripeDomains "stripe-domains" Note
        "Several patterns of stripes lie side by side. Each node has the wave of the pattern that is strongest there. \
         Nodes near boundaries are marked as bent."
        "Read the numbers of each pattern by itself."
    StripesInPart "stripes-in-part" Warning
        "The stripes are above the noise in only a part of the image. The numbers come from this part."
        "Look at the map to see where the stripes are, and scan there."
    StripesVary "stripes-vary" Warning
        "The stripes change across the frame. One wave fitted to the whole frame has only a part of their power."
        "Use the mean of the map instead of the fit of one wave."
    StripesMapAndFit "stripes-map-and-fit" Warning
        "At the middle of a pattern the map and the fit to all pixels differ by more than their errors. The pattern \
         changes across the frame in a way that no single number describes."
        "Use the map itself, or regions of it."
    StripesOfOneDirection "stripes-of-one-direction" Warning
        "Only trace or only retrace was measured. Mains pick-up and other interference make stripes too, and one line \
         direction alone cannot distinguish them from stripes of the sample."
        "Use trace and retrace: stripes of the sample are the same in both."
    PhasesInDoubt "phases-in-doubt" Warning
        "The lattice relaxes into domains or changes faster than the window of the map resolves. Twist and strain of the map \
         are blurred there."
        "Look for the nodes of the domains and use the triangles between them, or use a narrower window."
    UseDomains "use-domains" Warning
        "The lattice relaxes into domains. Use twist and strain of the triangles between nodes, not the maps of phases."
        "Use the twist and strain of the triangles."
    DomainsOfOneImage "domains-of-one-image" Note
        "Several images show domains. The triangles come from the image that has most of them."
        "Map the images one by one to compare their triangles."
    NoDomains "no-domains" Serious
        "No mesh of nodes was found in the image. There are no triangles."
        "Say whether nodes are bright or dark, or use a channel that shows them better."
    NodesBrightOrDark "nodes-bright-or-dark" Warning
        "Nodes and domains have similar brightness. If the wrong ones were taken for nodes, twist and strain of the \
         triangles are wrong."
        "Look at the image, and say whether nodes are bright or dark."
    MeshWithGaps "mesh-with-gaps" Warning
        "Many nodes are missing or fit into no triangle. The mesh may not be that of the lattice."
        "Look at the figure of the domains. A better image, or another contrast of the nodes, may close the gaps."
}

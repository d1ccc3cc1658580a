//! Whether nodes and triangles are looked for.

use clap::ValueEnum;
use moiregauge::domains::Contrast;
use moiregauge_pipeline::maps::{self, DomainSearch};

/// Domain structure at small angles.
#[derive(clap::Args, Clone, Debug)]
#[command(next_help_heading = "Domains at small angles")]
pub(super) struct DomainArgs {
    /// Find the nodes and the triangles between them, with twist and strain of each triangle, where the lattice relaxes
    /// into domains. auto: only where maps of phases are in doubt (twist below 0.5°, fast changes, no good node)
    #[arg(long, value_enum, default_value_t = When::Auto)]
    domains: When,
    /// Whether nodes are bright or dark [default: found from the image]
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

impl DomainArgs {
    /// What is looked for.
    pub(super) fn search(&self) -> DomainSearch {
        DomainSearch {
            when: match self.domains {
                When::Auto => maps::When::Auto,
                When::On => maps::When::On,
                When::Off => maps::When::Off,
            },
            nodes: match self.nodes {
                None => Contrast::Auto,
                Some(Look::Bright) => Contrast::Bright,
                Some(Look::Dark) => Contrast::Dark,
            },
        }
    }
}

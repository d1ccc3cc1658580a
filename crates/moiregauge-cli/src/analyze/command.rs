//! `moiregauge analyze`: its options are those of an analysis, and the parts of each frame to use.

use super::args::AnalyzeArgs;
use super::by_hand::parse_part;

/// From scans to drift, moiré vectors, twist and heterostrain, with figures and a report
///
/// Scans are grouped into sets by slow axis, line rate, size and channel and ordered by time. Each set
/// gives its drift velocity (from scans of alternating slow direction), the drift-corrected moiré
/// lattice, twist and heterostrain; the sets are compared and combined. A file that cannot be used is
/// reported and skipped, and the exit code is then not 0.
#[derive(clap::Args, Clone, Debug)]
#[command(after_long_help = "\
Examples:
  moiregauge analyze scans/ --out results
  moiregauge analyze slow_y/ slow_x/ --out results --channel 'TR Amplitude'
  moiregauge analyze scan.0_00007.spm --out one --drift 0.62 -0.35 --drift-sigma 0.05
  moiregauge analyze scans/ --out as-published --method paper --strain-convention k-space
  moiregauge analyze a/ b/ --out results --set before=a --set after=b
  moiregauge analyze scans/ --out results --export corrected.gwy
  moiregauge analyze scans/ --out results --layers graphene/hBN --lattice-angle 12.3±0.2
  moiregauge analyze scans/ --out results --atomic atomic_up.spm atomic_down.spm
  moiregauge analyze scans/ --out results --moires 2 --layers graphene,graphene/hBN
  moiregauge analyze scans/ --out results --near 12nm --region 0,0,250,400
  moiregauge analyze image.npy --out results --size 70nm×70nm --line-rate 4 --frame-direction up

Angles are counter-clockwise, x to the right and y up, as the position sensors tell.")]
pub(crate) struct AnalyzeCommand {
    #[command(flatten)]
    analyze: AnalyzeArgs,
    /// Use only this part of each frame: a box (lower left corner, width, height) or the corners of a polygon separated
    /// by blanks ('0,0 100,10 60,80'). In nm, or with a unit, from the lower left corner of the frame, along and across
    /// the lines; may be repeated: all parts are used
    #[arg(long, value_name = "X,Y,W,H", help_heading = "By hand: which lattice to measure, and where it is", value_parser = parse_part, allow_hyphen_values = true)]
    region: Vec<Vec<[f64; 2]>>,
}

impl AnalyzeCommand {
    /// What the analysis asks.
    pub(crate) fn args(&self) -> AnalyzeArgs {
        let mut args = self.analyze.clone();
        args.by_hand.parts.clone_from(&self.region);
        args
    }
}

//! The strain gauge for moiré superlattices: [`spmfile::Scan`] → drift, moiré lattice, twist angle and heterostrain.
//!
//! ```
//! use moiregauge::simulate::{Simulation, Simulator};
//! use moiregauge::{Settings, analyse, measure_scan};
//!
//! let mut made = Simulation::default();
//! made.raster.pixels = [128, 128];
//! made.raster.scans = 4;
//! let scans = Simulator::new(made)?;
//! let settings = Settings::default();
//! let mut measured = Vec::new();
//! for index in 0..scans.frames() {
//!     // What needs the pixels: one scan at a time.
//!     let name = Simulator::file_name(index);
//!     measured.push(measure_scan(&name, &scans.frame(index), &settings, None)?);
//! }
//! // The rest comes from the few numbers that remain.
//! let analysis = analyse(measured, &settings);
//! let mean = analysis.sets[0].mean.as_ref().expect("a drift, and a mean");
//! let twist = mean.twist();
//! println!("twist {:.3} ± {:.3}°", twist.value.to_degrees(), twist.total.to_degrees());
//! for caveat in &analysis.caveats {
//!     println!("{} ({}): {}", caveat.code(), caveat.place, caveat.message());
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! No files, no clock, no printing. Inside: nm, s, rad; x right, y up, angles counter-clockwise. Twist and strain of a given lattice are
//! the crate [`heterostrain`]; figures and reports are made by `moiregauge-report`.
//!
//! # The house
//!
//! The modules are rooms on floors: each takes from those below it, never from those above.
//!
//! | floor | room | holds |
//! | --- | --- | --- |
//! | top | [`survey`] | maps, stripes and domains of whole scans; images too large for memory; images at rest |
//! | | [`campaign`] | all scans together: sets, drift, joint result, orientation of a layer, calibration runs |
//! | | [`plan`] | errors before anything is measured |
//! | | [`scan`] | one scan → a few numbers; where its pixels were, and when |
//! | | [`meaning`] | what a lattice means: uncertainty budget, other solutions, names |
//! | | [`domains`] | nodes and triangles at small angles |
//! | | [`region`], [`stripes`] | questions to finished maps; maps of one wave |
//! | | [`map`] | maps of the local lattice |
//! | | [`window`] | waves under a window: what both kinds of maps stand on |
//! | | [`drift`] | linear, joint and published fits of the motion of the sample |
//! | | [`settings`], [`caveat`] | every knob; every doubt |
//! | | [`lattice`], [`calibration`] | the lattice of one image; the scanner as a matrix |
//! | | [`coverage`] | where in a frame a lattice is |
//! | | [`spectrum`], [`simulate`] | where a lattice is in the spectrum; scans whose answer is known |
//! | | [`frame`] | image, geometry, background |
//! | ground | [`numbers`] | small mathematics |

pub mod calibration;
pub mod campaign;
pub mod caveat;
#[doc(hidden)]
pub mod coverage;
pub mod domains;
pub mod drift;
pub(crate) mod explain;
pub mod frame;
pub mod lattice;
pub mod map;
pub mod meaning;
#[doc(hidden)]
pub mod numbers;
pub mod plan;
pub mod region;
pub mod scan;
pub mod settings;
pub mod simulate;
#[doc(hidden)]
pub mod spectrum;
pub mod stripes;
pub mod survey;
#[doc(hidden)]
pub mod window;

pub use heterostrain;

pub use campaign::{Analysis, ScanAnalysis, SetAnalysis, SetMean, analyse};
pub use caveat::Caveat;
pub use heterostrain::{Estimate, Lattice, Material, TotalEstimate, TwistStrain, Waves};
pub use scan::{MeasuredScan, measure_scan};
pub use settings::Settings;
pub use spectrum::Method;
pub use survey::map_scan;

/// The example of the documentation, compiled.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/reference/library.md")]
struct Readme;

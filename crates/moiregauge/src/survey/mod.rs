//! Whole scans from place to place: maps, stripes and domains of scans, images too large for memory, images at rest.

pub(crate) mod averaging;
pub(crate) mod corrected;
pub(crate) mod domain_mapping;
pub(crate) mod mapping;
pub(crate) mod pattern;
pub(crate) mod striping;
pub(crate) mod surveying;
pub(crate) mod tiling;

pub use averaging::{average_maps, change_of_drift};
pub use corrected::{CorrectedImage, corrected_images, nominal_geometry, on_grid};
pub use domain_mapping::domains_of_scan;
pub use mapping::{LineMap, MapError, MapMethod, map_grain, map_scan};
pub use pattern::{MappedPattern, pattern_of_scan};
pub use striping::{ScanStripes, StripeError, stripes_in_short, stripes_of_scan};
pub use surveying::{ReadBlock, SurveyError, SurveyPlan};

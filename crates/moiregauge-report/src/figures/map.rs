//! Maps as figures: one quantity each, in sample coordinates, nodes that are not to be believed left blank.

use moiregauge::map::TwistStrainMap;

use super::figure::{Drawing, Figure};
use super::subject::MapSubject;
use super::{
    map_domains, map_fields, map_histograms, map_image, map_mask, map_pattern, map_profiles,
};
use crate::draw::colormap::ColorMap;
use crate::map_details::MapDetails;

type Draw = fn(&MapSubject) -> Result<Drawing, String>;

/// The image first, then the maps; what was asked of them is drawn in a figure of its own.
const ALL: [(&str, &str, Draw); 13] = [
    ("map-image", "Image", map_image::draw),
    (
        "map-undistorted",
        "Undistorted image",
        map_pattern::undistorted,
    ),
    ("map-cell", "Averaged moiré cell", map_pattern::cell),
    ("map-twist", "Twist", map_fields::twist),
    ("map-strain", "Heterostrain", map_fields::strain),
    (
        "map-overlays",
        "Twist with regions, areas for devices and lines",
        map_fields::overlays,
    ),
    ("map-wavelength", "Wavelength", map_fields::wavelength),
    ("map-displacement", "Displacement", map_fields::displacement),
    (
        "map-histograms",
        "Distribution of twist and strain",
        map_histograms::draw,
    ),
    (
        "map-twist-sigma",
        "Error of the twist",
        map_fields::twist_sigma,
    ),
    ("map-domains", "Domains", map_domains::draw),
    ("map-mask", "Mask", map_mask::draw),
    ("map-profiles", "Line profiles", map_profiles::draw),
];

/// The figures of a map, drawn or with the reason why not.
pub fn map_figures(map: &TwistStrainMap, details: &MapDetails, colours: ColorMap) -> Vec<Figure> {
    ALL.into_iter()
        .map(|(name, title, draw)| Figure {
            name: name.to_owned(),
            set: None,
            title,
            drawing: draw(&MapSubject {
                id: name,
                map,
                details,
                colours,
            }),
        })
        .collect()
}

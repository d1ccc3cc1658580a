//! Scans that were analysed → their nodes and triangles on the sample, at small angles.

use nalgebra::Matrix2;
use spmfile::Scan;

use crate::campaign::analysis::ScanAnalysis;
use crate::domains::cells::DomainMap;
use crate::domains::mesh::Mesh;
use crate::domains::nodes::{Contrast, find_nodes};
use crate::frame::background::remove_background;
use crate::frame::geometry::Geometry;
use crate::frame::image::Image;
use crate::scan::channel::{channels, image_of};
use crate::settings::knobs::Settings;
use crate::survey::mapping::{drifted, pitch, place_of, still};

/// The domain structure of every image behind `analysed` that shows one, drift and sensors taken into account;
/// `origin` as for [`crate::survey::mapping::map_scan`].
pub fn domains_of_scan(
    scan: &Scan,
    analysed: &ScanAnalysis,
    origin: Option<f64>,
    settings: &Settings,
    contrast: Contrast,
) -> Vec<DomainMap> {
    let channels = channels(scan, settings).unwrap_or_default();
    let of_channel = |channel: &spmfile::Channel| {
        let (place, found) = place_of(scan, channel, analysed, settings)?;
        let pitch = pitch(&place.geometry);
        let mut placed = still(&place, found, analysed).unwrap_or(place.geometry);
        placed.origin -= drifted(analysed, origin);
        domains_of(
            &image_of(channel),
            &found.pixels.basis,
            pitch,
            &placed,
            settings,
            contrast,
        )
    };
    channels.into_iter().filter_map(of_channel).collect()
}

/// The domain structure of an image with the lattice `pixels` and pixels of this pitch (nm), which are `placed` on the
/// sample.
pub(crate) fn domains_of(
    image: &Image,
    pixels: &Matrix2<f64>,
    pitch: [f64; 2],
    placed: &Geometry,
    settings: &Settings,
    contrast: Contrast,
) -> Option<DomainMap> {
    let flat = remove_background(image, settings.background);
    let found = find_nodes(&flat, pixels, pitch, contrast)?;
    let places: Vec<_> = found.nodes.iter().map(|n| n.place).collect();
    let mesh = Mesh::new(&places, pixels);
    let (layers, convention) = (settings.bilayer(), settings.strain_convention);
    DomainMap::new(&found, &mesh, placed, layers, convention)?.ok()
}

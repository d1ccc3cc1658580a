//! What a map shows of its pattern: `displacement.csv`, `cell.csv`, and both as arrays beside the undistorted image.

use moiregauge::map::{MeanCell, Plane, RegistryMap, TwistStrainMap};
use moiregauge::survey::MappedPattern;
use nalgebra::Vector2;
use spmfile::{Channel, Samples, Scan, Span};

use super::columns::columns;
use super::csv::{Column, number};

/// A node with what is known of it.
pub(super) struct NodeOfField<'a> {
    map: &'a TwistStrainMap,
    registry: &'a RegistryMap,
    node: usize,
}

/// What stands at the head of `displacement.csv` in `columns.md`.
pub(super) const FIELD_ABOUT: &str = "One row per node of the map, row by row, on a regular grid; units nm, x to the right, y up. \
An empty field means: the phase of the pattern could not be followed there, or the node is bad (`mask` is not 0).

- **Displacement** u: the pattern is seen at r where the mean lattice has it at r − u.
- **Registry** d: how far the atoms of layer 2 stand from those of layer 1 at r, in the sense of `layer 2 minus layer 1`, up to a \
lattice vector of layer 1. With the waves of the moiré, `b₂ − b₁`, its phases are `φᵢ = −b₁ᵢ·d`, so that \
`d = −Σ aᵢ φᵢ/2π = −A L⁻¹ (r − u − r₀)`; for layers `a₂ = F a₁` it is `r − F⁻¹ r`. It is continuous where phases are followed, and no whole \
lattice vector is taken off.
- **Frame**: a₁, a₂ (A), the moiré vectors of the same names (L) and r₀ stand under `details.registry` in `map.json`. Layer 1 is \
taken as perfect, with the orientation α of the mean lattice; an error of α turns the whole field.
- **Gauge**: d is zero at r₀, a node of the pattern (where its waves add up most strongly, bright or dark). That is a convention and \
no measurement: which stacking a node has, an image of the moiré does not tell.
- **Sign**: a moiré knows its layers up to their exchange; with the twist that is reported as positive d has this sign, with the \
layers exchanged the other one.
- **Errors** are those of the phases by image noise; neighbouring nodes are not independent. What all nodes share is not in them: \
drift, calibration of the scanner, lattice constant, α.";

fn shown(value: f32) -> String {
    if value.is_finite() {
        format!("{value:?}")
    } else {
        String::new()
    }
}

fn value(plane: &Plane, row: &NodeOfField) -> String {
    shown(if row.is_known() {
        plane.value[row.node]
    } else {
        f32::NAN
    })
}

fn sigma(plane: &Plane, row: &NodeOfField) -> String {
    shown(if row.is_known() {
        plane.sigma[row.node]
    } else {
        f32::NAN
    })
}

impl<'a> NodeOfField<'a> {
    pub(super) const COLUMNS: &'a [Column<Self>] = columns! {
        "column", "number of the node in its row, from 0", |r| (r.node % r.map.grid.size[0]).to_string();
        "row", "number of the row, from 0", |r| (r.node / r.map.grid.size[0]).to_string();
        "x_nm", "place of the node, to the right", |r| r.place(0);
        "y_nm", "place of the node, up", |r| r.place(1);
        "mask", "0: good; else why not, by the numbers of `masks` in `map.json`", |r| (r.map.mask[r.node] as u8).to_string();
        "displacement_x_nm", "displacement of the pattern from the mean lattice", |r| value(&r.map.displacement[0], r);
        "displacement_x_sigma_nm", "its σ", |r| sigma(&r.map.displacement[0], r);
        "displacement_y_nm", "the same along y", |r| value(&r.map.displacement[1], r);
        "displacement_y_sigma_nm", "its σ", |r| sigma(&r.map.displacement[1], r);
        "registry_x_nm", "registry of layer 2 against layer 1", |r| value(&r.registry.registry[0], r);
        "registry_x_sigma_nm", "its σ", |r| sigma(&r.registry.registry[0], r);
        "registry_y_nm", "the same along y", |r| value(&r.registry.registry[1], r);
        "registry_y_sigma_nm", "its σ", |r| sigma(&r.registry.registry[1], r);
        "registry_covariance_nm2", "covariance of its two components", |r| shown(r.registry.covariance[r.node]);
        "registry_a1", "the registry in vectors of layer 1: share of a₁ (its fraction is the place in the cell of stackings)", |r| value(&r.registry.shares[0], r);
        "registry_a1_sigma", "its σ", |r| sigma(&r.registry.shares[0], r);
        "registry_a2", "share of a₂", |r| value(&r.registry.shares[1], r);
        "registry_a2_sigma", "its σ", |r| sigma(&r.registry.shares[1], r);
    };

    pub(super) fn all(map: &'a TwistStrainMap, registry: &'a RegistryMap) -> Vec<Self> {
        let row = |node| Self {
            map,
            registry,
            node,
        };
        (0..map.grid.len()).map(row).collect()
    }

    fn is_known(&self) -> bool {
        self.registry.registry[0].value[self.node].is_finite()
    }

    fn place(&self, axis: usize) -> String {
        number(Some(self.map.grid.place(self.node)[axis]))
    }
}

/// A bin of the averaged cell.
pub(super) struct Bin<'a> {
    cell: &'a MeanCell,
    bin: usize,
}

/// What stands at the head of `cell.csv` in `columns.md`.
pub(super) const BIN_ABOUT: &str = "One row per bin of the averaged moiré cell: all pixels of the first image put by their local \
phases into one cell of the mean lattice, whose corners are nodes of the pattern. Values have the unit of the channel \
(`details.pattern` in `map.json`), the background is taken off. Errors are seen from how the cells of the image scatter about their \
mean; what is the same in all cells is not in them.";

impl<'a> Bin<'a> {
    pub(super) const COLUMNS: &'a [Column<Self>] = columns! {
        "bin_1", "number of the bin along L₁, from 0", |r| (r.bin % r.cell.bins).to_string();
        "bin_2", "number of the bin along L₂", |r| (r.bin / r.cell.bins).to_string();
        "share_1", "its middle, as a share of L₁", |r| number(Some(r.cell.share(r.bin).x));
        "share_2", "as a share of L₂", |r| number(Some(r.cell.share(r.bin).y));
        "x_nm", "its middle, from the corner of the cell, to the right", |r| number(Some(r.place().x));
        "y_nm", "the same, up", |r| number(Some(r.place().y));
        "mean", "mean of its pixels, unit of the channel", |r| known(r.cell.mean[r.bin]);
        "sigma", "standard error of the mean", |r| known(r.cell.sigma[r.bin]);
        "pixels", "number of its pixels", |r| r.cell.pixels[r.bin].to_string();
        "cells", "number of moiré cells of the image that have pixels in it", |r| r.cell.cells[r.bin].to_string();
    };

    pub(super) fn all(cell: &'a MeanCell) -> Vec<Self> {
        (0..cell.mean.len()).map(|bin| Self { cell, bin }).collect()
    }

    fn place(&self) -> Vector2<f64> {
        self.cell.vectors * self.cell.share(self.bin)
    }
}

fn known(value: f64) -> String {
    number(value.is_finite().then_some(value))
}

fn channel(name: &str, unit: &str, [columns, rows]: [usize; 2], values: Vec<f64>) -> Channel {
    Channel {
        name: name.to_owned(),
        internal_name: String::new(),
        unit: unit.to_owned(),
        line_direction: None,
        scan_line: None,
        rows,
        columns,
        width_nm: None,
        height_nm: None,
        span: Span::PixelEdges,
        scale: 1.0,
        offset: 0.0,
        scaling: "computed".to_owned(),
        plane_fit: None,
        samples: Samples::F64(values),
    }
}

/// The undistorted image as a scan of one channel of this name in the axes of the laboratory.
pub fn undistorted_scan(pattern: &MappedPattern, name: &str) -> Scan {
    let shown = &pattern.undistorted;
    let size = [shown.image.columns, shown.image.rows];
    let [width, height] = size.map(|n| n as f64 * shown.pitch);
    let half = |n: usize| 0.5 * shown.pitch * (n as f64 - 1.0);
    let values = shown.image.values.clone();
    Scan {
        format: "moiregauge map".to_owned(),
        offset_nm: [
            shown.origin.x + half(size[0]),
            shown.origin.y + half(size[1]),
        ],
        size_nm: Some([width, height]),
        channels: vec![Channel {
            width_nm: Some(width),
            height_nm: Some(height),
            scaling: "resampled".to_owned(),
            ..channel(name, &pattern.unit, size, values)
        }],
        ..Scan::default()
    }
}

/// The averaged cell as a scan, if there is one: rows and columns are bins along L₂ and L₁; places and shares are channels of their own.
pub fn cell_scan(pattern: &MappedPattern) -> Option<Scan> {
    let cell = pattern.cell.as_ref()?;
    let bins = 0..cell.mean.len();
    let of = |value: &dyn Fn(usize) -> f64| bins.clone().map(value).collect::<Vec<f64>>();
    let unit = pattern.unit.as_str();
    let all = [
        ("mean", unit, cell.mean.clone()),
        ("sigma", unit, cell.sigma.clone()),
        ("pixels", "", of(&|b| f64::from(cell.pixels[b]))),
        ("cells", "", of(&|b| f64::from(cell.cells[b]))),
        ("share 1", "", of(&|b| cell.share(b).x)),
        ("share 2", "", of(&|b| cell.share(b).y)),
        (
            "position x",
            "nm",
            of(&|b| (cell.vectors * cell.share(b)).x),
        ),
        (
            "position y",
            "nm",
            of(&|b| (cell.vectors * cell.share(b)).y),
        ),
    ];
    let channels = all.map(|(name, unit, values)| channel(name, unit, [cell.bins; 2], values));
    Some(Scan {
        format: "moiregauge map".to_owned(),
        channels: channels.into(),
        ..Scan::default()
    })
}

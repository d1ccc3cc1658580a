//! `domains.csv` and `nodes.csv`: the domain structure of a map.

use heterostrain::strain::TwistStrain;
use moiregauge::domains::{DomainCell, DomainMap};
use nalgebra::{Matrix2, Vector2};

use super::columns::columns;
use super::csv::{Column, number};

/// A triangle and its corners.
pub(super) struct CellRow {
    number: usize,
    cell: DomainCell,
    corners: [Vector2<f64>; 3],
}

impl CellRow {
    pub(super) fn new(map: &DomainMap, number: usize) -> Self {
        let cell = map.cells[number];
        Self {
            number: number + 1,
            cell,
            corners: cell.nodes.map(|n| map.nodes[n]),
        }
    }
}

const DEGREE: f64 = 180.0 / std::f64::consts::PI;

fn of(row: &CellRow, value: fn(&TwistStrain) -> f64, factor: f64) -> String {
    let found = row.cell.twist_strain.as_ref().map(value);
    number(found.filter(|v| v.is_finite()).map(|v| factor * v))
}

fn corner(row: &CellRow, n: usize, axis: usize) -> String {
    number(Some(row.corners[n][axis]))
}

pub(super) const CELL: &[Column<CellRow>] = columns! {
    "triangle", "number", |r| r.number.to_string();
    "centre_x_nm", "middle", |r| number(Some(r.cell.centre.x));
    "centre_y_nm", "middle", |r| number(Some(r.cell.centre.y));
    "node_1", "number of its first node, from 1", |r| (r.cell.nodes[0] + 1).to_string();
    "node_2", "second node", |r| (r.cell.nodes[1] + 1).to_string();
    "node_3", "third node", |r| (r.cell.nodes[2] + 1).to_string();
    "node_1_x_nm", "place of the first node", |r| corner(r, 0, 0);
    "node_1_y_nm", "place of the first node", |r| corner(r, 0, 1);
    "node_2_x_nm", "place of the second node", |r| corner(r, 1, 0);
    "node_2_y_nm", "place of the second node", |r| corner(r, 1, 1);
    "node_3_x_nm", "place of the third node", |r| corner(r, 2, 0);
    "node_3_y_nm", "place of the third node", |r| corner(r, 2, 1);
    "twist_deg", "twist", |r| of(r, |t| t.twist, DEGREE);
    "twist_sigma_deg", "its σ; triangles with a common node have correlated errors", |r| of(r, |t| t.twist().sigma, DEGREE);
    "strain_percent", "magnitude of the strain, bias of noise removed", |r| of(r, |t| t.heterostrain().value, 100.0);
    "strain_sigma_percent", "its σ", |r| of(r, |t| t.heterostrain().sigma, 100.0);
    "strain_axis_lab_deg", "axis of the strain from x, where it is significant", |r| of(r, |t| t.axis_lab().map_or(f64::NAN, |a| a.value), DEGREE);
    "strain_1_percent", "ε cos 2φ", |r| of(r, |t| t.strain_vector.x, 100.0);
    "strain_1_sigma_percent", "its σ", |r| of(r, |t| t.strain().covariance.m11.sqrt(), 100.0);
    "strain_2_percent", "ε sin 2φ", |r| of(r, |t| t.strain_vector.y, 100.0);
    "strain_2_sigma_percent", "its σ", |r| of(r, |t| t.strain().covariance.m22.sqrt(), 100.0);
};

/// A node with its number.
pub(super) struct NodeRow {
    number: usize,
    place: Vector2<f64>,
    covariance: Matrix2<f64>,
    index: Option<[i32; 2]>,
    extra: bool,
}

impl NodeRow {
    pub(super) fn new(map: &DomainMap, number: usize) -> Self {
        Self {
            number: number + 1,
            place: map.nodes[number],
            covariance: map.covariances[number],
            index: map.indices[number],
            extra: map.extra.contains(&number),
        }
    }
}

fn index(row: &NodeRow, i: usize) -> String {
    row.index.map_or_else(String::new, |hk| hk[i].to_string())
}

pub(super) const NODE: &[Column<NodeRow>] = columns! {
    "node", "number, as in `domains.csv`", |r| r.number.to_string();
    "x_nm", "place", |r| number(Some(r.place.x));
    "y_nm", "place", |r| number(Some(r.place.y));
    "x_sigma_nm", "its σ, without any offset that all nodes share", |r| number(Some(r.covariance.m11.sqrt()));
    "y_sigma_nm", "its σ", |r| number(Some(r.covariance.m22.sqrt()));
    "covariance_xy_nm2", "covariance of x and y", |r| number(Some(r.covariance.m12));
    "h", "index on the lattice, from a node of its part of the mesh; empty for nodes in no triangle", |r| index(r, 0);
    "k", "index on the lattice", |r| index(r, 1);
    "extra", "`yes`: inside the mesh, but fits into no triangle", |r| if r.extra { "yes" } else { "no" }.to_owned();
};

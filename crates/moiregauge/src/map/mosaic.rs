//! Finished maps of a survey, or of grains → one map, each where it lies.

use nalgebra::{Matrix2, Vector2};

use crate::map::nodes::Grid;
use crate::map::quantities::TwistStrainMap;
use crate::window::mask::Mask;

impl TwistStrainMap {
    /// Puts maps side by side on one square grid along the axes of the laboratory, as fine as the first.
    /// Every place takes the nearest node of the map that has the best mask there, and of equals the first: nothing is
    /// averaged or interpolated. Places that no map covers are margin. `None` of none.
    pub fn side_by_side(mut maps: Vec<Self>) -> Option<Self> {
        if maps.len() < 2 {
            return maps.pop();
        }
        Some(put_together(maps)?.0)
    }

    /// The same of the maps of grains that lie side by side, each with its number, which each good node then has. Displacements count from
    /// the mean lattice of a grain and do not go on in another: there are none.
    pub fn of_grains(maps: Vec<(u8, Self)>) -> Option<Self> {
        let (numbers, maps): (Vec<u8>, Vec<Self>) = maps.into_iter().unzip();
        let (mut all, taken) = put_together(maps)?;
        let grain = |(taken, mask): (&Option<usize>, &Mask)| match taken {
            Some(map) if *mask == Mask::Good => numbers[*map],
            _ => 0,
        };
        all.grain = taken.iter().zip(&all.mask).map(grain).collect();
        for plane in &mut all.displacement {
            plane.value.fill(f32::NAN);
            plane.sigma.fill(f32::NAN);
        }
        Some(all)
    }
}

/// The maps on one grid, and which of them each node is of.
fn put_together(mut maps: Vec<TwistStrainMap>) -> Option<(TwistStrainMap, Vec<Option<usize>>)> {
    let first = maps.first()?;
    let step = first.grid.step.determinant().abs().sqrt();
    let corners = maps.iter().flat_map(|map| {
        let [columns, rows] = map.grid.size.map(|n| n.max(1) as f64 - 1.0);
        [(0.0, 0.0), (columns, 0.0), (0.0, rows), (columns, rows)]
            .map(|(c, r)| map.grid.origin + map.grid.step * Vector2::new(c, r))
    });
    let beyond = Vector2::repeat(f64::INFINITY);
    let (low, high) = corners.fold((beyond, -beyond), |(low, high): (Vector2<f64>, _), c| {
        (low.inf(&c), high.sup(&c))
    });
    let size = [0, 1].map(|i| ((high - low)[i] / step + 0.5).floor() as usize + 1);
    let grid = Grid {
        size,
        origin: low,
        step: Matrix2::identity() * step,
    };
    let inverses: Vec<Matrix2<f64>> = maps
        .iter()
        .map(|map| map.grid.step.try_inverse())
        .collect::<Option<_>>()?;
    // Map and node that each place takes.
    let taken: Vec<Option<(usize, usize)>> = (0..grid.len())
        .map(|node| {
            let place = grid.place(node);
            let seen = maps.iter().zip(&inverses).enumerate();
            let seen = seen.filter_map(|(m, (map, inverse))| {
                let t = (inverse * (place - map.grid.origin)).map(|x| (x + 0.5).floor());
                let [columns, rows] = map.grid.size.map(|n| n as f64);
                let inside = t.x >= 0.0 && t.y >= 0.0 && t.x < columns && t.y < rows;
                inside.then(|| (m, t.y as usize * map.grid.size[0] + t.x as usize))
            });
            seen.min_by_key(|&(m, n)| maps[m].mask[n])
        })
        .collect();
    let mut out = TwistStrainMap::empty(grid, first.window_nm);
    out.grid = grid;
    let mask = |t: &Option<(usize, usize)>| t.map_or(Mask::Margin, |(m, n)| maps[m].mask[n]);
    out.mask = taken.iter().map(mask).collect();
    let planes: Vec<Vec<&mut Vec<f32>>> = maps.iter_mut().map(TwistStrainMap::planes_mut).collect();
    for (i, plane) in out.planes_mut().into_iter().enumerate() {
        let value = |t: &Option<(usize, usize)>| t.map_or(f32::NAN, |(m, n)| planes[m][i][n]);
        *plane = taken.iter().map(value).collect();
    }
    Some((out, taken.into_iter().map(|t| t.map(|(m, _)| m)).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A map of `columns` × 2 nodes whose twist is `value` + the column.
    fn map(columns: usize, origin: f64, value: f32, mask: Mask) -> TwistStrainMap {
        let grid = Grid {
            size: [columns, 2],
            origin: Vector2::new(origin, 0.0),
            step: Matrix2::identity() * 2.0,
        };
        let mut map = TwistStrainMap::empty(grid, 5.0);
        map.grid = grid;
        map.mask = vec![mask; 2 * columns];
        for plane in map.planes_mut() {
            *plane = (0..2 * columns)
                .map(|n| value + (n % columns) as f32)
                .collect();
        }
        map
    }

    #[test]
    fn maps_lie_side_by_side() {
        // From 0 to 6 nm, from 4.2 to 8.2 nm with a better mask, and from 12 nm on.
        let maps = vec![
            map(4, 0.0, 10.0, Mask::Weak),
            map(3, 4.2, 20.0, Mask::Good),
            map(2, 12.0, 30.0, Mask::Good),
        ];
        let all = TwistStrainMap::side_by_side(maps).unwrap();
        assert_eq!(all.grid.size, [8, 2]);
        let expected = [10.0, 11.0, 20.0, 21.0, 22.0, f32::NAN, 30.0, 31.0];
        for (found, expected) in all.twist.value.iter().zip(expected.repeat(2)) {
            assert!(
                *found == expected || found.is_nan() && expected.is_nan(),
                "{:?}",
                all.twist.value
            );
        }
        assert_eq!(all.mask[..3], [Mask::Weak, Mask::Weak, Mask::Good]);
        assert_eq!(all.mask[5], Mask::Margin);
        assert!(all.grain.is_empty());
    }

    #[test]
    fn grains_are_numbered_where_they_are_good() {
        let maps = vec![
            (1, map(4, 0.0, 10.0, Mask::Good)),
            (3, map(3, 4.2, 20.0, Mask::Good)),
            (4, map(2, 12.0, 30.0, Mask::Weak)),
        ];
        let all = TwistStrainMap::of_grains(maps).unwrap();
        // Where two are good the first is taken.
        assert_eq!(all.grain, [1, 1, 1, 1, 3, 0, 0, 0].repeat(2));
        assert!(
            all.displacement
                .iter()
                .all(|p| p.value.iter().all(|u| u.is_nan()))
        );
        assert_eq!(all.twist.value[3..5], [13.0, 22.0]);
    }
}

//! Places in nm as they are typed: lengths, regions, lines.

use moiregauge::region::Region;
use moiregauge_pipeline::maps::Line;
use nalgebra::Vector2;
use spmfile::length_nm;

use crate::numbers;

/// A length in nm, with or without a unit.
pub(crate) fn length(text: &str) -> Option<f64> {
    let text = text.trim();
    let nm = text.parse().ok().or_else(|| length_nm(text))?;
    numbers::within([-1e9, 1e9], Some(nm))
}

fn named(text: &str) -> Option<(&str, &str)> {
    let (name, rest) = text.split_once('=')?;
    (!name.trim().is_empty()).then_some((name.trim(), rest))
}

/// A box or a polygon with a name.
pub(crate) fn parse_region(text: &str) -> Result<Region, String> {
    let expected = "expected a name and, in nm, a box or the corners of a polygon, as in bar=10,20,80,40 (lower left \
                    corner, width, height) or 'flake=0,0 100,10 60,80'";
    let (name, rest) = named(text).ok_or(expected)?;
    let numbers: Option<Vec<f64>> = rest.split(',').map(length).collect();
    if let Some(&[x, y, w, h]) = numbers.as_deref() {
        if !(w > 0.0 && h > 0.0) {
            return Err(format!(
                "width and height of a box must be above 0, found {w} and {h} nm"
            ));
        }
        return Ok(Region::rectangle(name, Vector2::new(x, y), [w, h]));
    }
    let corners = places(rest).ok_or(expected)?;
    if corners.len() < 3 {
        return Err(format!(
            "a polygon needs at least three corners, found {}; {expected}",
            corners.len()
        ));
    }
    let region = Region {
        name: name.to_owned(),
        corners,
    };
    if region.crosses_itself() || !(region.area() > 0.0) {
        return Err(
            "the polygon has no area, or its sides cross each other. Give its corners in order"
                .to_owned(),
        );
    }
    Ok(region)
}

fn places(text: &str) -> Option<Vec<Vector2<f64>>> {
    let place = |text: &str| {
        let (x, y) = text.split_once(',')?;
        Some(Vector2::new(length(x)?, length(y)?))
    };
    text.split([' ', ';'])
        .filter(|t| !t.is_empty())
        .map(place)
        .collect()
}

/// A line with a name.
pub(crate) fn parse_line(text: &str) -> Result<Line, String> {
    let parsed = || {
        let (name, rest) = named(text)?;
        let [a, b] = places(rest)?[..] else {
            return None;
        };
        (a != b).then(|| Line {
            name: name.to_owned(),
            ends: [a, b],
        })
    };
    parsed()
        .ok_or_else(|| "expected a name and two places in nm, as in 'cut=0,0 100,80'".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_and_lines_in_words() {
        let region = parse_region("a b=1um,-20nm,3,4.5").expect("a box");
        assert_eq!(region.name, "a b");
        assert!((region.area() - 13.5).abs() < 1e-9);
        assert!((region.corners[0] - Vector2::new(1000.0, -20.0)).norm() < 1e-9);
        let triangle = parse_region("t=0,0 4,0 0nm,2").expect("a triangle");
        assert!((triangle.area() - 4.0).abs() < 1e-12);
        let line = parse_line("cut=0,0 3,4").expect("a line");
        assert!(((line.ends[1] - line.ends[0]).norm() - 5.0).abs() < 1e-12);
        for wrong in [
            "1,2,3,4",
            "a=1,2,3",
            "a=1,2,0,4",
            "=1,2,3,4",
            "a=1,2,x,4",
            "a=1,2,1V,4",
            "t=0,0 1,1",
            "t=0,0 1,1 2,2",
            "bow=0,0 2,2 2,0 0,2",
        ] {
            assert!(parse_region(wrong).is_err(), "{wrong}");
        }
        let error = parse_region("t=0,0 1,1").unwrap_err();
        assert!(error.contains("at least three corners, found 2"), "{error}");
        assert!(parse_line("l=0,0 0,0").is_err() && parse_line("l=0,0").is_err());
    }
}

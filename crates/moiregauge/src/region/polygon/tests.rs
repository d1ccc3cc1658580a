use super::*;

/// Area and inside of a polygon that is not convex: an L of three unit squares.
#[test]
fn polygons_have_an_inside() {
    let corners = [
        (0.0, 0.0),
        (2.0, 0.0),
        (2.0, 1.0),
        (1.0, 1.0),
        (1.0, 2.0),
        (0.0, 2.0),
    ];
    let region = Region {
        name: "L".to_owned(),
        corners: corners.map(|(x, y)| Vector2::new(x, y)).to_vec(),
    };
    assert!((region.area() - 3.0).abs() < 1e-12);
    for (x, y, inside) in [
        (0.5, 0.5, true),
        (1.5, 0.5, true),
        (1.5, 1.5, false),
        (0.5, 1.5, true),
    ] {
        assert_eq!(region.contains(Vector2::new(x, y)), inside);
    }
}

/// A bow tie crosses itself; a triangle, a box and a polygon that is not convex do not.
#[test]
fn bow_ties_cross_themselves() {
    let of = |corners: &[[f64; 2]]| Region {
        name: String::new(),
        corners: corners.iter().map(|c| Vector2::from(*c)).collect(),
    };
    assert!(of(&[[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0]]).crosses_itself());
    for plain in [
        of(&[[0.0, 0.0], [2.0, 0.0], [1.0, 3.0]]),
        of(&[[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]),
        of(&[[0.0, 0.0], [2.0, 0.0], [1.0, 0.5], [0.0, 2.0]]),
    ] {
        assert!(!plain.crosses_itself(), "{plain:?}");
    }
}

//! What is told by hand of one image.

use nalgebra::Vector2;

use crate::frame::image::Image;
use crate::frame::polygon;
use crate::lattice::by_hand::Meant;
use crate::scan::measured::MeasureError;
use crate::settings::by_hand::ByHand;

pub(crate) fn meant(told: &ByHand) -> Meant {
    match (told.lattice(), told.near_nm) {
        (Some(basis), _) => Meant::Vectors(basis),
        (None, Some(near)) => Meant::Wavelength(near),
        (None, None) => Meant::Any,
    }
}

/// Takes the pixels out that are not to be used.
pub(crate) fn leave_out(
    image: &mut Image,
    size_nm: Option<[f64; 2]>,
    told: &ByHand,
) -> Result<(), MeasureError> {
    let (columns, rows) = (image.columns, image.rows);
    if let Some(mask) = &told.mask {
        if (mask.columns, mask.rows) != (columns, rows) {
            return Err(MeasureError::OtherMask {
                mask: [mask.columns, mask.rows],
                image: [columns, rows],
            });
        }
        for (value, used) in image.values.iter_mut().zip(mask.used()) {
            if !used {
                *value = f64::NAN;
            }
        }
    }
    if told.regions_nm.is_empty() {
        return Ok(());
    }
    let size = size_nm.ok_or(MeasureError::NoSize)?;
    let regions: Vec<Vec<Vector2<f64>>> = (told.regions_nm.iter())
        .map(|corners| corners.iter().map(|c| Vector2::from(*c)).collect())
        .collect();
    for (i, value) in image.values.iter_mut().enumerate() {
        let middle = Vector2::new((i % columns) as f64 + 0.5, (i / columns) as f64 + 0.5);
        let place = Vector2::new(
            middle.x * size[0] / columns as f64,
            middle.y * size[1] / rows as f64,
        );
        if !regions.iter().any(|r| polygon::contains(r, place)) {
            *value = f64::NAN;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What of a frame of two columns and three rows, 20 nm × 60 nm, is used; row 0 is the bottom line.
    fn used(told: &ByHand) -> Vec<bool> {
        let mut image = Image::new(3, 2, vec![1.0; 6]);
        leave_out(&mut image, Some([20.0, 60.0]), told).unwrap();
        image.values.iter().map(|v| v.is_finite()).collect()
    }

    /// Regions are counted from the lower left corner, x along the lines; masks row by row from the bottom.
    #[test]
    fn parts_lie_where_they_were_told() {
        let region = |corners: [[f64; 2]; 4]| ByHand {
            regions_nm: vec![corners.to_vec()],
            ..ByHand::default()
        };
        let lowest = region([[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0]]);
        assert_eq!(used(&lowest), [true, true, false, false, false, false]);
        let right = region([[10.0, 0.0], [20.0, 0.0], [20.0, 60.0], [10.0, 60.0]]);
        assert_eq!(used(&right), [false, true, false, true, false, true]);
        let pixels = [false, false, false, true, true, true];
        let masked = ByHand {
            mask: Some(crate::settings::Mask::new(2, 3, &pixels)),
            ..ByHand::default()
        };
        assert_eq!(used(&masked), pixels);
    }
}

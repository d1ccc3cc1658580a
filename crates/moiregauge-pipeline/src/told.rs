//! What is refused of what a user tells of files.

use moiregauge::settings::SettingsError;
use moiregauge_report::results::UserSpecified;

/// Lengths of frames, nm: from a thousandth of an atom to a centimetre.
const LENGTH_NM: [f64; 2] = [1e-3, 1e7];
/// Lines per second.
const LINE_RATE_HZ: [f64; 2] = [1e-4, 1e5];
/// Angles, degrees.
const ANGLE_DEG: [f64; 2] = [-3600.0, 3600.0];

/// Refuses what no file can be like: lengths, rates and angles beyond any instrument, blocks without pixels.
///
/// # Errors
/// The first of them, by its name.
pub fn check_user_specified(told: &UserSpecified) -> Result<(), SettingsError> {
    let [width, height] = told.size_nm.map_or([None; 2], |size| size.map(Some));
    for (setting, value, [low, high]) in [
        ("size_nm", width, LENGTH_NM),
        ("size_nm", height, LENGTH_NM),
        ("line_rate_hz", told.line_rate_hz, LINE_RATE_HZ),
        ("rotation_deg", told.rotation_deg, ANGLE_DEG),
    ] {
        if let Some(value) = value.filter(|value| !(low..=high).contains(value)) {
            return Err(SettingsError {
                setting,
                reason: format!("{setting} must lie between {low} and {high}, found {value}"),
            });
        }
    }
    if told
        .crop
        .is_some_and(|crop| crop.columns == 0 || crop.rows == 0)
    {
        return Err(SettingsError {
            setting: "crop",
            reason: "expected a block of at least one column and one row, found an empty one"
                .to_owned(),
        });
    }
    if told.x_sensor.is_some() != told.y_sensor.is_some() {
        return Err(SettingsError {
            setting: "x_sensor",
            reason: "expected the names of both position sensors, found only one".to_owned(),
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nonsense_is_refused_by_its_name() {
        assert_eq!(check_user_specified(&UserSpecified::default()), Ok(()));
        let refused = |told: UserSpecified| check_user_specified(&told).unwrap_err().setting;
        let size = |size_nm| UserSpecified {
            size_nm: Some(size_nm),
            ..UserSpecified::default()
        };
        assert_eq!(check_user_specified(&size([70.0, 70.0])), Ok(()));
        for wrong in [
            [f64::NAN, 1.0],
            [1.0, -1.0],
            [0.0, 1.0],
            [f64::INFINITY, 1.0],
        ] {
            assert_eq!(refused(size(wrong)), "size_nm");
        }
        let rate = UserSpecified {
            line_rate_hz: Some(0.0),
            ..UserSpecified::default()
        };
        assert_eq!(refused(rate), "line_rate_hz");
        let sensor = UserSpecified {
            x_sensor: Some("x".to_owned()),
            ..UserSpecified::default()
        };
        assert_eq!(refused(sensor), "x_sensor");
    }
}

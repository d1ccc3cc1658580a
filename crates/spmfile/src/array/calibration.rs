//! Steps of the pixels of TIFF pictures, as image programs for microscopes write them.
//!
//! `ImageJ` writes lines `key=value` with the `unit` of length, and pixels per unit as the resolution; OME writes
//! `PhysicalSizeX` and its unit (µm where none stands) as attributes of XML. A resolution by itself is that of a print.

use crate::tiff_tags::Directory;
use crate::units::nm_per;
use crate::words::number;

const X_RESOLUTION: u16 = 282;
const Y_RESOLUTION: u16 = 283;

/// Steps in x and y by `ImageJ`, nm.
pub(super) fn imagej(description: &str, tags: &Directory<'_>) -> Option<[f64; 2]> {
    if !description.starts_with("ImageJ=") {
        return None;
    }
    let mut lines = description.lines();
    let unit = lines.find_map(|line| line.trim().strip_prefix("unit="))?;
    let nm = nm_per(&micro(unit))?;
    let [x, y] =
        [X_RESOLUTION, Y_RESOLUTION].map(|tag| tags.number(tag).map(|per_unit| nm / per_unit));
    steps(x?, y?)
}

/// Steps in x and y by OME, nm.
pub(super) fn ome(description: &str) -> Option<[f64; 2]> {
    if !description.contains("<OME") {
        return None;
    }
    let pixels = description.split("<Pixels").nth(1)?.split('>').next()?;
    let attribute = |name: &str| {
        let (_, value) = pixels.split_once(&format!(" {name}=\""))?;
        value.split('"').next()
    };
    let step = |axis: char| {
        let size = number(attribute(&format!("PhysicalSize{axis}"))?)?;
        let unit = attribute(&format!("PhysicalSize{axis}Unit")).unwrap_or("µm");
        Some(size * nm_per(&micro(unit))?)
    };
    steps(step('X')?, step('Y')?)
}

fn steps(x: f64, y: f64) -> Option<[f64; 2]> {
    let possible = |step: f64| step > 0.0 && step.is_finite();
    (possible(x) && possible(y)).then_some([x, y])
}

/// A unit with the escapes of Java and XML for µ undone.
fn micro(unit: &str) -> String {
    const ESCAPES: [&str; 6] = [
        "\\u00B5", "\\u00b5", "&#181;", "&#xB5;", "&#xb5;", "&micro;",
    ];
    ESCAPES
        .iter()
        .fold(unit.to_owned(), |unit, escape| unit.replace(escape, "µ"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cursor::Endian;
    use crate::tiff_tags::directories;
    use crate::tiff_tags::tests::{Value, file, plain};

    #[test]
    fn programs_tell_the_step() {
        let mut tags = plain(2, 4, 16);
        tags.extend([
            (X_RESOLUTION, Value::Double(0.5)),
            (Y_RESOLUTION, Value::Double(4.0)),
        ]);
        let bytes = file(Endian::Little, &[(tags, vec![vec![0; 16]])]);
        let pages = directories(&bytes).expect("a page");
        let imagej = |text: &str| imagej(text, &pages[0]);
        assert_eq!(imagej("ImageJ=1.53t\nunit=nm\n"), Some([2.0, 0.25]));
        assert_eq!(
            imagej("ImageJ=1.53t\nunit=\\u00B5m\n"),
            Some([2000.0, 250.0])
        );
        assert_eq!(imagej("ImageJ=1.53t\nunit=micron\n"), Some([2000.0, 250.0]));
        for none in [
            "ImageJ=1.53t\nunit=inch\n",
            "ImageJ=1.53t\n",
            "unit=nm\n",
            "",
        ] {
            assert_eq!(imagej(none), None, "{none}");
        }
        let ome = |pixels: &str| ome(&format!("<?xml?><OME><Image><Pixels ID=\"0\" {pixels}/>"));
        let sizes = "PhysicalSizeX=\"0.5\" PhysicalSizeY=\"0.25\"";
        assert_eq!(ome(sizes), Some([500.0, 250.0]));
        let units = "PhysicalSizeXUnit=\"nm\" PhysicalSizeYUnit=\"&#181;m\"";
        assert_eq!(ome(&format!("{sizes} {units}")), Some([0.5, 250.0]));
        for none in [
            "",
            "PhysicalSizeX=\"0.5\"",
            "PhysicalSizeX=\"-1\" PhysicalSizeY=\"1\"",
        ] {
            assert_eq!(ome(none), None, "{none}");
        }
    }
}

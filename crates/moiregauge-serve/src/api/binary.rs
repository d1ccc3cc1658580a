//! Numbers as bytes.

use axum::http::header::{self, HeaderName, HeaderValue};
use axum::response::{IntoResponse as _, Response};
use moiregauge_pipeline::view::View;

use crate::problem::{Answer, Problem};

const WIDTH: HeaderName = HeaderName::from_static("x-width");
const HEIGHT: HeaderName = HeaderName::from_static("x-height");
const UNIT: HeaderName = HeaderName::from_static("x-unit");
const PIXEL_X: HeaderName = HeaderName::from_static("x-pixel-nm-x");
const PIXEL_Y: HeaderName = HeaderName::from_static("x-pixel-nm-y");

const STEP_PER_PIXEL: HeaderName = HeaderName::from_static("x-step-per-px");
const STEP_PER_NM: HeaderName = HeaderName::from_static("x-step-per-nm");

/// An image: 32-bit numbers, the lowest byte first, row by row from the bottom; its sizes stand in headers. The unit is
/// percent-encoded.
pub(super) fn image(view: &View) -> Answer {
    let bytes: Vec<u8> = view.values.iter().flat_map(|v| v.to_le_bytes()).collect();
    let mut response: Response = bytes.into_response();
    let headers = response.headers_mut();
    let kind = HeaderValue::from_static("application/octet-stream");
    headers.insert(header::CONTENT_TYPE, kind);
    let mut put = |name: HeaderName, value: String| {
        let value = HeaderValue::try_from(value).map_err(Problem::fault)?;
        headers.insert(name, value);
        Ok::<_, Problem>(())
    };
    put(WIDTH, view.columns.to_string())?;
    put(HEIGHT, view.rows.to_string())?;
    put(UNIT, encoded(&view.unit))?;
    if let Some([x, y]) = view.pixel_nm {
        put(PIXEL_X, x.to_string())?;
        put(PIXEL_Y, y.to_string())?;
    }
    Ok(response)
}

/// A spectrum: the same, with the step of its columns and rows, periods per pixel and, with a size, per nm.
pub(super) fn spectrum(view: &View, per_pixel: [f64; 2], pixel_nm: Option<[f64; 2]>) -> Answer {
    let mut response = image(&View {
        pixel_nm: None,
        ..view.clone()
    })?;
    let pair = |[x, y]: [f64; 2]| HeaderValue::try_from(format!("{x} {y}")).map_err(Problem::fault);
    let headers = response.headers_mut();
    headers.insert(STEP_PER_PIXEL, pair(per_pixel)?);
    if let Some([x, y]) = pixel_nm {
        let per_nm = [per_pixel[0] / x, per_pixel[1] / y];
        headers.insert(STEP_PER_NM, pair(per_nm)?);
    }
    Ok(response)
}

/// Percent-encoded, for `decodeURIComponent`.
pub(super) fn encoded(text: &str) -> String {
    use std::fmt::Write as _;
    let mut all = String::new();
    for byte in text.bytes() {
        if byte.is_ascii_alphanumeric() || b"-_.~/ ".contains(&byte) {
            all.push(char::from(byte));
        } else {
            // Writing into a string cannot fail.
            let _ = write!(all, "%{byte:02X}");
        }
    }
    all
}

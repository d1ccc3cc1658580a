//! Numbers in single precision as text that reads back to the last bit: eight hexadecimal digits each.

use std::fmt::Write as _;

/// The digits of the bits.
pub(crate) fn to_text(values: impl IntoIterator<Item = f32>) -> String {
    let mut text = String::new();
    for value in values {
        // Writing into a string cannot fail.
        let _ = write!(text, "{:08x}", value.to_bits());
    }
    text
}

/// What they say; `None` where they are no such digits.
pub(crate) fn from_text(text: &str) -> Option<Vec<f32>> {
    let (digits, rest) = text.as_bytes().as_chunks::<8>();
    let number = |digits: &[u8; 8]| {
        let bits = u32::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()?;
        Some(f32::from_bits(bits))
    };
    let numbers = digits.iter().map(number).collect::<Option<Vec<f32>>>();
    numbers.filter(|_| rest.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_read_back() {
        let values = [0.0, -0.0, 1.5e-30, f32::NAN, f32::NEG_INFINITY, -7.25];
        let read = from_text(&to_text(values)).unwrap();
        assert_eq!(
            read.iter().map(|v| v.to_bits()).collect::<Vec<_>>(),
            values.map(f32::to_bits)
        );
        assert_eq!(from_text(""), Some(Vec::new()));
        for wrong in ["0", "3f80000g", "3f8000003"] {
            assert_eq!(from_text(wrong), None, "{wrong}");
        }
    }
}

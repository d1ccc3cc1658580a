//! What every fuzz target does: read the bytes if they are of its format, and check that what
//! comes out can be true. The fuzzer watches for panics, memory and time.

use spmfile::{Format, FrameDirection, ReadError, Samples, Scan};

/// The target of one reader.
#[macro_export]
macro_rules! reader {
    ($format:path) => {
        libfuzzer_sys::fuzz_target!(|data: &[u8]| -> libfuzzer_sys::Corpus {
            if $crate::check(data, $format) {
                libfuzzer_sys::Corpus::Keep
            } else {
                libfuzzer_sys::Corpus::Reject
            }
        });
    };
}

/// Reads `data`; false if they are not of the format.
///
/// # Panics
/// If what was read contradicts itself.
pub fn check(data: &[u8], format: Format) -> bool {
    if spmfile::detect(data) != format {
        return false;
    }
    let mut options = spmfile::OpenOptions::default();
    options.damaged = true;
    if let Ok(file) = spmfile::File::open_with(data, &options) {
        let frame = &file.frames()[0];
        for (number, channel) in frame.channels().enumerate() {
            let row = frame.rows(number, 0..1);
            assert!(row.is_err() || row.is_ok_and(|row| row.len() == channel.columns));
        }
    }
    match spmfile::read(data) {
        Ok(scan) => plausible(&scan),
        Err(ReadError::Incomplete { readable, .. }) => plausible(&readable),
        Err(error) => assert!(!error.to_string().is_empty()),
    }
    true
}

/// Takes an Omicron Matrix file and its log apart and reads them; false if there are no two. The first
/// byte says which frame is wanted, the next four the length of the file.
///
/// # Panics
/// As [`check`].
pub fn check_session(data: &[u8]) -> bool {
    let Some((&[choice, ref length @ ..], both)) = data.split_first_chunk::<5>() else {
        return false;
    };
    let Some((file, log)) = both.split_at_checked(u32::from_le_bytes(*length) as usize) else {
        return false;
    };
    let frame = match choice % 3 {
        0 => None,
        1 => Some(FrameDirection::Up),
        _ => Some(FrameDirection::Down),
    };
    let name = "s--1_1.Z_mtrx";
    match spmfile::matrix::read(file, &[log], name, frame, &|_| choice < 128) {
        Ok(scan) => plausible(&scan),
        Err(error) => assert!(!error.to_string().is_empty()),
    }
    true
}

fn plausible(scan: &Scan) {
    let length = |n: f64| n > 0.0 && n.is_finite();
    assert!(scan.rotation_rad.is_finite());
    assert!(scan.offset_nm.iter().all(|n| n.is_finite()));
    assert!(scan.line_rate_hz.is_none_or(length));
    for channel in &scan.channels {
        assert_eq!(channel.samples.len(), channel.rows * channel.columns);
        assert!(channel.scale.is_finite() && channel.offset.is_finite());
        assert!(channel.width_nm.is_none_or(length) && channel.height_nm.is_none_or(length));
        // Reads every sample once.
        let sum: f64 = match &channel.samples {
            Samples::I16(v) => v.iter().map(|&n| f64::from(n)).sum(),
            Samples::I32(v) => v.iter().map(|&n| f64::from(n)).sum(),
            Samples::F32(v) => v.iter().map(|&n| f64::from(n)).sum(),
            Samples::F64(v) => v.iter().sum(),
        };
        std::hint::black_box(sum);
    }
}

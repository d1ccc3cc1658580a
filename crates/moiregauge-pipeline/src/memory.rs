//! Memory: what can be had, and whether it is enough for an analysis.

use moiregauge::scan::BYTES_PER_PIXEL;
use spmfile::Scan;

/// Where the system does not tell, this much is taken for granted; WebAssembly has addresses for 4 GB, a part of which is taken.
const ASSUMED: u64 = if cfg!(target_family = "wasm") {
    3 << 30
} else {
    16 << 30
};

/// An image that the memory does not hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the analysis of {columns} × {rows} samples needs {} of memory, but only {} are free. Analyse a part of the image \
     (a crop), or make a map: maps read large images in bands",
    in_words(*needed), in_words(*available)
)]
pub struct NotEnoughMemory {
    /// Samples in a line.
    pub columns: usize,
    /// Lines.
    pub rows: usize,
    /// Bytes that the analysis takes.
    pub needed: u64,
    /// Bytes that can be had.
    pub available: u64,
}

/// Whether the images of a scan can be analysed.
///
/// # Errors
/// The largest of them takes more memory than can be had.
pub fn enough_for(scan: &Scan) -> Result<(), NotEnoughMemory> {
    enough_in(scan, available().unwrap_or(ASSUMED))
}

fn enough_in(scan: &Scan, available: u64) -> Result<(), NotEnoughMemory> {
    let largest = scan.channels.iter().max_by_key(|c| c.samples.len());
    let Some(channel) = largest else {
        return Ok(());
    };
    let needed = BYTES_PER_PIXEL.saturating_mul(channel.samples.len() as u64);
    if needed <= available {
        return Ok(());
    }
    Err(NotEnoughMemory {
        columns: channel.columns,
        rows: channel.rows,
        needed,
        available,
    })
}

/// Bytes of memory that this process can still have; `None` where the system does not tell.
///
/// The least of what is free, of the control group's limit and of the limit of the address space.
pub fn available() -> Option<u64> {
    let text = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let kilobytes = |text: &str, key: &str| field(text, key).map(|n| n.saturating_mul(1024));
    let free = kilobytes(&text("/proc/meminfo"), "MemAvailable:");
    let address_space = field(&text("/proc/self/limits"), "Max address space").map(|limit| {
        let used = kilobytes(&text("/proc/self/status"), "VmSize:").unwrap_or(0);
        limit.saturating_sub(used)
    });
    let number = |path: &str| text(path).trim().parse::<u64>().ok();
    let group = number("/sys/fs/cgroup/memory.max").map(|limit| {
        let used = number("/sys/fs/cgroup/memory.current").unwrap_or(0);
        // Pages of files are given back when they are needed.
        let pages = field(&text("/sys/fs/cgroup/memory.stat"), "inactive_file").unwrap_or(0);
        limit.saturating_sub(used.saturating_sub(pages))
    });
    [free, address_space, group].into_iter().flatten().min()
}

/// The number behind a key at the start of a line.
fn field(text: &str, key: &str) -> Option<u64> {
    let rest = text.lines().find_map(|line| line.strip_prefix(key))?;
    rest.split_whitespace().next()?.parse().ok()
}

/// Bytes as people say them.
pub(crate) fn in_words(bytes: u64) -> String {
    let bytes = bytes as f64;
    match bytes {
        b if b < 1e3 => format!("{b} bytes"),
        b if b < 1e6 => format!("{:.1} kB", b / 1e3),
        b if b < 1e9 => format!("{:.1} MB", b / 1e6),
        b => format!("{:.1} GB", b / 1e9),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_the_system() {
        let text = "MemTotal:       24000 kB\nMemAvailable:   20000 kB\n";
        assert_eq!(field(text, "MemAvailable:"), Some(20000));
        let limits =
            "Max address space         unlimited            unlimited            bytes     \n";
        assert_eq!(field(limits, "Max address space"), None);
        if cfg!(target_os = "linux") {
            assert!(available().unwrap() > 1 << 20);
        }
    }

    /// 64 × 64 samples, and memory for one less.
    #[test]
    fn what_does_not_fit_is_refused_with_numbers() {
        let mut scan = spmfile::Scan::default();
        assert!(enough_in(&scan, 0).is_ok());
        let mut array = b"\x93NUMPY\x01\0\x76\0".to_vec();
        array.extend(
            format!(
                "{:<118}",
                "{'descr': '|u1', 'fortran_order': False, 'shape': (64, 64), }"
            )
            .bytes(),
        );
        array.extend((0..64 * 64).map(|n| (n % 251) as u8));
        scan.channels = spmfile::read(&array).unwrap().channels;
        let needed = 64 * 64 * BYTES_PER_PIXEL;
        assert!(enough_in(&scan, needed).is_ok());
        let error = enough_in(&scan, needed - 1).unwrap_err();
        assert_eq!(error.needed, needed);
        let words = error.to_string();
        assert!(
            words.contains("64 × 64") && words.contains("430.1 kB"),
            "{words}"
        );
    }
}

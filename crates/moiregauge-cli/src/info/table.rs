//! The readable form: one aligned table per file.

use std::fmt::Write as _;

use moiregauge_pipeline::inspect::{ChannelInfo, FileInfo, Sample, ScanInfo};

/// The readable form of one file.
pub(super) fn table(info: &FileInfo) -> String {
    let mut text = format!("{}\n", info.file);
    let Some(scan) = &info.scan else {
        text += "  not read\n";
        return text;
    };
    // Writing to a string cannot fail.
    let _ = writeln!(text, "  {}", head_line(scan));
    let _ = writeln!(text, "  {}", frame_line(scan));
    if !scan.channels.is_empty() {
        text.push('\n');
        text += &aligned(&channel_cells(&scan.channels));
    }
    for channel in &scan.unreadable {
        let _ = writeln!(text, "  unreadable: {}: {}", channel.name, channel.error);
    }
    for note in &scan.notes {
        let _ = writeln!(text, "  note: {note}");
    }
    if scan.missing_for_analysis.is_empty() {
        text += "\n  nothing is missing for the moiré analysis\n";
    } else {
        text += "\n  missing for the moiré analysis:\n";
        for words in &scan.missing_for_analysis {
            let _ = writeln!(text, "    {words}");
        }
    }
    text
}

fn head_line(scan: &ScanInfo) -> String {
    let mut words = vec![scan.format.clone()];
    words.extend(scan.instrument.clone());
    words.extend(scan.acquired.as_ref().map(|date| date.replace('T', " ")));
    words.join(", ")
}

fn frame_line(scan: &ScanInfo) -> String {
    let number = |value: Option<f64>, unit: &str| {
        value.map_or("unknown".to_owned(), |v| format!("{}{unit}", short(v)))
    };
    let size = scan.size_nm.map_or("unknown".to_owned(), |[fast, slow]| {
        format!("{} × {} nm", short(fast), short(slow))
    });
    let closed_loop = match scan.closed_loop {
        Some(true) => "on",
        Some(false) => "off",
        None => "unknown",
    };
    format!(
        "frame {}, line rate {}, size {size}, rotation {}°, offset {}, {} nm, rounding {}, closed loop {closed_loop}",
        scan.frame_direction.unwrap_or("direction unknown"),
        number(scan.line_rate_hz, " Hz"),
        short(scan.rotation_deg),
        short(scan.offset_nm[0]),
        short(scan.offset_nm[1]),
        number(scan.rounding, ""),
    )
}

fn channel_cells(channels: &[ChannelInfo]) -> Vec<Vec<String>> {
    let mut head: Vec<String> = [
        "channel",
        "line",
        "rows × cols",
        "size nm",
        "unit",
        "min",
        "max",
        "mean",
        "std",
        "missing",
    ]
    .map(str::to_owned)
    .to_vec();
    let pixels = channels.first().map_or(&[][..], |c| &c.samples);
    head.extend(pixels.iter().map(|s| format!("at {},{}", s.row, s.column)));
    head.extend(["plane fit", "value"].map(str::to_owned));
    let row = |c: &ChannelInfo| {
        let interleaved = c.scan_line.as_deref().filter(|s| *s != "Main");
        let line = [c.line_direction, interleaved].into_iter().flatten();
        let size = match (c.width_nm, c.height_nm) {
            (Some(width), Some(height)) => format!("{} × {}", short(width), short(height)),
            _ => "?".to_owned(),
        };
        let mut cells = vec![
            c.name.clone(),
            line.collect::<Vec<_>>().join(" "),
            format!("{} × {}", c.rows, c.columns),
            size,
            c.unit.clone(),
        ];
        cells.extend([c.min, c.max, c.mean, c.std].map(short));
        cells.push(c.missing.to_string());
        let value = |s: &Sample| s.value.map_or("-".to_owned(), short);
        cells.extend(c.samples.iter().map(value));
        cells.push(c.plane_fit.clone().unwrap_or_else(|| "none".to_owned()));
        cells.push(c.scaling.clone());
        cells
    };
    std::iter::once(head)
        .chain(channels.iter().map(row))
        .collect()
}

/// Columns two blanks apart.
fn aligned(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |column: usize| {
        let cells = rows.iter().filter_map(|row| row.get(column));
        cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |row: &Vec<String>| {
        let cells = row
            .iter()
            .zip(&widths)
            .map(|(cell, width)| format!("{cell:width$}"));
        format!("  {}\n", cells.collect::<Vec<_>>().join("  ").trim_end())
    };
    rows.iter().map(line).collect()
}

/// Six significant digits, without trailing zeros.
fn short(value: f64) -> String {
    if !value.is_finite() {
        return "-".to_owned();
    }
    let magnitude = if value == 0.0 {
        0.0
    } else {
        value.abs().log10().floor()
    };
    if (-4.0..6.0).contains(&magnitude) {
        let digits = (5.0 - magnitude) as usize;
        let text = format!("{value:.digits$}");
        if text.contains('.') {
            return text.trim_end_matches('0').trim_end_matches('.').to_owned();
        }
        return text;
    }
    format!("{value:.5e}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        assert_eq!(short(70.0), "70");
        assert_eq!(short(209.765_625), "209.766");
        assert_eq!(short(-0.001_234_567_89), "-0.00123457");
        assert_eq!(short(1e-9), "1.00000e-9");
        assert_eq!(short(100_000.0), "100000");
        assert_eq!(short(f64::NAN), "-");
    }
}

//! The structure of a table of numbers as text: its separator, and which of its fields are labels.
//!
//! Labels are no pixels: a line or a column of words; one whose corner is empty or missing; and one of evenly
//! spaced numbers where the line or column behind it is not so spaced, too, as that of a slope would be.

use super::axis::Axis;

/// Largest number of lines of labels above the numbers.
const MOST_LABELS: usize = 3;
/// Lines that identify a table; its reader reports errors further down.
const FIRST: usize = 16;
/// So few numbers may be evenly spaced by chance.
const FEW: usize = 4;

/// The structure of a table.
#[derive(Debug)]
pub(crate) struct Table {
    pub(super) separator: char,
    /// Lines of labels above the numbers.
    pub(super) labels: usize,
    /// Columns of labels before the numbers: 0 or 1.
    pub(super) index: usize,
    /// Lines and columns of numbers.
    pub(super) rows: usize,
    pub(super) columns: usize,
    /// Whether columns have names.
    pub(super) named: bool,
    /// Positions of columns and of lines, where they are evenly spaced.
    pub(super) axes: [Option<Axis>; 2],
    /// What stands in the lines of words and in the corner.
    pub(super) words: String,
    /// Whether nothing but their spacing tells labels from pixels.
    pub(super) by_spacing: bool,
}

/// The lines that hold something, comments aside, with their numbers from 1.
pub(super) fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = text.lines().enumerate().map(|(n, line)| (n + 1, line));
    lines.filter(|(_, line)| {
        let line = line.trim();
        !line.is_empty() && !line.starts_with('#')
    })
}

fn separator_of(line: &str) -> char {
    let found = [';', '\t', ','].into_iter().find(|&c| line.contains(c));
    found.unwrap_or(' ')
}

/// The fields of a line; a separator at its end begins no further one.
pub(super) fn fields(line: &str, separator: char) -> impl Iterator<Item = &str> {
    let line = line.trim_matches(['\r', ' ']);
    let blanks = (separator == ' ').then(|| line.split_whitespace());
    let ended = line.strip_suffix(separator).unwrap_or(line);
    let others = (separator != ' ').then(|| ended.split(separator).map(unquoted));
    blanks
        .into_iter()
        .flatten()
        .chain(others.into_iter().flatten())
}

fn unquoted(field: &str) -> &str {
    field.trim().trim_matches('"').trim()
}

/// A number; nothing at all is a missing one.
pub(super) fn parse(field: &str, separator: char) -> Option<f64> {
    if field.is_empty() {
        return Some(f64::NAN);
    }
    if let Ok(value) = field.parse() {
        return Some(value);
    }
    let decimal_comma = matches!(separator, ';' | '\t') && !field.contains('.');
    let point = decimal_comma.then(|| field.replacen(',', ".", 1))?;
    point.parse().ok()
}

/// Where the numbers begin: the number of lines of words above them, and their separator.
fn numbers(text: &str) -> Option<(usize, char)> {
    let mut above = Vec::new();
    for (_, line) in lines(text).take(MOST_LABELS + 1) {
        let separator = separator_of(line);
        let count = fields(line, separator).count();
        let is_number = |field: &str| parse(field, separator).is_some();
        // The first field may be the name of the line.
        let named = usize::from(count > 1);
        if fields(line, separator).skip(named).all(is_number) && (above.is_empty() || count > FEW) {
            // Labels stand above all columns, or above all but that of the names of lines.
            let fits = |&line: &&str| [count, count - 1].contains(&fields(line, separator).count());
            return above.iter().all(fits).then_some((above.len(), separator));
        }
        above.push(line);
    }
    None
}

/// Whether a text begins like a table.
pub(crate) fn begins(text: &str) -> bool {
    let Some((above, separator)) = numbers(text) else {
        return false;
    };
    let first = lines(text).skip(above).take(FIRST);
    let mut numbers = first.map(|(_, line)| line).enumerate();
    numbers.all(|(n, line)| {
        // A word before numbers: the corner, or the name of a line where words stand above them, too.
        let word = above > 0 || n == 0 && fields(line, separator).count() > FEW;
        fields(line, separator)
            .skip(usize::from(word))
            .all(|field| parse(field, separator).is_some())
    })
}

impl Table {
    /// Finds the structure of a table; where `plain`, every field is a pixel.
    pub(super) fn of(text: &str, plain: bool) -> Option<Self> {
        let (mut above, separator) = numbers(text)?;
        let line = |n: usize| lines(text).nth(n).map_or("", |(_, line)| line);
        let count = |n: usize| fields(line(n), separator).count();
        let number = |field: &str| parse(field, separator);
        let or_missing = |field: &str| number(field).unwrap_or(f64::NAN);
        let values = |n: usize| {
            fields(line(n), separator)
                .map(or_missing)
                .collect::<Vec<f64>>()
        };
        if !plain {
            let corner = fields(line(above), separator).next().unwrap_or("");
            let bare = number(corner).is_none_or(f64::is_nan);
            let cornerless = count(above) + 1 == count(above + 1);
            let spaced = Axis::of(values(above).get(1..).unwrap_or_default()).is_some();
            above += usize::from(cornerless || bare && spaced);
        }
        let (mut first, mut second, mut named_lines) = (Vec::new(), Vec::new(), false);
        for (_, line) in lines(text).skip(above) {
            let mut all = fields(line, separator);
            let name = all.next().unwrap_or("");
            named_lines |= number(name).is_none();
            first.push(or_missing(name));
            second.push(all.next().map_or(f64::NAN, or_missing));
        }
        let mut table = Self {
            separator,
            labels: above,
            index: usize::from(named_lines && count(above) > 1),
            rows: first.len(),
            columns: count(above),
            named: false,
            axes: [None, None],
            words: String::new(),
            by_spacing: false,
        };
        if plain {
            return Some(table);
        }
        let even = |values: &[f64]| Axis::of(values).filter(|axis| axis.count > FEW);
        let lone =
            |first: &[f64], second: &[f64]| even(first).is_some() && Axis::of(second).is_none();
        if above > 0 {
            table.words = (0..above).map(line).collect::<Vec<_>>().join(" ");
            let heads: Vec<&str> = fields(line(above - 1), separator).collect();
            let (corner, heads) = match heads.split_first() {
                Some((corner, heads)) if heads.len() + 1 == table.columns => (*corner, heads),
                _ => ("", &heads[..]),
            };
            table.named = heads.iter().any(|head| number(head).is_none());
            if corner.is_empty() || !table.named || lone(&first, &second) {
                table.index = 1;
            }
            let heads: Vec<f64> = heads.iter().copied().map(or_missing).collect();
            table.axes = [Axis::of(&heads), Axis::of(&first)];
        } else {
            let inner = |values: &[f64]| values.get(1..).unwrap_or_default().to_vec();
            let [top, below] = [values(0), values(1)];
            if lone(&inner(&top), &inner(&below)) && lone(&inner(&first), &inner(&second)) {
                (table.labels, table.index) = (1, 1);
                table.axes = [Axis::of(&inner(&top)), Axis::of(&inner(&first))];
            } else if lone(&top, &below) {
                table.labels = 1;
            } else if lone(&first, &second) {
                table.index = 1;
            }
            table.by_spacing = table.labels + table.index > 0;
            table.rows -= table.labels;
        }
        table.columns -= table.index;
        Some(table)
    }

    /// What the table is, where it is no image.
    pub(super) fn no_image(&self) -> Option<String> {
        /// A list has so few columns.
        const OF_LIST: usize = 3;
        /// Columns of measurements are fewer than the columns of an image.
        const OF_CURVES: usize = 16;
        let (rows, columns) = (self.rows, self.columns);
        let all = columns + self.index;
        let long = all < OF_CURVES && rows > OF_CURVES * all;
        let list = long || all <= OF_LIST && rows > OF_CURVES;
        let curves = columns < OF_CURVES && rows > 2 * OF_CURVES && rows > 4 * columns;
        let curves = curves && (self.named || self.index > 0);
        (list || curves).then(|| {
            format!(
                "{rows} lines of {all} numbers are a list of points or curves and no image; \
                 save the image as a matrix of its values"
            )
        })
    }
}

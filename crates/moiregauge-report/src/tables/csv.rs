//! RFC 4180: fields, lines, quotes.

use std::fmt::Write as _;

/// A column: its name, what it holds, and how to get it from a row.
pub(super) struct Column<R> {
    pub(super) name: &'static str,
    pub(super) about: &'static str,
    pub(super) value: fn(&R) -> String,
}

/// The table with its header line. Lines end in CR LF, as the RFC has it.
pub(super) fn text<R>(columns: &[Column<R>], rows: &[R]) -> String {
    let mut text = line(columns.iter().map(|c| c.name.to_owned()));
    for row in rows {
        text.push_str(&line(columns.iter().map(|c| (c.value)(row))));
    }
    text
}

/// The columns in words, as Markdown.
pub(super) fn explanation<R>(file: &str, about: &str, columns: &[Column<R>]) -> String {
    let mut text = format!("\n## {file}\n\n{about}\n\n| column | meaning |\n| --- | --- |\n");
    for column in columns {
        let _ = writeln!(text, "| `{}` | {} |", column.name, column.about);
    }
    text
}

fn line(fields: impl Iterator<Item = String>) -> String {
    let fields: Vec<String> = fields.map(|f| quoted(&f)).collect();
    fields.join(",") + "\r\n"
}

/// A field in quotes if it needs them.
///
/// A name that begins like a formula is left as it is: changing data is worse, and the numbers
/// themselves may begin with a minus sign.
fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\r', '\n']) || field.starts_with(' ') || field.ends_with(' ') {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field.to_owned()
    }
}

/// The shortest text that reads back as the same number; empty where there is none.
pub(super) fn number(value: Option<f64>) -> String {
    // `Debug` goes over to 1e-40 where `Display` would print forty zeros.
    value.map_or_else(String::new, |v| format!("{v:?}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_quoted_as_the_rfc_says() {
        assert_eq!(quoted("plain ü"), "plain ü");
        assert_eq!(quoted("a,b"), "\"a,b\"");
        assert_eq!(quoted("say \"x\""), "\"say \"\"x\"\"\"");
        assert_eq!(quoted("two\nlines"), "\"two\nlines\"");
    }

    #[test]
    fn numbers_read_back() {
        for value in [0.1 + 0.2, -1e-9, 12.5, 1e300] {
            assert_eq!(number(Some(value)).parse(), Ok(value));
        }
        assert_eq!(number(None), "");
        assert_eq!(number(Some(1.5e-40)), "1.5e-40");
    }
}

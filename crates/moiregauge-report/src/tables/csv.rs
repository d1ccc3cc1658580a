//! RFC 4180: fields, lines, quotes; and no field that a spreadsheet would run.

use std::fmt::Write as _;

/// A column: its name, what it holds, and how to get it from a row.
pub(crate) struct Column<R> {
    pub(crate) name: &'static str,
    pub(crate) about: &'static str,
    pub(crate) value: fn(&R) -> String,
}

impl<R> Column<R> {
    /// A column of this name, what it holds, and how.
    pub(crate) const fn new(
        name: &'static str,
        about: &'static str,
        value: fn(&R) -> String,
    ) -> Self {
        Self { name, about, value }
    }
}

/// The table with its header line. Lines end in CR LF, as the RFC has it.
pub(crate) fn text<R>(columns: &[Column<R>], rows: &[R]) -> String {
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
    let fields: Vec<String> = fields.map(|f| quoted(&harmless(f))).collect();
    fields.join(",") + "\r\n"
}

/// For the reader of a table: what [`harmless`] does, and how to undo it.
pub(super) const APOSTROPHE: &str = "Text that a spreadsheet could run as a formula (it begins with `=`, `+`, `-`, `@` \
                                     or a control character), or that begins with an apostrophe, gets an apostrophe in \
                                     front. Remove it when you read the file. Numbers are unchanged.";

/// A text that begins like a formula, or already with an apostrophe, with one before it; a number as it is.
///
/// Names of files and sets are anybody's, and spreadsheets run what begins so. Blanks before it do not stop all of
/// them, and Japanese ones take the wide signs as well.
fn harmless(field: String) -> String {
    let first = field.chars().find(|c| !c.is_whitespace());
    let formula = first.is_some_and(|c| "=+-@＝＋－＠".contains(c) || c.is_control());
    let marked = field.starts_with(|c: char| c.is_control() || c == '\'');
    if (formula || marked) && field.parse::<f64>().is_err() {
        format!("'{field}")
    } else {
        field
    }
}

/// A field in quotes if it needs them.
fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\r', '\n']) || field.starts_with(' ') || field.ends_with(' ') {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field.to_owned()
    }
}

/// The shortest text that reads back as the same number; empty where there is none.
pub(crate) fn number(value: Option<f64>) -> String {
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

    /// What a spreadsheet shows of such a cell is the text after the apostrophe.
    #[test]
    fn nothing_is_run() {
        let plain = |text: &str| harmless(text.to_owned());
        for formula in [
            "=cmd|' /C calc'!A0.spm",
            "+1+cmd",
            "-2+3",
            "-a",
            "@SUM(1)",
            "\t=1",
            "\r=1",
            "\n=1",
            " =1",
            "＝1+1",
            "'quoted'",
            "+",
            "=",
        ] {
            assert_eq!(plain(formula), format!("'{formula}"));
        }
        for kept in [
            "-0.35", "+2", "-1e-9", "-inf", "a=b", "a-b", "3", "", " ", "name, x", "don't",
        ] {
            assert_eq!(plain(kept), kept);
        }
        assert_eq!(
            line(["=a,\"b\"\r\n.spm".to_owned(), "-0.35".to_owned()].into_iter()),
            "\"'=a,\"\"b\"\"\r\n.spm\",-0.35\r\n"
        );
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

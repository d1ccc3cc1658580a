use super::*;

/// The size that is told and the numbers.
fn read(text: &str) -> Result<crate::Scan, ReadError> {
    crate::read(text.as_bytes())
}

fn values(text: &str) -> Vec<f64> {
    let (_, plane) = open(text.as_bytes()).expect("a matrix");
    let Stored::Packed(samples) = plane.samples else {
        panic!("packed numbers");
    };
    let Ok(Unpacked {
        samples: Samples::F64(values),
        ..
    }) = samples()
    else {
        panic!("numbers");
    };
    values
}

#[test]
fn separators() {
    let expected = [3.0, 4.5, 1.0, -2.0];
    for text in [
        "1 -2\n3 4.5\n",
        "  1\t-2\r\n3\t4.5",
        "1,-2\n3,4.5\n\n",
        "1, -2,\n3, 4.5,\n",
        "1;-2\n3;4,5\n",
        "1,0\t-2,0\n3,0\t4,5\n",
        "\u{feff}# x\n1e0 -2\n3 45e-1\n",
    ] {
        assert_eq!(values(text), expected, "{text:?}");
    }
    let missing = values("1,,3\nnan,5,6\n");
    assert!(missing[0].is_nan() && missing[4].is_nan());
}

#[test]
fn comments_tell_size_and_unit() {
    let text = "# Channel: Topography\n# Width: 1.5 µm\n# Height: 20 nm\n# Value units: m\n1 2\n";
    let (told, plane) = open(text.as_bytes()).expect("a matrix");
    assert_eq!(told.name.as_deref(), Some("Topography"));
    assert_eq!(told.unit.as_deref(), Some("m"));
    assert_eq!(told.size_nm, Some([1500.0, 20.0]));
    assert_eq!((plane.rows, plane.columns), (1, 2));
    let (told, _) = open(b"# Width: 5 V\n# Height: 20 nm\n1 2\n").expect("a matrix");
    assert_eq!(told.size_nm, None);
}

#[test]
fn what_is_wrong_is_said() {
    let error = |text: &str| {
        let (_, plane) = open(text.as_bytes())?;
        match plane.samples {
            Stored::Packed(samples) => samples().map(|_| ()),
            _ => Ok(()),
        }
        .map_err(|failure| match failure {
            Failure::File(error) => error,
            _ => panic!("the whole file is refused"),
        })
    };
    let error = |text: &str| error(text).expect_err("no matrix").to_string();
    assert!(error("1 2\n3\n").contains("line 2"));
    assert!(error("1 2\n3 x\n").contains("\"x\""));
    // Whether this comma is a decimal one is not known.
    assert!(error("1,5 2,5\n").contains("number"));
    assert!(error("# nothing\n\n").contains("none"));
}

/// An image that is even along none of its lines, with the numbers of its first line and column given.
fn table(corner: Option<&str>, heads: &[String], index: &[String], separator: &str) -> String {
    let mut text = String::new();
    if !heads.is_empty() {
        let corner = corner.map(str::to_owned).into_iter();
        let line: Vec<String> = corner.chain(heads.iter().cloned()).collect();
        text += &(line.join(separator) + "\n");
    }
    for row in 0..6 {
        let name = index.get(row).cloned().into_iter();
        let pixels = (0..8).map(|column| pixel(row, column).to_string());
        text += &(name.chain(pixels).collect::<Vec<_>>().join(separator) + "\n");
    }
    text
}

fn pixel(row: usize, column: usize) -> f64 {
    ((row * row + 3 * column * column) % 11) as f64 / 4.0
}

#[test]
fn labels_are_no_pixels() {
    let count = |n: usize| (0..n).map(|i| i.to_string()).collect::<Vec<_>>();
    let names = |n: usize| (0..n).map(|i| format!("c{i}")).collect::<Vec<_>>();
    let positions = |n: usize, step: f64| {
        (0..n)
            .map(|i| format!("{:.3}", i as f64 * step))
            .collect::<Vec<_>>()
    };
    let expected: Vec<f64> = (0..6)
        .rev()
        .flat_map(|row| (0..8).map(move |column| pixel(row, column)))
        .collect();
    for separator in [",", ";", "\t"] {
        for (text, spaced) in [
            (table(None, &[], &[], separator), false),
            (table(Some(""), &count(8), &count(6), separator), false),
            (table(None, &count(8), &count(6), separator), false),
            (table(Some("y"), &names(8), &count(6), separator), false),
            (table(None, &names(8), &[], separator), false),
            (table(Some("line"), &names(8), &names(6), separator), false),
            (table(Some("\"\""), &count(8), &count(6), separator), false),
            (
                table(
                    Some("0"),
                    &positions(8, 0.125),
                    &positions(6, 0.3),
                    separator,
                ),
                true,
            ),
            (
                table(
                    Some("6"),
                    &positions(8, 0.125),
                    &positions(6, 0.3),
                    separator,
                ),
                true,
            ),
            (table(None, &count(8), &[], separator), true),
            (table(None, &[], &count(6), separator), true),
        ] {
            let scan = read(&text).unwrap_or_else(|error| panic!("{error}: {text}"));
            assert_eq!(scan.channels[0].values(), expected, "{text}");
            assert_eq!(
                (scan.size_nm, scan.notes.len()),
                (None, usize::from(spaced)),
                "{text}"
            );
        }
    }
}

#[test]
fn slopes_are_no_labels() {
    let plane = |value: &dyn Fn(usize, usize) -> usize| {
        let line = |row| {
            (0..8)
                .map(|column| value(row, column).to_string())
                .collect::<Vec<_>>()
                .join(" ")
                + "\n"
        };
        let scan = read(&(0..6).map(line).collect::<String>()).expect("an image");
        let [channel] = &scan.channels[..] else {
            panic!("one image")
        };
        (channel.rows, channel.columns, scan.notes.len())
    };
    assert_eq!(plane(&|row, column| row + 2 * column), (6, 8, 0));
    assert_eq!(plane(&|row, column| row * row * row + column), (6, 8, 0));
    assert_eq!(plane(&|row, column| row + column * column), (6, 8, 0));
    assert_eq!(plane(&|_, _| 7), (6, 8, 0));
}

#[test]
fn positions_with_a_unit_give_the_size() {
    let up = |n: usize, step: f64| {
        (0..n)
            .map(|i| format!("{}", i as f64 * step))
            .collect::<Vec<_>>()
    };
    let down = |n: usize, step: f64| up(n, step).into_iter().rev().collect::<Vec<_>>();
    let size = |corner: &str, comment: &str| {
        let scan =
            read(&(comment.to_owned() + &table(Some(corner), &up(8, 0.5), &down(6, 0.25), "\t")));
        let scan = scan.expect("an image");
        assert!(scan.notes.is_empty() || corner == "0", "{:?}", scan.notes);
        scan.size_nm
    };
    assert_eq!(size("y\\x (nm)", ""), Some([4.0, 1.5]));
    assert_eq!(size("µm", ""), Some([4000.0, 1500.0]));
    assert_eq!(size("", "# x and y in nm\n"), Some([4.0, 1.5]));
    assert_eq!(size("0", "# XYUnits: nm\n"), Some([4.0, 1.5]));
    assert_eq!(size("y/x", ""), None);
    let upside = read(&table(Some("nm"), &up(8, 0.5), &up(6, 0.25), ",")).expect("an image");
    assert_eq!((upside.size_nm, upside.notes.len()), (Some([4.0, 1.5]), 1));
}

#[test]
fn lists_and_curves_are_no_images() {
    let lines = |n: usize, columns: usize, heads: &str| {
        let line = |row: usize| {
            (0..columns)
                .map(|column| {
                    if column == 0 {
                        row.to_string()
                    } else {
                        pixel(row, column).to_string()
                    }
                })
                .collect::<Vec<_>>()
                .join(",")
        };
        read(&(heads.to_owned() + &(0..n).map(|row| line(row) + "\n").collect::<String>()))
    };
    for (n, columns, heads) in [
        (100, 3, ""),
        (480, 4, ""),
        (100, 2, ""),
        (200, 5, ""),
        (200, 5, "Bias (V),I (A),X,Y,Z\n"),
    ] {
        let error = lines(n, columns, heads).expect_err("no image").to_string();
        assert!(error.contains("list of points or curves"), "{error}");
    }
    assert!(lines(10, 3, "").is_ok());
}

#[test]
fn texts_of_windows_programs() {
    let text = "# Width: 2 µm\n# Height: 1 µm\n1\t2\r\n3\t4\r\n";
    let little: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let marked = [b"\xff\xfe", &little[..]].concat();
    for bytes in [marked, little, text.chars().map(|c| c as u8).collect()] {
        let scan = crate::read(&bytes).expect("a matrix");
        assert_eq!(scan.channels[0].values(), [3.0, 4.0, 1.0, 2.0]);
        assert_eq!(scan.size_nm, Some([2000.0, 1000.0]));
    }
}

#[test]
fn a_width_that_cannot_be_read_is_said() {
    let scan = read("# Width: 1,5 nm\n# Height: 2 nm\n1 2\n3 4\n").expect("a matrix");
    assert_eq!(scan.size_nm, None);
    assert!(scan.notes[0].contains("1,5 nm"), "{:?}", scan.notes);
}

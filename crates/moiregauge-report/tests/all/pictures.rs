//! Figures and page: well-formed, escaped, self-contained, the same on any number of threads.

use moiregauge::caveat::{Caveat, FileDoubt};
use moiregauge_report::{Choice, ColorMap, figures, write_report};

use crate::common;

type Files = Vec<(String, Vec<u8>)>;

fn report(analysis: &moiregauge::campaign::Analysis, choice: Choice) -> Files {
    write_report(analysis, &common::provenance(), &choice).expect("a report")
}

fn page(files: &Files) -> String {
    let found = files
        .iter()
        .find(|(name, _)| name == "report.html")
        .expect("the page");
    String::from_utf8(found.1.clone()).expect("UTF-8")
}

/// Text without embedded data, in which any three letters may stand by chance.
fn without_images(text: &str) -> String {
    let mut parts = text.split("base64,");
    let mut kept = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        kept.push_str(part.split_once('"').map_or("", |(_, rest)| rest));
    }
    kept
}

const WITHOUT_PNG: Choice = Choice {
    figures: true,
    png: false,
    html: true,
    colormap: ColorMap::Viridis,
};

#[test]
fn the_bytes_do_not_depend_on_threads() {
    let analysis = common::analysis();
    let made: Vec<Files> = [1, 2, 7]
        .into_iter()
        .map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("a pool");
            pool.install(|| report(&analysis, Choice::default()))
        })
        .collect();
    assert!(made[0] == made[1] && made[0] == made[2]);
}

#[test]
fn figures_are_well_formed() {
    for colormap in ColorMap::ALL {
        for figure in figures(&common::analysis(), colormap) {
            let Ok(drawing) = figure.drawing else {
                continue;
            };
            let parsed = resvg::usvg::roxmltree::Document::parse(&drawing.svg);
            assert!(parsed.is_ok(), "{}: {:?}", figure.name, parsed.err());
            assert!(
                !without_images(&drawing.svg).contains("NaN"),
                "{}",
                figure.name
            );
            assert!(
                !without_images(&drawing.svg).contains("inf"),
                "{}",
                figure.name
            );
            assert!(drawing.caption.ends_with('.'), "{}", figure.name);
        }
    }
}

/// 300 dots per inch: a column of 88 mm is 1039 pixels wide, a page of 180 mm 2126.
#[test]
fn pictures_have_the_width_of_journals() {
    let analysis = common::analysis();
    let choice = Choice {
        html: false,
        ..Choice::default()
    };
    let files = report(&analysis, choice);
    for figure in figures(&analysis, ColorMap::Viridis) {
        let Ok(drawing) = figure.drawing else {
            continue;
        };
        let name = format!("figures/{}.png", figure.name);
        let (_, bytes) = files
            .iter()
            .find(|(n, _)| *n == name)
            .expect("a PNG of each figure");
        let decoder = png::Decoder::new(std::io::Cursor::new(bytes));
        let reader = decoder.read_info().expect("a PNG");
        let info = reader.info();
        assert_eq!(info.width, if drawing.wide { 2126 } else { 1039 }, "{name}");
        assert_eq!(info.pixel_dims.map(|d| d.xppu), Some(11811), "{name}");
    }
}

#[test]
fn every_figure_of_a_good_set_is_drawn_and_none_of_a_poor_one_fails() {
    let all = figures(&common::analysis(), ColorMap::Viridis);
    assert_eq!(all.len(), 3 + 3 * 16);
    for figure in &all {
        let drawn = figure.drawing.is_ok();
        assert_eq!(
            drawn,
            // The grid is that of the sensors where they depart from a plane, which those of these sets do not.
            figure.set != Some(2) && !figure.name.ends_with("curved-grid"),
            "{}: {:?}",
            figure.name,
            figure.drawing.as_ref().err()
        );
    }
}

#[test]
fn the_page_escapes_and_needs_no_network() {
    let bad = "<script>alert('x')</script>&amp;\"></title>.001";
    let mut analysis = common::analysis();
    for set in &mut analysis.sets {
        set.name = format!("{bad} {}", set.name);
        bad.clone_into(&mut set.channel);
        set.scans[0].file = bad.to_owned();
        if let Some(shown) = &mut set.illustration {
            shown.file = bad.to_owned();
            shown.unit = bad.to_owned();
        }
    }
    analysis.caveats[0] = Caveat::new(FileDoubt::ReaderDoubt(bad.to_owned()), bad);
    let mut provenance = common::provenance();
    provenance.failed[0].file = bad.to_owned();
    provenance.failed[0].error = bad.to_owned();
    let files = write_report(&analysis, &provenance, &WITHOUT_PNG).expect("a report");
    let page = page(&files);
    assert!(!page.contains("<script"));
    assert!(page.contains("&lt;script&gt;"));
    assert_eq!(
        page.matches("</title>").count(),
        1 + page.matches("<svg").count()
    );
    for outside in ["src=\"http", "href=\"http", "url(http", "@import", "<link"] {
        assert!(!page.contains(outside), "{outside}");
    }
}

#[test]
fn the_page_says_what_is_wrong_first() {
    let mut analysis = common::analysis();
    analysis.settings.method = moiregauge::spectrum::Method::Paper;
    let page = page(&report(&analysis, WITHOUT_PNG));
    let at = |text: &str| {
        page.find(text)
            .unwrap_or_else(|| panic!("{text} is missing"))
    };
    assert!(at("about one per cent at four to five periods") < at("<svg"));
    assert!(at("only 2.5 lattice periods") < at("id=\"set1-scan\""));
    assert!(at("header promises 1048576") < at("id=\"set1-scan\""));
    assert!(at("Not corrected for drift") < at("<svg"));
    assert!(page.contains("no scan of this set could be shown in detail"));
}

#[test]
fn nothing_to_show_is_no_error() {
    let mut empty = common::analysis();
    empty.sets.clear();
    empty.combined = None;
    empty.caveats.clear();
    assert!(page(&report(&empty, Choice::default())).contains("No set could be corrected"));
}

/// Every number NaN, every image without pixels: a report still comes out.
#[test]
fn hopeless_numbers_are_no_error() {
    let mut analysis = common::analysis();
    common::spoil(&mut analysis);
    let files = report(&analysis, Choice::default());
    for (name, bytes) in &files {
        if name.starts_with("figures/") && bytes.starts_with(b"<svg") {
            let text = String::from_utf8_lossy(bytes);
            assert!(!without_images(&text).contains("NaN"), "{name}");
        }
    }
    assert!(!without_images(&page(&files)).contains("NaN"));
}

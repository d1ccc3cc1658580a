//! Every text of every figure lies on its page, and colours of maps do not show noise as a landscape.

use std::sync::Arc;

use moiregauge::map::{Grid, Plane, TwistStrainMap};
use moiregauge::window::Mask;
use moiregauge_report::{ColorMap, Figure, MapDetails, figures, map_figures};
use nalgebra::{Matrix2, Vector2};
use resvg::usvg::{self, fontdb};

use crate::common;

/// By the bundled font, measured by the renderer.
fn texts_off_the_page(figure: &Figure) -> Vec<String> {
    let Ok(drawing) = &figure.drawing else {
        return Vec::new();
    };
    let mut fonts = fontdb::Database::new();
    for font in [dejavu::sans::regular(), dejavu::sans::bold()] {
        fonts.load_font_source(fontdb::Source::Binary(Arc::new(font)));
    }
    fonts.set_sans_serif_family("DejaVu Sans");
    let options = usvg::Options {
        fontdb: Arc::new(fonts),
        ..usvg::Options::default()
    };
    let tree = usvg::Tree::from_str(&drawing.svg, &options).expect("an SVG");
    let mut found = Vec::new();
    let mut count = 0;
    walk(tree.root(), &mut |text| {
        count += 1;
        let (page, at) = (tree.size(), text.abs_bounding_box());
        // A tenth of a pixel for rounding of coordinates.
        let within = at.left() > -0.1
            && at.top() > -0.1
            && at.right() < page.width() + 0.1
            && at.bottom() < page.height() + 0.1;
        if !within {
            let words: String = text.chunks().iter().map(|c| c.text().to_owned()).collect();
            found.push(format!("{}: {words:?} at {at:?} of {page:?}", figure.name));
        }
    });
    assert!(count > 2, "{}: no texts", figure.name);
    found
}

fn walk(group: &usvg::Group, see: &mut impl FnMut(&usvg::Text)) {
    for node in group.children() {
        match node {
            usvg::Node::Group(group) => walk(group, see),
            usvg::Node::Text(text) => see(text),
            _ => {}
        }
    }
}

fn all_on_the_page(all: &[Figure]) {
    let off: Vec<String> = all.iter().flat_map(texts_off_the_page).collect();
    assert!(off.is_empty(), "{off:#?}");
}

#[test]
fn labels_of_a_usual_analysis_lie_on_the_page() {
    all_on_the_page(&figures(&common::analysis(), ColorMap::Viridis));
}

/// The budget is drawn of a set without drift then; numbers get longer, names too.
#[test]
fn labels_without_drift_and_with_long_names_lie_on_the_page() {
    let mut analysis = common::analysis();
    analysis.combined = None;
    for set in &mut analysis.sets {
        set.channel = "Lateral deflection of the second overtone, retrace, as exported".to_owned();
        set.name = format!("{} with a name that somebody gave it by hand", set.name);
        set.mean = None;
        if let Some(drift) = &mut set.drift {
            drift.velocity *= 1e3;
        }
    }
    let all = figures(&analysis, ColorMap::Viridis);
    let budget = all.iter().find(|f| f.name == "budget").expect("a budget");
    assert!(
        budget
            .drawing
            .as_ref()
            .is_ok_and(|d| d.svg.contains("+ drift"))
    );
    all_on_the_page(&all);
    // Many sets, numbers with many digits.
    let mut many = common::analysis();
    let set = many.sets[0].clone();
    many.sets.extend(std::iter::repeat_n(set, 8));
    for set in &mut many.sets {
        if let Some(drift) = &mut set.drift {
            drift.covariance *= 1e-6;
        }
    }
    all_on_the_page(&figures(&many, ColorMap::Viridis));
}

/// A plane of one value and noise of σ, row by row.
fn plane(n: usize, value: f64, sigma: f64, off: &[f64]) -> Plane {
    Plane {
        value: (0..n).map(|i| (value + sigma * off[i]) as f32).collect(),
        sigma: vec![sigma as f32; n],
    }
}

/// A map on which nothing varies but noise.
fn constant(twist_sigma_deg: f64) -> TwistStrainMap {
    let (columns, rows) = (24, 20);
    let n = columns * rows;
    // Even steps between −2 and 2, in an order that hides them.
    let off: Vec<f64> = (0..n)
        .map(|i| 4.0 * ((i * 197) % n) as f64 / n as f64 - 2.0)
        .collect();
    let of = |value: f64, sigma: f64| plane(n, value, sigma, &off);
    TwistStrainMap {
        grid: Grid {
            size: [columns, rows],
            origin: Vector2::new(-30.0, -20.0),
            step: Matrix2::identity() * 2.5,
        },
        window_nm: 6.0,
        mask: vec![Mask::Good; n],
        twist: of(1.1_f64.to_radians(), twist_sigma_deg.to_radians()),
        lattice_angle: of(0.2, 1e-4),
        strain: [of(1e-3, 1e-5), of(-5e-4, 1e-5)],
        strain_covariance: vec![0.0; n],
        magnitude: of(1.1e-3, 1e-5),
        axis: of(0.3, 1e-3),
        wavelengths: [of(12.6, 0.01), of(12.9, 0.01), of(13.0, 0.01)],
        orientation: of(0.5, 1e-3),
        displacement: [of(0.0, 0.01), of(0.0, 0.01)],
        closure: vec![1.0; n],
        curl: vec![0.0; n],
        of_bends: Default::default(),
        signal_to_noise: vec![20.0; n],
        grain: Vec::new(),
    }
}

/// The numbers at the colour bar of a figure: those right of the panel.
fn colour_ticks(figure: &Figure) -> Vec<f64> {
    let svg = &figure.drawing.as_ref().expect("a figure").svg;
    let document = usvg::roxmltree::Document::parse(svg).expect("XML");
    document
        .descendants()
        .filter(|n| n.has_tag_name("text") && n.attribute("text-anchor") == Some("start"))
        .filter(|n| n.attribute("transform").is_none())
        .filter_map(|n| n.text()?.replace('\u{2212}', "-").parse().ok())
        .collect()
}

#[test]
fn noise_alone_is_no_landscape() {
    let sigma = 0.004;
    let all = map_figures(&constant(sigma), &MapDetails::default(), ColorMap::Viridis);
    all_on_the_page(&all);
    let twist = all.iter().find(|f| f.name == "map-twist").expect("the map");
    let ticks = colour_ticks(twist);
    let step = ticks[1] - ticks[0];
    let span = ticks[ticks.len() - 1] - ticks[0] + 2.0 * step;
    // The bar reaches less than a step beyond its outer numbers.
    assert!(ticks.len() > 2 && span > 12.0 * sigma, "{ticks:?}");
    let caption = &twist.drawing.as_ref().expect("a figure").caption;
    assert!(caption.contains("± σ"), "{caption}");
}

/// Regions are drawn in one figure; the maps themselves are clean.
#[test]
fn maps_are_clean_and_one_figure_has_the_overlays() {
    let map = constant(0.004);
    let square = |x: f64, name: &str| moiregauge::region::Region {
        name: name.to_owned(),
        corners: [(0.0, 0.0), (12.0, 0.0), (12.0, 12.0), (0.0, 12.0)]
            .map(|(dx, dy)| Vector2::new(x + dx, dy))
            .to_vec(),
    };
    let region = moiregauge::region::RegionStatistics::new(&map, &square(-10.0, "a region"));
    let details = MapDetails {
        regions: vec![region],
        ..MapDetails::default()
    };
    let with = map_figures(&map, &details, ColorMap::Viridis);
    let without = map_figures(&map, &MapDetails::default(), ColorMap::Viridis);
    all_on_the_page(&with);
    for (a, b) in with.iter().zip(&without) {
        let [a, b] = [a, b].map(|f| {
            f.drawing
                .as_ref()
                .ok()
                .map(|d| (f.name.clone(), d.svg.clone()))
        });
        if a.as_ref().is_some_and(|(name, _)| name == "map-overlays") {
            assert!(a.is_some_and(|(_, svg)| svg.contains(">a region</text>")) && b.is_none());
        } else {
            assert!(a == b, "{:?}", a.map(|a| a.0));
        }
    }
}

/// The names under the axes and the title of the comparison are those of the estimators that were used.
#[test]
fn the_comparison_names_its_estimators() {
    use moiregauge::spectrum::Method;
    let expected = [
        (Method::Lattice, "Lattice fit against Fourier transform"),
        (Method::Fourier, "Fourier transform against autocorrelation"),
    ];
    for (method, title) in expected {
        let mut analysis = common::analysis();
        analysis.settings.method = method;
        let all = figures(&analysis, ColorMap::Viridis);
        let figure = all
            .iter()
            .find(|f| f.name == "set1-estimators")
            .expect("a figure");
        assert_eq!(figure.title, title);
        let caption = &figure.drawing.as_ref().expect("drawn").caption;
        let first = title
            .split(" against")
            .next()
            .expect("a name")
            .to_lowercase();
        assert!(
            caption
                .to_lowercase()
                .starts_with(&format!("wavelengths by the {first}")),
            "{caption}"
        );
    }
}

/// Against the closed form: at the wavelength of the set the curve has 2 arcsin(a/2λ), 1 % of scanner is 1 % of twist.
#[test]
fn new_figures_say_their_numbers() {
    let analysis = common::analysis();
    let all = figures(&analysis, ColorMap::Viridis);
    let caption = |name: &str| {
        let figure = all.iter().find(|f| f.name == name).expect("a figure");
        figure.drawing.as_ref().expect("drawn").caption.clone()
    };
    let curve = caption("set1-twist-wavelength");
    assert!(curve.contains("known to 1."), "{curve}");
    let mean = analysis.sets[0].mean.as_ref().expect("a mean");
    let lengths = [0, 1, 2].map(|i| mean.wavelength(i).value);
    let (low, high) = lengths
        .iter()
        .fold((f64::MAX, 0.0_f64), |(l, h), v| (l.min(*v), h.max(*v)));
    let twist = 2.0 * (0.246 / (low + high)).asin().to_degrees();
    assert!(
        curve.contains(&format!("{twist:.3} ± 0.01")),
        "{twist}: {curve}"
    );
    let amplitude = 100.0_f64 / 2.0_f64.sqrt();
    let residuals = caption("set1-residuals");
    let x: f64 = residuals
        .split_once("deviation x ")
        .and_then(|(_, rest)| rest.split(' ').next()?.parse().ok())
        .expect("a number");
    assert!((x / amplitude - 1.0).abs() < 0.1, "{residuals}");
    assert!(caption("survey").contains("survey.000"));
    assert!(caption("set1-amplitude").contains("TR Amplitude"));
    assert!(caption("set1-parameters").contains("orientation α"));
}

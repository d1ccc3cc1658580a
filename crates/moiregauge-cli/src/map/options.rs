//! A request → the options that ask the same.

use moiregauge::domains::Contrast;
use moiregauge::survey::MapMethod;
use moiregauge_pipeline::maps::{MapRequest, When};
use nalgebra::Vector2;

/// The options that are not as usual.
pub(crate) fn as_options(request: &MapRequest) -> Vec<String> {
    let mut all = Vec::new();
    let mut add = |option: &str, value: Option<String>| {
        if let Some(value) = value {
            all.extend([option.to_owned(), value]);
        }
    };
    let tiles = request.method == MapMethod::Tiles;
    add("--map-method", tiles.then(|| "tiles".to_owned()));
    let number = |value: Option<f64>| value.map(|v| v.to_string());
    add("--window", number(request.window_nm));
    add("--step", number(request.step_nm));
    add("--margin", number(request.margin));
    let asked = &request.questions;
    for region in &asked.regions {
        add(
            "--region",
            Some(format!("{}={}", region.name, places(&region.corners))),
        );
    }
    for line in &asked.profiles {
        add(
            "--profile",
            Some(format!("{}={}", line.name, places(&line.ends))),
        );
    }
    if let Some(device) = &asked.device {
        let [width, height] = device.size;
        add("--device", Some(format!("{width}nm×{height}nm")));
        add("--device-angles", Some(device.orientations.to_string()));
        add("--device-count", Some(device.most.to_string()));
    }
    let degrees = |rad: f64| rad.to_degrees();
    let wanted = asked
        .wanted
        .map(|w| format!("{}±{}", degrees(w.twist), degrees(w.within)));
    add("--wanted", wanted);
    let domains = match request.domains.when {
        When::Auto => None,
        When::On => Some("on".to_owned()),
        When::Off => Some("off".to_owned()),
    };
    add("--domains", domains);
    let nodes = match request.domains.nodes {
        Contrast::Bright => Some("bright".to_owned()),
        Contrast::Dark => Some("dark".to_owned()),
        Contrast::Auto => None,
    };
    add("--nodes", nodes);
    if request.in_bands {
        all.push("--in-bands".to_owned());
    }
    all
}

fn places(all: &[Vector2<f64>]) -> String {
    let all = all.iter().map(|place| format!("{},{}", place.x, place.y));
    all.collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::super::args::MapArgs;
    use super::*;

    #[derive(Parser)]
    struct Typed {
        #[command(flatten)]
        map: MapArgs,
    }

    #[test]
    fn options_ask_for_the_same() {
        let text = r#"{
            "method": "tiles", "margin": 1.5, "window_nm": 12.25, "in_bands": true,
            "domains": {"when": "on", "nodes": "dark"},
            "questions": {
                "regions": [{"name": "bar", "corners_nm": [[0, 0], [4, -1], [0, 2]]}],
                "profiles": [{"name": "cut", "ends_nm": [[0, 0], [3, 4]]}],
                "device": {"size_nm": [40, 20], "orientations": 3}
            }
        }"#;
        let request: MapRequest = serde_json::from_str(text).unwrap();
        let typed = ["map", "scan", "--out", "out"].map(str::to_owned);
        let typed = typed.into_iter().chain(as_options(&request));
        assert_eq!(Typed::parse_from(typed).map.request(), request);
        assert!(as_options(&MapRequest::default()).is_empty());
    }
}

//! What a page asks, as options of the program.

use moiregauge::domains::Contrast;
use moiregauge::survey::MapMethod;
use moiregauge_pipeline::maps::{MapRequest, When};
use moiregauge_report::results::{Crop, FrameOrder, UserSpecified};

/// The options of the program that tell what the user specified.
pub fn user_specified_as_options(specified: &UserSpecified) -> Vec<String> {
    let frame = specified.frame_direction.map(|order| {
        let name = match order {
            FrameOrder::Up => "up",
            FrameOrder::Down => "down",
            FrameOrder::AlternatingUp => "alternating-up",
            FrameOrder::AlternatingDown => "alternating-down",
        };
        name.to_owned()
    });
    let block = |c: Crop| format!("{},{},{},{}", c.column, c.top, c.columns, c.rows);
    let all = [
        (
            "--size",
            specified.size_nm.map(|[w, h]| format!("{w}nm×{h}nm")),
        ),
        ("--unit", specified.unit.clone()),
        (
            "--line-rate",
            specified.line_rate_hz.map(|hz| hz.to_string()),
        ),
        ("--frame-direction", frame),
        (
            "--rotation",
            specified.rotation_deg.map(|deg| deg.to_string()),
        ),
        ("--x-sensor", specified.x_sensor.clone()),
        ("--y-sensor", specified.y_sensor.clone()),
        ("--sensor-unit", specified.sensor_unit.clone()),
        ("--sensors", specified.sensors.clone()),
        ("--crop", specified.crop.map(block)),
    ];
    let given = all
        .into_iter()
        .filter_map(|(option, value)| Some((option, value?)));
    given
        .flat_map(|(option, value)| [option.to_owned(), value])
        .collect()
}

/// The options of `moiregauge map` that ask the same, where they are not as usual.
pub fn map_as_options(request: &MapRequest) -> Vec<String> {
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
            Some(format!(
                "{}={}",
                region.name,
                places(region.corners.iter().map(|at| [at.x, at.y]))
            )),
        );
    }
    for line in &asked.profiles {
        add(
            "--profile",
            Some(format!(
                "{}={}",
                line.name,
                places(line.ends.iter().map(|at| [at.x, at.y]))
            )),
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

fn places(all: impl Iterator<Item = [f64; 2]>) -> String {
    let all = all.map(|[x, y]| format!("{x},{y}"));
    all.collect::<Vec<_>>().join(" ")
}

//! Prints the JSON Schema of `results.json`, as it is published in `schema/results-1.schema.json` of `moiregauge-report`;
//! with the argument `map` that of `map.json`, with `watch` that of a line of `moiregauge watch --json`.

use moiregauge_pipeline::watch::line_schema;
use moiregauge_report::{map_schema, schema};

fn main() -> Result<(), serde_json::Error> {
    let schema = match std::env::args().nth(1).as_deref() {
        Some("map") => map_schema(),
        Some("watch") => line_schema(),
        _ => schema(),
    };
    println!("{}", serde_json::to_string_pretty(&schema)?);
    Ok(())
}

//! Prints the JSON Schema of `results.json`, as it is published in `schema/results-1.schema.json`; with the argument
//! `map` that of `map.json`, `schema/map-1.schema.json`.

use moiregauge_report::{map_schema, schema};

fn main() -> Result<(), serde_json::Error> {
    let schema = match std::env::args().nth(1).as_deref() {
        Some("map") => map_schema(),
        _ => schema(),
    };
    println!("{}", serde_json::to_string_pretty(&schema)?);
    Ok(())
}

//! Prints the JSON Schema of `results.json`, as it is published in `schema/results-1.schema.json`.

fn main() -> Result<(), serde_json::Error> {
    println!(
        "{}",
        serde_json::to_string_pretty(&moiregauge_report::schema())?
    );
    Ok(())
}

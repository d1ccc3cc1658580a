//! The documents described as JSON Schema.

use super::document::Results;
use super::map::MapResults;

/// The JSON Schema (draft 2020-12) of [`Results`].
pub fn schema() -> serde_json::Value {
    schema_of::<Results>()
}

/// The JSON Schema (draft 2020-12) of [`MapResults`], `map.json`.
pub fn map_schema() -> serde_json::Value {
    schema_of::<MapResults>()
}

fn schema_of<T: schemars::JsonSchema>() -> serde_json::Value {
    let settings = schemars::generate::SchemaSettings::draft2020_12().for_serialize();
    settings.into_generator().into_root_schema_for::<T>().into()
}

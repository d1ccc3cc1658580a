//! Validates a document against a JSON Schema, for the tests of three crates.
//!
//! Only the keywords that the schemas of this project use are known. Another keyword is an error of the test, so that no
//! rule of a schema goes unchecked. `docs/check_exports.py` asks an independent validator about the same documents.

use serde_json::Value;

/// What is wrong with `document`, one line for each place. Empty if it follows `schema`.
///
/// # Panics
/// If the schema has a keyword that is not known here.
pub(crate) fn problems(schema: &Value, document: &Value) -> Vec<String> {
    let mut found = Vec::new();
    check(schema, schema, document, "", &mut found);
    found
}

fn check(root: &Value, schema: &Value, value: &Value, place: &str, found: &mut Vec<String>) {
    let rules = match schema {
        Value::Bool(allowed) => {
            if !allowed {
                found.push(format!("{place}: nothing is allowed here"));
            }
            return;
        }
        Value::Object(rules) => rules,
        other => panic!("{place}: {other} is no schema"),
    };
    let follows = |schema: &Value| {
        let mut problems = Vec::new();
        check(root, schema, value, place, &mut problems);
        problems.is_empty()
    };
    let mut no = |text: String| found.push(format!("{place}: {text}"));
    for (keyword, rule) in rules {
        let count = || rule.as_u64().expect("a count") as usize;
        match keyword.as_str() {
            "type" if !types(rule).iter().any(|name| is(name, value)) => {
                no(format!("{value} is not of type {rule}"));
            }
            "const" if rule != value => no(format!("{value} is not {rule}")),
            "enum" if !list(rule).contains(value) => no(format!("{value} is not in {rule}")),
            "anyOf" if !list(rule).iter().any(follows) => {
                no(format!("{value} follows none of {rule}"));
            }
            "oneOf" if list(rule).iter().filter(|s| follows(s)).count() != 1 => {
                no(format!("{value} does not follow one of {rule}"));
            }
            "required" => {
                let missing = |name: &&Value| value.get(name.as_str().expect("a name")).is_none();
                if value.is_object() {
                    let missing = list(rule).iter().filter(missing);
                    missing.for_each(|name| no(format!("{name} is missing")));
                }
            }
            "minimum" | "maximum" => {
                let limit = rule.as_f64().expect("a number");
                let outside = |x: f64| {
                    if keyword == "minimum" {
                        x < limit
                    } else {
                        x > limit
                    }
                };
                if value.as_f64().is_some_and(outside) {
                    no(format!("{value} is outside {keyword} {rule}"));
                }
            }
            "minItems" if value.as_array().is_some_and(|v| v.len() < count()) => {
                no(format!("fewer than {rule} items"));
            }
            "maxItems" if value.as_array().is_some_and(|v| v.len() > count()) => {
                no(format!("more than {rule} items"));
            }
            "pattern" => {
                assert_eq!(rule, "^([0-9a-f]{16})*$", "{place}: an unknown pattern");
                let hex = |t: &str| {
                    t.len().is_multiple_of(16)
                        && t.bytes().all(|b| b"0123456789abcdef".contains(&b))
                };
                if value.as_str().is_some_and(|text| !hex(text)) {
                    no(format!("{value} does not match {rule}"));
                }
            }
            // Followed, or checked below with the values that they are about, or no rules.
            "type"
            | "const"
            | "enum"
            | "anyOf"
            | "oneOf"
            | "minItems"
            | "maxItems"
            | "properties"
            | "additionalProperties"
            | "items"
            | "prefixItems"
            | "$ref"
            | "$schema"
            | "$defs"
            | "title"
            | "description"
            | "default"
            | "format" => {}
            other => panic!("{place}: the keyword {other} is not known"),
        }
    }
    check_inside(root, schema, value, place, found);
}

/// What a schema refers to, and the values inside of `value`.
fn check_inside(root: &Value, schema: &Value, value: &Value, place: &str, found: &mut Vec<String>) {
    let entry = |name: &str| schema.get(name).unwrap_or(&Value::Null);
    if let Some(name) = entry("$ref").as_str() {
        let inner = root.pointer(name.strip_prefix('#').expect("of this schema"));
        check(root, inner.expect(name), value, place, found);
    }
    for (name, value) in value.as_object().into_iter().flatten() {
        let rule = entry("properties").get(name);
        if let Some(rule) = rule.or(schema.get("additionalProperties")) {
            check(root, rule, value, &format!("{place}/{name}"), found);
        }
    }
    for (at, value) in value.as_array().into_iter().flatten().enumerate() {
        let rule = entry("prefixItems").get(at);
        if let Some(rule) = rule.or(schema.get("items")) {
            check(root, rule, value, &format!("{place}/{at}"), found);
        }
    }
}

fn list(rule: &Value) -> &[Value] {
    rule.as_array().expect("a list")
}

fn types(rule: &Value) -> Vec<&str> {
    let name = |v| Value::as_str(v).expect("a type");
    rule.as_array()
        .map_or_else(|| vec![name(rule)], |all| all.iter().map(name).collect())
}

fn is(name: &str, value: &Value) -> bool {
    match name {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "string" => value.is_string(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        "number" => value.is_number(),
        "integer" => value.as_f64().is_some_and(|x| x.fract() == 0.0),
        other => panic!("{other} is no type"),
    }
}

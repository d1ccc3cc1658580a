//! What happens, told to the one page there is: a line of JSON for each event on the standard output, which the page reads.

use serde_json::{Value, json};

/// All events.
#[derive(Debug)]
pub(crate) struct Hub;

impl Hub {
    /// Tells the page.
    pub(crate) fn tell(&self, kind: &'static str, value: &Value) {
        println!("{}", json!([kind, value]));
    }
}

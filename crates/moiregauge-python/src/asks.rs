//! Requests of the pipeline, as JSON in and JSON out.

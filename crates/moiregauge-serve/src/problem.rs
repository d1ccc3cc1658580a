//! What is answered where something is wrong.

use axum::Json;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use serde::Serialize;

/// Something is wrong, in words.
#[derive(Clone, Debug)]
pub(crate) struct Problem {
    pub(crate) status: StatusCode,
    said: Said,
}

#[derive(Clone, Debug, Serialize)]
struct Said {
    error: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    what: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none", rename = "where")]
    place: Option<String>,
}

/// What a route gives.
pub(crate) type Answer<T = Response> = Result<T, Problem>;

impl Problem {
    pub(crate) fn new(status: StatusCode, error: impl Into<String>) -> Self {
        Self {
            status,
            said: Said {
                error: error.into(),
                what: None,
                place: None,
            },
        }
    }

    /// What was asked makes no sense.
    pub(crate) fn wrong(error: impl std::fmt::Display) -> Self {
        Self::new(StatusCode::BAD_REQUEST, error.to_string())
    }

    /// There is no such thing.
    pub(crate) fn missing(error: impl Into<String>) -> Self {
        Self::new(StatusCode::NOT_FOUND, error)
    }

    /// It cannot be done now.
    pub(crate) fn conflict(error: impl Into<String>) -> Self {
        Self::new(StatusCode::CONFLICT, error)
    }

    /// What was asked is understood, and cannot be done with these files.
    pub(crate) fn unusable(error: &dyn std::error::Error) -> Self {
        let words = moiregauge_pipeline::names::in_full(error);
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, words)
    }

    /// A fault of ours.
    pub(crate) fn fault(error: impl std::fmt::Display) -> Self {
        Self::new(StatusCode::INTERNAL_SERVER_ERROR, error.to_string())
    }

    /// With what was expected and found.
    #[must_use]
    pub(crate) fn what(mut self, what: impl Into<String>) -> Self {
        self.said.what = Some(what.into());
        self
    }

    /// With the file or field it is about.
    #[must_use]
    pub(crate) fn at(mut self, place: impl Into<String>) -> Self {
        self.said.place = Some(place.into());
        self
    }

    /// The words.
    pub(crate) fn words(&self) -> &str {
        &self.said.error
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        (self.status, Json(self.said)).into_response()
    }
}

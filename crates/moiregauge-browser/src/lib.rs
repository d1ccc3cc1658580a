//! The routes of `moiregauge serve` as WebAssembly: what asks and what answers are files of the memory that the page gives
//! (WASI preview 1), so that nothing but numbers goes through the functions that are called.
//!
//! `/ask/request` and `/ask/answer`: a line of JSON (`{"method", "path"}`, `{"status", "headers"}`), then the body. What was
//! dropped lies in `/dropped`, works are kept in `/kept`. Events are lines of JSON on the standard output.
#![cfg(target_family = "wasm")]

#[cfg(no_threads_in_libc)]
mod threads;

use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::path::Path;

use axum::http::{Request, header};
use moiregauge_serve::{Alone, Options};
use serde::Deserialize;
use serde_json::{Map, Value, json};

thread_local! {
    static ROUTES: OnceCell<Alone> = const { OnceCell::new() };
}

#[derive(Deserialize)]
struct Head {
    method: String,
    path: String,
}

type Failed = Box<dyn std::error::Error>;

/// Answers what stands in `/ask/request`; 0: there is an answer.
#[expect(unsafe_code, reason = "the page finds the function by its name")]
#[unsafe(no_mangle)]
pub extern "C" fn answer() -> i32 {
    match answered() {
        Ok(()) => 0,
        Err(error) => {
            eprintln!("{error}");
            1
        }
    }
}

/// Does what was begun and waits longest; how many milliseconds there is nothing to do then, -1: for ever.
#[expect(unsafe_code, reason = "the page finds the function by its name")]
#[unsafe(no_mangle)]
pub extern "C" fn turn() -> i32 {
    let rest = with(|routes| Ok(routes.turn())).ok().flatten();
    rest.map_or(-1, |rest| rest.as_millis().try_into().unwrap_or(i32::MAX))
}

fn with<T>(what: impl FnOnce(&Alone) -> Result<T, Failed>) -> Result<T, Failed> {
    ROUTES.with(|cell| {
        if cell.get().is_none() {
            let options = Options {
                keep: Some("/kept".into()),
                ..Options::default()
            };
            // There is one thread: nobody was faster.
            let _ = cell.set(Alone::new(&options, Path::new("/dropped"))?);
        }
        what(cell.get().ok_or("no routes")?)
    })
}

fn answered() -> Result<(), Failed> {
    let asked = std::fs::read("/ask/request")?;
    let end = asked.iter().position(|&byte| byte == b'\n');
    let end = end.ok_or("a request without a head")?;
    let head: Head = serde_json::from_slice(&asked[..end])?;
    let request = Request::builder()
        .method(head.method.as_str())
        .uri(head.path)
        .header(header::CONTENT_TYPE, "application/json")
        .body(asked[end + 1..].to_vec())?;
    let answer = with(|routes| routes.answer(request).ok_or_else(|| "no answer".into()));
    let (head, body) = answer?;
    let headers: BTreeMap<&str, &str> = head
        .headers()
        .iter()
        .filter_map(|(name, value)| Some((name.as_str(), value.to_str().ok()?)))
        .collect();
    let headers: Map<String, Value> = headers
        .into_iter()
        .map(|(name, value)| (name.to_owned(), value.into()))
        .collect();
    let mut all = json!({"status": head.status().as_u16(), "headers": headers}).to_string();
    all.push('\n');
    let mut bytes = all.into_bytes();
    bytes.extend(body);
    std::fs::write("/ask/answer", bytes)?;
    Ok(())
}

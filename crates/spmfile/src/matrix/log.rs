//! The log of a session: every parameter at its start, every change, every file stored.
//!
//! Played from its start to the line that names a file, it yields the state in which that file was
//! stored.

use std::collections::{BTreeMap, HashMap};

use super::blocks::{self, Block, Value, cursor, letters};
use super::format::{MAGIC, damaged};
use crate::cursor::Cursor;
use crate::error::ReadError;

/// A parameter.
#[derive(Clone, Debug)]
pub(super) struct Property {
    pub(super) value: Value,
    /// As in `Meter`.
    pub(super) unit: String,
    /// When it last became another one, seconds since 1970; 0 if it never did.
    pub(super) changed: u64,
}

/// One of the axes along which a quantity is recorded.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    /// As in `Default::XYScanner::X`.
    pub(super) name: String,
    /// Run forth and back: half of its samples are those of the way back.
    pub(super) mirrored: bool,
    /// The next slower one.
    pub(super) slower: u64,
}

/// What is recorded along an axis.
#[derive(Clone, Debug)]
pub(super) struct Quantity {
    /// As in `Z`.
    pub(super) name: String,
    pub(super) unit: String,
    /// The fastest of its axes.
    pub(super) axis: u64,
}

/// How counts become values.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Transfer {
    /// As in `TFF_Linear1D`.
    pub(super) kind: String,
    pub(super) unit: String,
    pub(super) numbers: Vec<(String, f64)>,
}

/// What holds at a point of the log.
#[derive(Debug, Default)]
pub(super) struct State {
    /// The program and its version.
    pub(super) program: String,
    /// Names of parameters, as in `XYScanner.Width`, in the order of the file.
    pub(super) names: Vec<String>,
    pub(super) properties: HashMap<String, Property>,
    pub(super) axes: HashMap<u64, Axis>,
    /// Samples of an axis, both ways together where it is mirrored.
    pub(super) lengths: HashMap<u64, u32>,
    pub(super) quantities: BTreeMap<u64, Quantity>,
    /// Channel → quantity.
    pub(super) channels: HashMap<u64, u64>,
    /// Quantity → transfer function.
    pub(super) transfers: HashMap<u64, Transfer>,
    /// What the user noted.
    pub(super) marks: BTreeMap<String, String>,
    /// When the file was stored, seconds since 1970.
    pub(super) stored: u64,
}

/// The state in which `file_name` was stored; `None` if no part of the log names it.
pub(super) fn play(parts: &[&[u8]], file_name: &str) -> Result<Option<State>, ReadError> {
    let mut state = State::default();
    for part in parts {
        let mut c = cursor(part).at(MAGIC.len());
        while c.left() > 0 {
            // A log that is still being written may end in the middle of a block.
            let Ok(block) = blocks::timed(&mut c) else {
                break;
            };
            let place = c.position() - block.body.len();
            let named = state.take(&block).map_err(|e| {
                let mark = letters(block.mark);
                damaged(format!("the log, block {mark} at byte {place}: {e}"))
            })?;
            if named.is_some_and(|name| name.eq_ignore_ascii_case(file_name)) {
                state.stored = block.time;
                return Ok(Some(state));
            }
        }
    }
    Ok(None)
}

/// The names of all files that the log names, in order.
pub(super) fn files(parts: &[&[u8]]) -> Vec<String> {
    let mut names = Vec::new();
    for part in parts {
        let mut c = cursor(part).at(MAGIC.len());
        while let Ok(block) = blocks::timed(&mut c) {
            if &block.mark == b"BREF" {
                names.extend(named(block.body));
            }
        }
    }
    names
}

/// The file that a block `BREF` names.
fn named(body: &[u8]) -> Result<String, String> {
    let mut c = cursor(body);
    c.skip(4)?;
    blocks::text(&mut c)
}

impl State {
    /// Takes in a block; returns the name of a file that was stored.
    fn take(&mut self, block: &Block<'_>) -> Result<Option<String>, String> {
        let mut c = cursor(block.body);
        match &block.mark {
            b"META" => {
                let words = [blocks::text(&mut c)?, blocks::text(&mut c)?];
                words.join(" ").trim().clone_into(&mut self.program);
            }
            b"EEPA" => self.initial(&mut c)?,
            b"PMOD" => {
                c.skip(4)?;
                let group = blocks::text(&mut c)?;
                self.property(&group, &mut c, block.time)?;
            }
            b"CCSY" => self.channel_system(&mut c)?,
            b"MARK" => {
                let mark = blocks::text(&mut c)?;
                if let Some((key, words)) = mark
                    .strip_prefix("MTRX$")
                    .and_then(|mark| mark.split_once('-'))
                {
                    self.marks.insert(key.to_owned(), words.to_owned());
                }
            }
            b"BREF" => return named(block.body).map(Some),
            // Windows, steps of processing, states of recording, and what is not known.
            _ => {}
        }
        Ok(None)
    }

    /// All parameters, in groups.
    fn initial(&mut self, c: &mut Cursor<'_>) -> Result<(), String> {
        c.skip(4)?;
        for _ in 0..c.u32()? {
            let group = blocks::text(c)?;
            for _ in 0..c.u32()? {
                self.property(&group, c, 0)?;
            }
        }
        Ok(())
    }

    /// A parameter of a group: name, unit, a number of no known use, value.
    fn property(&mut self, group: &str, c: &mut Cursor<'_>, time: u64) -> Result<(), String> {
        let name = format!("{group}.{}", blocks::text(c)?);
        let unit = blocks::text(c)?;
        c.skip(4)?;
        let value = blocks::value(c)?;
        let changed = match self.properties.get(&name) {
            Some(old) if old.value == value => old.changed,
            _ => time,
        };
        if !self.properties.contains_key(&name) {
            self.names.push(name.clone());
        }
        let property = Property {
            value,
            unit,
            changed,
        };
        self.properties.insert(name, property);
        Ok(())
    }

    /// What is recorded along what, and how counts become values. Later blocks renew parts of it.
    fn channel_system(&mut self, c: &mut Cursor<'_>) -> Result<(), String> {
        c.skip(4)?;
        while c.left() > 0 {
            let block = blocks::inner(c)?;
            let mut c = cursor(block.body);
            match &block.mark {
                b"DICT" => self.dictionary(&mut c)?,
                // It serves to check, and not all of it is understood.
                b"CHCS" => self.axis_lengths(&mut c).unwrap_or_default(),
                b"XFER" => self.transfer_functions(&mut c)?,
                _ => {}
            }
        }
        Ok(())
    }

    fn dictionary(&mut self, c: &mut Cursor<'_>) -> Result<(), String> {
        c.skip(8)?;
        for _ in 0..c.u32()? {
            let (key, slower) = (c.u64()?, c.u64()?);
            let name = blocks::text(c)?;
            let mirrored = blocks::text(c)? == "triangular";
            let axis = Axis {
                name,
                mirrored,
                slower,
            };
            self.axes.insert(key, axis);
        }
        for _ in 0..c.u32()? {
            let (key, axis) = (c.u64()?, c.u64()?);
            let (name, unit) = (blocks::text(c)?, blocks::text(c)?);
            self.quantities.insert(key, Quantity { name, unit, axis });
        }
        // Not every description knows of this list.
        for _ in 0..c.u32().unwrap_or(0) {
            let (key, quantity) = (c.u64()?, c.u64()?);
            blocks::text(c)?;
            self.channels.insert(key, quantity);
        }
        Ok(())
    }

    fn axis_lengths(&mut self, c: &mut Cursor<'_>) -> Result<(), String> {
        for _ in 0..c.u32()? {
            let (key, length) = (c.u64()?, c.u32()?);
            c.skip(8)?;
            self.lengths.insert(key, length);
        }
        Ok(())
    }

    fn transfer_functions(&mut self, c: &mut Cursor<'_>) -> Result<(), String> {
        while c.left() > 0 {
            let key = c.u64()?;
            let (kind, unit) = (blocks::text(c)?, blocks::text(c)?);
            let mut numbers = Vec::new();
            for _ in 0..c.u32()? {
                let name = blocks::text(c)?;
                if let Some(number) = blocks::value(c)?.number() {
                    numbers.push((name, number));
                }
            }
            let transfer = Transfer {
                kind,
                unit,
                numbers,
            };
            self.transfers.insert(key, transfer);
        }
        Ok(())
    }

    fn scanner(&self, names: &[&str]) -> Option<&Property> {
        names
            .iter()
            .find_map(|name| self.properties.get(&format!("XYScanner.{name}")))
    }

    /// A number of the scanner, times the factor of its unit.
    pub(super) fn quantity(&self, names: &[&str], units: &[(&str, f64)]) -> Option<f64> {
        let property = self.scanner(names)?;
        let (_, factor) = units.iter().find(|(unit, _)| *unit == property.unit)?;
        Some(property.value.number()? * factor)
    }

    /// A count of the scanner.
    pub(super) fn count(&self, names: &[&str]) -> Option<u32> {
        match self.scanner(names)?.value {
            Value::Long(n) => u32::try_from(n).ok(),
            _ => None,
        }
    }

    /// A parameter of the scanner, whatever it is.
    pub(super) fn any(&self, names: &[&str]) -> Option<&Value> {
        Some(&self.scanner(names)?.value)
    }

    /// A switch of the scanner.
    pub(super) fn switch(&self, name: &str) -> Option<bool> {
        self.scanner(&[name])?.value.truth()
    }

    /// Whether the scanner's parameter changed at `since` or later, seconds since 1970.
    pub(super) fn changed(&self, name: &str, since: u64) -> bool {
        let property = self.scanner(&[name]);
        property.is_some_and(|p| p.changed > 0 && p.changed >= since)
    }
}

//! The container → a scan.

use std::borrow::Cow;
use std::collections::BTreeMap;

use crate::cursor::{Cursor, Endian};
use crate::error::ReadError;
use crate::header::ChannelHeader;
use crate::labels;
use crate::outline::{Input, Outline};
use crate::raster::{self, Encoding, Order};
use crate::scan::{ChannelInfo, Scan};
use crate::stored::Flat;
use crate::units;
use crate::whole::MOST_CHANNELS;
use crate::words;

const FORMAT: &str = "Gwyddion";

fn damaged(reason: impl Into<String>) -> ReadError {
    ReadError::damaged(FORMAT, reason)
}

/// One named value within an object; texts, objects and arrays as their bytes.
#[derive(Clone, Copy)]
struct Item<'a> {
    name: &'a [u8],
    value: Value<'a>,
}

#[derive(Clone, Copy)]
enum Value<'a> {
    Integer(i32),
    Double(f64),
    Text(&'a [u8]),
    Doubles(&'a [u8]),
    Object(Object<'a>),
    Other,
}

/// An object: the name of its type and the bytes of its items.
#[derive(Clone, Copy)]
struct Object<'a> {
    kind: &'a [u8],
    items: &'a [u8],
}

impl<'a> Object<'a> {
    /// Reads the head of an object; its items must lie within the bytes.
    fn read(cursor: &mut Cursor<'a>) -> Result<Self, String> {
        let kind = cursor.until_nul("the name of an object")?;
        let length = cursor.u32()? as usize;
        Ok(Self {
            kind,
            items: cursor.slice(length, "an object")?,
        })
    }

    /// The items in order; stops at the first that is damaged, with the reason.
    fn items(self) -> impl Iterator<Item = Result<Item<'a>, String>> {
        let mut cursor = Cursor::new(self.items, Endian::Little);
        let mut failed = false;
        std::iter::from_fn(move || {
            if failed || cursor.left() == 0 {
                return None;
            }
            let item = item(&mut cursor);
            failed = item.is_err();
            Some(item)
        })
    }

    /// The value of the item `name`.
    fn get(self, name: &str) -> Option<Value<'a>> {
        self.items()
            .map_while(Result::ok)
            .find(|item| item.name == name.as_bytes())
            .map(|item| item.value)
    }

    fn integer(self, name: &str) -> Option<i32> {
        match self.get(name)? {
            Value::Integer(n) => Some(n),
            _ => None,
        }
    }

    fn double(self, name: &str) -> Option<f64> {
        match self.get(name)? {
            Value::Double(n) => Some(n).filter(|n| n.is_finite()),
            _ => None,
        }
    }

    fn object(self, name: &str) -> Option<Object<'a>> {
        match self.get(name)? {
            Value::Object(object) => Some(object),
            _ => None,
        }
    }

    /// The unit that the object `name` holds.
    fn unit(self, name: &str) -> String {
        match self.object(name).and_then(|unit| unit.get("unitstr")) {
            Some(Value::Text(unit)) => text(unit),
            _ => String::new(),
        }
    }
}

fn text(bytes: &[u8]) -> String {
    words::decode(bytes).trim().to_owned()
}

fn item<'a>(cursor: &mut Cursor<'a>) -> Result<Item<'a>, String> {
    let name = cursor.until_nul("the name of an item")?;
    let kind = cursor.u8()?;
    let skip = |cursor: &mut Cursor<'a>, width: usize| -> Result<&'a [u8], String> {
        let count = cursor.u32()? as usize;
        let length = count.checked_mul(width).ok_or("an array beyond memory")?;
        cursor.slice(length, "an array")
    };
    let value = match kind {
        b'b' | b'c' => {
            cursor.skip(1)?;
            Value::Other
        }
        b'i' => Value::Integer(cursor.i32()?),
        b'q' => {
            cursor.skip(8)?;
            Value::Other
        }
        b'd' => Value::Double(cursor.f64()?),
        b's' => Value::Text(cursor.until_nul("a text")?),
        b'o' => Value::Object(Object::read(cursor)?),
        b'C' => {
            skip(cursor, 1)?;
            Value::Other
        }
        b'I' => {
            skip(cursor, 4)?;
            Value::Other
        }
        b'Q' => {
            skip(cursor, 8)?;
            Value::Other
        }
        b'D' => Value::Doubles(skip(cursor, 8)?),
        b'S' => {
            for _ in 0..cursor.u32()? {
                cursor.until_nul("a text")?;
            }
            Value::Other
        }
        b'O' => {
            for _ in 0..cursor.u32()? {
                Object::read(cursor)?;
            }
            Value::Other
        }
        other => {
            return Err(format!(
                "item {:?} is of the unknown kind {:?}",
                text(name),
                char::from(other)
            ));
        }
    };
    Ok(Item { name, value })
}

/// Reads the headers and finds the samples.
pub(crate) fn open<'a>(input: &Input<'a>) -> Result<Outline<'a>, ReadError> {
    let bytes = input.bytes;
    if bytes.starts_with(b"GWYO") {
        return Err(ReadError::Unsupported {
            format: FORMAT,
            reason: "it was written by version 1; save it again with a newer one".to_owned(),
        });
    }
    let (container, cut_off) = container(bytes)?;
    let Found {
        mut fields,
        titles,
        metas,
        failure,
    } = Found::of(container);
    if fields.len() > MOST_CHANNELS {
        return Err(ReadError::TooManyChannels {
            found: fields.len(),
            limit: MOST_CHANNELS,
        });
    }
    fields.sort_by_key(|(number, _)| *number);
    if fields.is_empty() && failure.is_none() {
        return Err(ReadError::Unsupported {
            format: FORMAT,
            reason: "it holds no image (no item /N/data)".to_owned(),
        });
    }
    let meta = |number: u32| metas.get(&number).copied().map_or_else(Vec::new, texts);
    let mut outline = Outline::of(frame(&fields, &meta));
    for (number, field) in fields {
        let title = titles
            .get(&number)
            .map_or_else(String::new, |title| text(title));
        let lines = meta(number);
        let own = |key: &str| labels::value(&lines, key).map(str::to_owned);
        let info = ChannelInfo {
            line_direction: labels::stated_direction(&lines)
                .or_else(|| labels::line_direction(&title)),
            name: title,
            internal_name: own("internal name").unwrap_or_default(),
            scan_line: own("scan line"),
        };
        let name = info.name.clone();
        let (mut header, samples) =
            channel(field, info).map_err(|e| damaged(format!("image {name:?}: {e}")))?;
        header.plane_fit = own("plane fit");
        outline.add_flat(header, samples);
    }
    match failure {
        Some(reason) if !cut_off || outline.channels.is_empty() => Err(damaged(reason)),
        failure => {
            outline.damage = failure;
            Ok(outline)
        }
    }
}

/// What the container holds of images, by their numbers.
#[derive(Default)]
struct Found<'a> {
    fields: Vec<(u32, Object<'a>)>,
    titles: BTreeMap<u32, &'a [u8]>,
    metas: BTreeMap<u32, Object<'a>>,
    /// Why its items could not be followed to their end.
    failure: Option<String>,
}

impl<'a> Found<'a> {
    fn of(container: Object<'a>) -> Self {
        let mut found = Self::default();
        for item in container.items() {
            let item = match item {
                Ok(item) => item,
                Err(error) => {
                    found.failure = Some(error);
                    break;
                }
            };
            let number = |behind: &str| number_of(item.name, behind);
            match item.value {
                Value::Object(object) if object.kind == b"GwyDataField" => {
                    found.fields.extend(number("/data").map(|n| (n, object)));
                }
                Value::Object(object) => {
                    found.metas.extend(number("/meta").map(|n| (n, object)));
                }
                Value::Text(title) => {
                    found
                        .titles
                        .extend(number("/data/title").map(|n| (n, title)));
                }
                _ => {}
            }
        }
        found
    }
}

/// The outermost object, and whether the file ends before it does.
fn container(bytes: &[u8]) -> Result<(Object<'_>, bool), ReadError> {
    let mut cursor = Cursor::new(bytes, Endian::Little).at(4);
    let kind = cursor
        .until_nul("the name of the container")
        .map_err(damaged)?;
    if kind != b"GwyContainer" {
        return Err(damaged(format!(
            "expected a GwyContainer, found {:?}",
            text(kind)
        )));
    }
    let length = cursor.u32().map_err(damaged)? as usize;
    let cut_off = cursor.left() < length;
    let items = cursor
        .slice(length.min(cursor.left()), "the container")
        .map_err(damaged)?;
    Ok((Object { kind, items }, cut_off))
}

/// N of an item named `/N/…`.
fn number_of(name: &[u8], behind: &str) -> Option<u32> {
    let name = std::str::from_utf8(name).ok()?;
    name.strip_prefix('/')?.strip_suffix(behind)?.parse().ok()
}

fn resolution(field: Object<'_>) -> Result<[usize; 2], String> {
    let size = |key: &str| match field.integer(key) {
        Some(n) if n > 0 => Ok(n as usize),
        found => Err(format!("expected a number {key} above 0, found {found:?}")),
    };
    Ok([size("xres")?, size("yres")?])
}

/// Width and height in nm, if the lateral unit is a length.
fn size_nm(field: Object<'_>) -> Option<[f64; 2]> {
    let nm = units::nm_per(&field.unit("si_unit_xy"))?;
    let length = |key: &str| field.double(key).map(|n| n * nm).filter(|&n| n > 0.0);
    Some([length("xreal")?, length("yreal")?])
}

fn channel(field: Object<'_>, info: ChannelInfo) -> Result<(ChannelHeader, Flat<'_>), String> {
    let [columns, rows] = resolution(field)?;
    let Some(Value::Doubles(data)) = field.get("data") else {
        return Err("it has no samples".to_owned());
    };
    let expected = raster::byte_length(rows, columns, Encoding::F64);
    if expected != Some(data.len()) {
        return Err(format!(
            "expected {rows} lines of {columns} samples, found {} samples",
            data.len() / 8
        ));
    }
    let top_first = Order {
        top_first: true,
        mirrored: false,
    };
    let header = ChannelHeader::new(info, rows, columns)
        .in_unit(&field.unit("si_unit_z"))
        .of_size(size_nm(field));
    let samples = Flat::block(Cow::Borrowed(data), Encoding::F64, Endian::Little);
    Ok((header, samples.in_order(top_first)))
}

/// Everything but the channels: the first image's size and place, the header it came with.
fn frame(fields: &[(u32, Object<'_>)], meta: &dyn Fn(u32) -> Vec<(String, String)>) -> Scan {
    let mut scan = Scan {
        format: FORMAT.to_owned(),
        ..Scan::default()
    };
    let Some(&(number, first)) = fields.first() else {
        return scan;
    };
    let sizes: Vec<Option<[f64; 2]>> = fields.iter().map(|(_, field)| size_nm(*field)).collect();
    if sizes.iter().all(|size| *size == sizes[0]) {
        scan.size_nm = sizes[0];
    }
    if let (Some([width, height]), Some(nm)) =
        (size_nm(first), units::nm_per(&first.unit("si_unit_xy")))
    {
        let offset = |key: &str| first.double(key).unwrap_or(0.0) * nm;
        if first.get("xoff").is_some() || first.get("yoff").is_some() {
            scan.offset_nm = [offset("xoff") + 0.5 * width, offset("yoff") + 0.5 * height];
        }
    }
    scan.metadata = meta(number);
    labels::apply(&mut scan);
    scan
}

/// The texts of an object by name.
fn texts(object: Object<'_>) -> Vec<(String, String)> {
    let texts = object.items().map_while(Result::ok);
    texts
        .filter_map(|item| match item.value {
            Value::Text(value) => Some((text(item.name), text(value))),
            _ => None,
        })
        .collect()
}

#[cfg(test)]
mod tests;

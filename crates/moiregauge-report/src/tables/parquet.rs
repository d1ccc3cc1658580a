//! The tables as Parquet: the columns of the CSV files with their names, and types.
//!
//! Numbers are doubles, counts 64-bit integers, answers booleans, everything else is text in UTF-8;
//! what is not known is null. The meaning of each column is in the file's metadata, under its name.
//! Pages are neither compressed nor dated: the same results give the same bytes.

use std::sync::Arc;

use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use super::budget::BudgetRow;
use super::columns::{Row, ScanRow, SetRow, VectorRow};
use super::csv::Column;
use crate::error::ReportError;
use crate::results::Results;

/// All tables as named files.
pub(crate) fn parquet_tables(results: &Results) -> Result<Vec<(String, Vec<u8>)>, ReportError> {
    let words = |error: ParquetError| ReportError::Parquet(error.to_string());
    Ok(vec![
        (
            "vectors.parquet".to_owned(),
            table::<VectorRow<'_>>(results).map_err(words)?,
        ),
        (
            "scans.parquet".to_owned(),
            table::<ScanRow<'_>>(results).map_err(words)?,
        ),
        (
            "sets.parquet".to_owned(),
            table::<SetRow<'_>>(results).map_err(words)?,
        ),
        (
            "budget.parquet".to_owned(),
            table::<BudgetRow<'_>>(results).map_err(words)?,
        ),
    ])
}

/// What a column holds.
#[derive(Clone, Copy)]
enum Kind {
    Number,
    Count,
    Answer,
    Text,
}

impl Kind {
    /// By the name: whatever is not listed is a number, as most columns are.
    fn of(column: &str) -> Self {
        match column {
            "set" | "file" | "frame_direction" | "vector" | "coordinates" | "acquired"
            | "slow_axis" | "channel" | "source" | "excluded" | "sample" | "status" | "caveats"
            | "error" => Self::Text,
            "scan" | "scans" | "moire" | "failed_files" => Self::Count,
            "drift_given" | "within_one_percent" => Self::Answer,
            _ => Self::Number,
        }
    }

    fn physical(self) -> Physical {
        match self {
            Self::Number => Physical::DOUBLE,
            Self::Count => Physical::INT64,
            Self::Answer => Physical::BOOLEAN,
            Self::Text => Physical::BYTE_ARRAY,
        }
    }
}

fn table<'a, R: Row<'a>>(results: &'a Results) -> Result<Vec<u8>, ParquetError> {
    of_rows(R::COLUMNS, &R::rows(results))
}

/// Any table.
pub(crate) fn parquet_of<R>(columns: &[Column<R>], rows: &[R]) -> Result<Vec<u8>, ReportError> {
    of_rows(columns, rows).map_err(|error| ReportError::Parquet(error.to_string()))
}

fn of_rows<R>(columns: &[Column<R>], rows: &[R]) -> Result<Vec<u8>, ParquetError> {
    let fields = columns
        .iter()
        .map(|column| {
            let kind = Kind::of(column.name);
            let text = matches!(kind, Kind::Text).then_some(LogicalType::String);
            Type::primitive_type_builder(column.name, kind.physical())
                .with_repetition(Repetition::OPTIONAL)
                .with_logical_type(text)
                .build()
                .map(Arc::new)
        })
        .collect::<Result<_, _>>()?;
    let schema = Type::group_type_builder("schema")
        .with_fields(fields)
        .build()?;
    let about = columns
        .iter()
        .map(|c| KeyValue::new(c.name.to_owned(), c.about.to_owned()))
        .collect();
    let properties = WriterProperties::builder()
        .set_created_by("moiregauge".to_owned())
        .set_key_value_metadata(Some(about))
        .build();
    let mut bytes = Vec::new();
    let mut writer = SerializedFileWriter::new(&mut bytes, Arc::new(schema), Arc::new(properties))?;
    let mut group = writer.next_row_group()?;
    for column in columns {
        let Some(mut out) = group.next_column()? else {
            return Err(ParquetError::General("a column is missing".to_owned()));
        };
        let cells: Vec<String> = rows.iter().map(|row| (column.value)(row)).collect();
        // 1 where there is a value, 0 where there is none.
        let present: Vec<i16> = cells.iter().map(|c| i16::from(!c.is_empty())).collect();
        let known = || cells.iter().filter(|c| !c.is_empty());
        let wrong =
            |cell: &str| ParquetError::General(format!("column {}: found {cell:?}", column.name));
        macro_rules! parsed {
            ($kind:ty) => {{
                let values: Vec<_> = known()
                    .map(|cell| cell.parse().map_err(|_| wrong(cell)))
                    .collect::<Result<_, _>>()?;
                out.typed::<$kind>()
                    .write_batch(&values, Some(&present), None)?;
            }};
        }
        match Kind::of(column.name) {
            Kind::Number => parsed!(DoubleType),
            Kind::Count => parsed!(Int64Type),
            Kind::Answer => parsed!(BoolType),
            Kind::Text => {
                let values: Vec<ByteArray> = known().map(|c| c.as_str().into()).collect();
                out.typed::<ByteArrayType>()
                    .write_batch(&values, Some(&present), None)?;
            }
        }
        out.close()?;
    }
    group.close()?;
    writer.close()?;
    Ok(bytes)
}

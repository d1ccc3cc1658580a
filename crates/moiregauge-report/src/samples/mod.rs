//! Many samples: one row for each moiré of each, one table, one page.

mod page;
mod row;
mod table;
mod thumbnail;

pub use page::{SamplesPage, samples_page};
pub use row::{SampleRow, SampleStatus};
#[cfg(feature = "parquet")]
pub use table::samples_parquet;
pub use table::{failed_csv, samples_csv};
pub use thumbnail::thumbnail;

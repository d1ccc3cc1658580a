//! Numbers → pictures, tables and the report. No measuring.

//! The bytes of a file that need not lie in memory.

use std::borrow::Cow;
use std::io::{Error, ErrorKind, Read, Result, Seek, SeekFrom};
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::ReadError;

/// Bytes that are read where they are wanted: a file on a disk, a part of an archive, an object in a store.
pub trait Source: Send + Sync {
    /// Number of bytes.
    ///
    /// # Errors
    /// It cannot be told.
    fn length(&self) -> Result<u64>;

    /// Fills `into` with the bytes from `at` on.
    ///
    /// # Errors
    /// The bytes cannot be read, or end before.
    fn read_at(&self, at: u64, into: &mut [u8]) -> Result<()>;
}

impl Source for [u8] {
    fn length(&self) -> Result<u64> {
        Ok(self.len() as u64)
    }

    fn read_at(&self, at: u64, into: &mut [u8]) -> Result<()> {
        let start = usize::try_from(at).ok();
        let end = start.and_then(|start| start.checked_add(into.len()));
        let found = start.zip(end).and_then(|(start, end)| self.get(start..end));
        let found = found.ok_or_else(|| Error::from(ErrorKind::UnexpectedEof))?;
        into.copy_from_slice(found);
        Ok(())
    }
}

impl Source for &[u8] {
    fn length(&self) -> Result<u64> {
        (**self).length()
    }

    fn read_at(&self, at: u64, into: &mut [u8]) -> Result<()> {
        (**self).read_at(at, into)
    }
}

/// Whatever can be read and sought, such as [`std::fs::File`]: one reading at a time.
#[derive(Debug)]
pub struct Seekable<T>(Mutex<T>);

impl<T: Read + Seek> Seekable<T> {
    /// Takes it over; where it stands makes no difference.
    pub fn new(inner: T) -> Self {
        Self(Mutex::new(inner))
    }
}

impl<T: Read + Seek + Send> Source for Seekable<T> {
    fn length(&self) -> Result<u64> {
        let mut inner = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        inner.seek(SeekFrom::End(0))
    }

    fn read_at(&self, at: u64, into: &mut [u8]) -> Result<()> {
        let mut inner = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        inner.seek(SeekFrom::Start(at))?;
        inner.read_exact(into)
    }
}

/// Where a file's bytes are.
#[derive(Clone)]
pub(crate) enum Data<'a> {
    Bytes(&'a [u8]),
    Source(Arc<dyn Source + 'a>),
}

impl Data<'_> {
    /// `length` bytes from `at` on.
    pub(crate) fn get(&self, at: u64, length: usize) -> Bytes<'_> {
        let failed = |error: &Error| ReadError::Source {
            at,
            length,
            reason: error.to_string(),
        };
        match self {
            Data::Bytes(bytes) => {
                let start = usize::try_from(at).ok();
                let end = start.and_then(|start| start.checked_add(length));
                let found = start
                    .zip(end)
                    .and_then(|(start, end)| bytes.get(start..end));
                let found = found.map(Cow::Borrowed);
                found.ok_or_else(|| failed(&Error::from(ErrorKind::UnexpectedEof)))
            }
            Data::Source(source) => {
                let mut buffer = vec![0; length];
                let read = source.read_at(at, &mut buffer);
                read.map_err(|error| failed(&error))?;
                Ok(Cow::Owned(buffer))
            }
        }
    }
}

/// A part of a file.
pub(crate) type Bytes<'d> = std::result::Result<Cow<'d, [u8]>, ReadError>;

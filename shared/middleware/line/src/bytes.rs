//! Little-endian fields, written to and read from fixed buffers.

use crate::frame::{Frame, MAX_FIELDS};

/// A message under construction: type and fields.
pub(crate) struct Writer {
    bytes: [u8; MAX_FIELDS],
    length: usize,
}

impl Writer {
    /// A message of type `kind` without fields.
    pub(crate) fn new(kind: u8) -> Self {
        let mut writer = Self { bytes: [0; MAX_FIELDS], length: 0 };
        writer.put(kind.to_le_bytes());
        writer
    }

    /// Appends one field. The buffer holds the longest message, so there is always room.
    pub(crate) fn put<const N: usize>(&mut self, field: [u8; N]) {
        self.bytes[self.length..self.length + N].copy_from_slice(&field);
        self.length += N;
    }

    /// The message as a frame.
    pub(crate) fn finish(&self) -> Frame {
        Frame::seal(&self.bytes[..self.length])
    }
}

/// The fields of a received message, one after the other; `None` once they are exhausted.
pub(crate) struct Fields<'a>(pub(crate) &'a [u8]);

impl Fields<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (field, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*field)
    }

    pub(crate) fn u8(&mut self) -> Option<u8> {
        self.take().map(u8::from_le_bytes)
    }

    pub(crate) fn u16(&mut self) -> Option<u16> {
        self.take().map(u16::from_le_bytes)
    }

    pub(crate) fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self) -> Option<u64> {
        self.take().map(u64::from_le_bytes)
    }

    pub(crate) fn i32(&mut self) -> Option<i32> {
        self.take().map(i32::from_le_bytes)
    }

    pub(crate) fn i64(&mut self) -> Option<i64> {
        self.take().map(i64::from_le_bytes)
    }

    pub(crate) fn f32(&mut self) -> Option<f32> {
        self.take().map(f32::from_le_bytes)
    }

    /// Nothing may follow the last field.
    pub(crate) fn end(&self) -> Option<()> {
        self.0.is_empty().then_some(())
    }
}

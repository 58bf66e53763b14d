//! The messages and their layouts.

mod command;
mod hello;
mod reading;
mod refusal;
mod start;

use crate::errors::FrameError;

pub(crate) use command::Command;
pub use hello::Hello;
pub use reading::{Reading, Sensors};
pub(crate) use refusal::{decode_refusal, encode_refusal};
pub(crate) use start::Start;

pub(crate) const HELLO: u8 = b'H';
pub(crate) const READING: u8 = b'R';
pub(crate) const REFUSE: u8 = b'X';
pub(crate) const START: u8 = b'S';
pub(crate) const COMMAND: u8 = b'C';

/// Flag of HELLO and READING.
const HAS_STEERING: u8 = 1;
/// Flag of HELLO and READING.
const HAS_YAW_RATE: u8 = 1 << 1;

pub(super) fn flag(set: bool, bit: u8) -> u8 {
    if set { bit } else { 0 }
}

pub(super) fn bit(mask: u8, i: usize) -> bool {
    mask >> i & 1 == 1
}

pub(super) fn masks(counts: u8, speeds: u8) -> u8 {
    counts & 0xf | speeds << 4
}

pub(super) fn unmask(masks: u8) -> (u8, u8) {
    (masks & 0xf, masks >> 4)
}

pub(super) fn only(flags: u8, known: u8) -> Result<(), FrameError> {
    if flags & !known == 0 { Ok(()) } else { Err(FrameError::Content { field: "flags" }) }
}

pub(super) fn finite(field: &'static str, values: &[f32]) -> Result<(), FrameError> {
    if values.iter().all(|value| value.is_finite()) {
        Ok(())
    } else {
        Err(FrameError::Content { field })
    }
}

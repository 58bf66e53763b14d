//! Message layouts and the table of topics.
//!
//! Every message is plain data: `#[repr(C)]`, no pointers, no unnamed padding, enums as checked integers. So its
//! bytes are its identity: what is sent, recorded, hashed and compared is the same memory, and a hostile sample is
//! at worst a wrong number, never undefined behaviour. The layout is also, byte for byte, little-endian CDR, which
//! is what recordings contain.
//!
//! One table, [`topics`], declares every topic in one line; ports, checks, recorder and schemas derive from it.
//!
//! Times are nanoseconds of the host's monotonic clock unless a field says otherwise; lengths metres, angles radians.

mod admission;
mod header;
pub mod layout;
mod payloads;
pub mod pins;
pub mod schema;
pub mod text;
pub mod topics;

pub use admission::{Admission, Admitted, Refusal, Refusals};
pub use header::{Header, LAYOUT_VERSION, Message, check_sum, seal};
pub use payloads::*;
pub use topics::{Delivery, Process, Publisher, Topic};

/// Nanoseconds of the monotonic clock, or of simulated time.
pub type Nanos = u64;

/// Nanoseconds in a second, for conversions.
pub const NANOS_PER_SECOND: f64 = 1e9;

/// Seconds from nanoseconds.
#[must_use]
#[allow(clippy::cast_precision_loss)] // 2^53 ns are 104 days: finer than any use of seconds here.
pub fn seconds(nanos: Nanos) -> f64 {
    nanos as f64 / NANOS_PER_SECOND
}

/// Nanoseconds from seconds, rounded; negative and non-finite values give 0.
#[must_use]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // `as` saturates, which is what is wanted.
pub fn nanos(seconds: f64) -> Nanos {
    (seconds * NANOS_PER_SECOND + 0.5) as Nanos
}

//! The framed serial protocol between host and vehicle.
//!
//! Both ends are pure state machines: bytes and, where time matters, the time go in; events and
//! frames come out. No I/O, no clock, no allocation: [`HostEnd`] is what the vehicle interface
//! runs, [`VehicleEnd`] what the simulated vehicle runs; a microcontroller runs the C twin of the
//! latter, in `deploy/examples/microcontroller`, whose README describes the same protocol for
//! someone without Rust.
//!
//! # Frames
//!
//! A frame on the wire is `00`, the COBS encoding of `type, fields, check sum`, and `00`. COBS
//! (Cheshire and Baker, "Consistent overhead byte stuffing", 1999) leaves no zero inside, so a zero
//! always bounds a frame: whatever garbage comes between two frames, the next frame's own leading
//! zero ends it and costs nothing; a damaged frame costs itself. The check sum is CRC-32 (ISO-HDLC,
//! as in Ethernet and zip) over type and fields. All numbers are little-endian, floats IEEE 754
//! binary32. A frame is at most [`MAX_FRAME`] bytes long.
//!
//! # Messages of version 1
//!
//! ```text
//! H HELLO    from the vehicle  version u8, boot u32, counter bits u8, wheels u8, flags u8,
//!                              reading period u32 [us], silence u16 [ms]
//! R READING  from the vehicle  flags u8, wheels u8, boot u32, sequence u32, acknowledged u32,
//!                              time u64 [ns], counts i32 or i64 each, speeds f32 each [m/s],
//!                              steering f32 [rad], yaw rate f32 [rad/s]
//! X REFUSE   from the vehicle  version u8, boot u32, reason u8, version asked u8, boot asked u32
//! S START    from the host     version u8, boot u32, sequence u32
//! C COMMAND  from the host     sequence u32, speed f32 [m/s], steering f32 [rad]
//! ```
//!
//! *wheels*: bit 0..3 a count of fl, fr, rl, rr, bit 4..7 a speed of them. *flags* of HELLO: bit 0
//! a steering sensor, bit 1 a gyro. *flags* of READING: bit 0 steering present, bit 1 yaw rate
//! present, bit 2 counts are 64 bit wide, bit 3 a START or COMMAND is acknowledged, bit 4 the
//! vehicle stops because commands stayed away. *reason* of REFUSE: 1 version, 2 boot id. What is
//! not present takes no bytes. Framing, check sum, and the place of type, version and boot id in
//! HELLO, START and REFUSE stay the same in every version.
//!
//! # Conversation
//!
//! 1. The vehicle sends a HELLO every 50 ms ([`HELLO_PERIOD`]), always, and its readings at their
//!    rate, always.
//! 2. A host without a session answers a HELLO of its own version with START, which echoes the boot
//!    id and takes the next number of the host's one sequence. Another version is refused by name,
//!    on both ends.
//! 3. The vehicle takes START only with its version and boot id, answers any other with REFUSE and
//!    closes the session. From START on it obeys commands, and only those newer than the last: a
//!    repeated frame does not count.
//! 4. Each reading acknowledges the newest START or COMMAND. The host has a session once one of its
//!    own is acknowledged; only then does [`HostEnd::command`] give frames.
//! 5. Readings carry the boot id. A new one means that the vehicle started anew, with new counters:
//!    the host says so, forgets the session and waits for the next HELLO.
//! 6. No command for the silence time-out, or none since START: the vehicle stops by itself. The
//!    host sends nothing of its own, so a dead pipeline is a silent line; a START moves nothing.
//!
//! So a host that is restarted, or opens the line again, under a vehicle that keeps streaming is
//! back after one HELLO and one reading, less than 100 ms; and so is a restarted vehicle.

mod bytes;
mod errors;
mod frame;
mod host;
mod messages;
mod receiver;
mod vehicle;

pub use errors::{FrameError, LineErrors, Refusal};
pub use frame::{Frame, MAX_FRAME};
pub use host::{HostEnd, HostEvent};
pub use messages::{Hello, Reading, Sensors};
pub use vehicle::{VehicleEnd, VehicleEvent};

/// Version of the protocol that this crate speaks.
pub const PROTOCOL_VERSION: u8 = 1;

/// Time between two HELLO of a vehicle \[ns\].
pub const HELLO_PERIOD: u64 = 50_000_000;

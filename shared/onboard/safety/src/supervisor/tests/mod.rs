//! The supervisor against a small world of its own: processes that start, beat, stop and die, the
//! real gate, and a car that does what it is told.

mod deaths;
mod exhaustive;
mod faults;
mod modes;
mod schedules;
mod world;

use super::*;

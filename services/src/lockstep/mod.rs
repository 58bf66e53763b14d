//! Lockstep: the whole stack in one thread on simulated time, with the same stages, seals, checks, line frames,
//! supervisor and gate. What is not in it: iceoryx2, the terminal, the disk. The same seed gives the same bits.

mod channel;
mod check;
mod draw;
mod drive;
mod mishap;
mod schedule;
mod shrink;
mod world;

pub use check::{Broken, Checker, Invariant, Stop};
pub use draw::{VICTIMS, draw};
pub use drive::{Searching, Task, Watcher, drive};
pub use mishap::Mishap;
pub use schedule::{Fault, Kind, LineMishap, Schedule, Way, Wire};
pub use shrink::shrink;
pub use world::{Plans, World, words_of};

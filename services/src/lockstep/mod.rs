//! Lockstep: the whole stack in one thread on simulated time, with the same stages, seals, checks, line frames,
//! supervisor and gate. What is not in it: iceoryx2, the terminal, the disk. The same seed gives the same bits.

mod channel;
mod world;

pub use world::{LineFault, Script, World, words_of};

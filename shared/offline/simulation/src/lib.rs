//! The nominal vehicle as a simulator.
//!
//! A command goes the way it goes in a vehicle, and each station is a file of its own:
//!
//! ```text
//! command -> speed actuator    -+-> ground -> sensing -> reading
//!         -> steering actuator -+     |
//!                                     +-> body (pose, rotation of the wheels)
//! ```
//!
//! - `speed_actuator`, `steering_actuator`: a pure delay, the vehicle's limit, then a first-order
//!   lag whose rate is limited. Both are solved exactly, also where a command begins to act
//!   within a step.
//! - `ground`: the car rolls without slip about the centre that its steering sets; the differential
//!   splits the motor's rotation among the driven wheels.
//! - `body`: the integral of that motion, of fourth order in the step (relative errors of 1e-9 and
//!   below at 5 ms).
//! - `sensing`: encoder counts, wheel speeds, steering sensor and gyro, with seeded noise.
//!
//! The [`Simulator`] is pure: no clock, no input or output; the same calls give the same bits on
//! every machine.

mod actuator;
mod body;
mod delay;
mod ground;
mod lag;
mod noise;
mod normal;
mod sensing;
mod simulator;
mod speed_actuator;
mod steering_actuator;

pub use noise::Noise;
pub use sensing::SensorReading;
pub use simulator::{STEP, Simulator};

//! The vehicle as a simulator: nominal, or with effects added to it.
//!
//! A command goes the way it goes in a vehicle, and each station is a file of its own:
//!
//! ```text
//! command -> actuator (speed)          -+-> ground -> sensing -> reading
//!         -> actuator (steering), play -+     |
//!                                             +-> body (pose, rotation of the wheels)
//! ```
//!
//! - `actuator`: gain, dead zone, a pure delay, the vehicle's limit, then a first-order lag whose
//!   rate is limited, solved exactly, also where a command begins to act within a step. `play`
//!   follows in the steering.
//! - `ground`: the car rolls about the centre that its steering sets; the differential splits the
//!   motor's rotation among the driven wheels, which may slip.
//! - `body`: the integral of that motion, of fourth order in the step (relative errors of 1e-9 and
//!   below at 5 ms).
//! - `sensing`: encoder counts, wheel speeds, steering sensor and gyro, with seeded noise.
//!
//! The stations work by the numbers of a `plant`: the vehicle's description, altered by the
//! [`effects`], each of which has a file of its own. Without effects the vehicle is nominal, to the
//! bit.
//!
//! [`Simulator`] drives live, command by command. [`Drive`] simulates a recorded run from its
//! commands, [`Follow`] one from the motion of its motor and rack; both fill a [`Trajectory`], which
//! shows what every sensor would have read at any time. All are pure: no clock, no input or output;
//! the same calls give the same bits on every machine.

mod actuator;
mod body;
mod delay;
mod drive;
pub mod effects;
mod ground;
mod lag;
mod noise;
mod normal;
mod plant;
mod play;
mod sensing;
mod simulator;
mod start;
mod stepper;
mod train;
mod trajectory;

pub use drive::{Command, Drive, Follow, InMotion};
pub use effects::{Effect, Effects, Overlay, Parameter};
pub use noise::Noise;
pub use sensing::SensorReading;
pub use simulator::{STEP, Simulator};
pub use start::body_from_reference;
pub use stepper::Knot;
pub use train::Sample;
pub use trajectory::Trajectory;

//! A second vehicle, with physics of its own, on which odometry, calibration and parking are judged.
//!
//! What is estimated, fitted and planned elsewhere in kerbside assumes a car that rolls ideally, and the simulator is
//! that car. A figure won against one's own model says little; so this one shares no code with it but poses and
//! transcendental functions.
//!
//! ```text
//! manoeuvre -> actuators -> contacts -> plant -> instruments -> recorded
//! ```
//!
//! - [`Manoeuvre`]: straights, arcs, the S path of the paper, slaloms, shuttles, or commands by time. Open loop: nobody
//!   corrects where the car ends up. For a closed loop there is [`Plant::step`].
//! - [`Actuators`]: delay, limit, lag with a limited rate; a motor that droops under load.
//! - contacts ([`Tyres`], [`Linkage`], the differential): at every instant the motion of a rigid body in the plane at which
//!   the tyres' forces balance its inertia. Tyres creep in proportion to force over load and saturate by the brush
//!   model; the linkage has its own angle for each front wheel, off the ideal of Ackermann, and bends under side
//!   force; the differential is open, locked or in between.
//! - [`Plant`]: the integral of that motion by the Runge-Kutta method of fourth order.
//! - [`Instruments`]: encoders that count whole numbers and wrap, steering sensor, gyro and reference, with white and
//!   coloured errors, each from its own stream of the seed; wheels that spin or skid ([`Slip`]).
//! - [`TestDrive`] makes a [`Recorded`] of all this: what a run's folder would hold, and the truth. What was
//!   [`Driven`] once can be recorded with many seeds.
//!
//! **Cases.** [`cases`] draws whole cases for judging a diagnosis: vehicles of all sizes, what their descriptions say, what
//! is put into them ([`insertions`]: every effect that a diagnosis may name, and others) and drives from a [`library`] of
//! manoeuvres. There the motor turns at the commanded rate whatever the wheels' true radii are, and any other plant may
//! drive the same case.
//!
//! **Kinematic limit.** With [`Physics::NEUTRAL`] the car rolls ideally: held commands are exact arcs, paths are covered
//! exactly (the heading is the exact integral of the curvature), and the integrated vehicle agrees with both. Every
//! term of the physics can be neutral on its own.
//!
//! **Sources.** R. Rajamani, *Vehicle Dynamics and Control*, chapters 2 and 13 (balance of the plane body, understeer, tyre
//! slip); H. B. Pacejka, *Tire and Vehicle Dynamics*, chapters 1 and 3 (steady slip, brush model, pneumatic trail,
//! compliance of the steering); Lee, Chung and Chang for the geometry and the paper's car.
//!
//! **What it leaves out.** The balance is quasi-steady: tyres build up their force without relaxation length (a few
//! centimetres of rolling) and the body follows without side-slip transients (a few milliseconds at parking speed); a
//! change of the yaw rate is felt as that of ideal rolling. No roll, pitch, load transfer or camber; no slope or unevenness
//! of the floor; no turning torque of a single contact; rigid tyres know no friction limit. A turn that asks for more
//! side force than the friction holds has no quasi-steady balance: its motion is bounded and no more. Slips are put in,
//! they do not arise from too much torque, and they move counts and not the body. The rolling radius does not depend on
//! speed or load. Only cars with a steered front axle are driven.
//!
//! Frames: x forward, y left, yaw counter-clockwise, the body frame at the centre of the rear axle, on the ground. SI
//! units, radians. Pure: no clock, no input or output; the same seed gives the same bits on every machine.

mod actuators;
mod balance;
mod car;
pub mod cases;
mod chassis;
mod colour;
mod contact;
mod drive;
pub mod insertions;
mod instruments;
mod leg;
pub mod library;
mod manoeuvre;
mod normal;
mod paper;
mod physics;
mod plant;
mod profile;
mod record;
mod rolling;
mod sensors;

pub use actuators::Command;
pub use chassis::{Chassis, GRAVITY};
pub use drive::TestDrive;
pub use instruments::Instruments;
pub use leg::{Leg, Section};
pub use manoeuvre::{Manoeuvre, PAUSE};
pub use paper::{REAR_NOISE, Residuals};
pub use physics::{Actuators, Linkage, Physics, Tyres};
pub use plant::{LONGEST_STEP, Plant, State};
pub use profile::Pace;
pub use record::{Driven, Recorded, Stamped};
pub use sensors::{
    Coloured, EncoderFault, Encoders, Failure, Gyro, Reference, Sensors, Slip, SteeringSensor,
};

//! The rows of a run's files.

use core::f64::consts::PI;
use core::fmt::Write;

use super::field::{self, Allowed};

/// Speeds beyond this are of no vehicle \[m/s\].
const FAST: f64 = 1e3;
/// Positions beyond this are on no map \[m\].
const FAR: f64 = 1e8;

/// Which columns a header must name besides `t`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needed {
    /// At least one of the known ones.
    Any,
    /// The first so many of the known ones.
    First(usize),
}

/// A row of one of the files: a stamp and columns, each of which may be missing.
pub trait Row: Copy + Default {
    /// Name of the file.
    const FILE: &'static str;
    /// Names of the columns after `t`.
    const COLUMNS: &'static [&'static str];
    /// Which of them a header must have.
    const NEEDED: Needed;

    /// What column `column` may hold.
    fn allowed(column: usize) -> Allowed;

    /// The stamp \[s\].
    fn t(&self) -> f64;

    /// Sets the stamp \[s\].
    fn set_t(&mut self, t: f64);

    /// Takes a field that is not empty; none where the column may not hold it.
    fn set(&mut self, column: usize, field: &str) -> Option<()>;

    /// Appends what [`Row::set`] took; nothing where it is missing.
    fn append(&self, column: usize, out: &mut String);
}

/// A row of `encoders.csv`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CountRow {
    /// Stamp \[s\].
    pub t: f64,
    /// Cumulative counts of fl, fr, rl, rr as read.
    pub counts: [i64; 4],
    /// Bit i: wheel i was read.
    pub mask: u8,
}

/// A row of `wheels.csv`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpeedRow {
    /// Stamp \[s\].
    pub t: f64,
    /// Surface speeds of fl, fr, rl, rr \[m/s\].
    pub speeds: [f64; 4],
    /// Bit i: wheel i was read.
    pub mask: u8,
}

/// A row of `steering.csv`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SteeringRow {
    /// Stamp \[s\].
    pub t: f64,
    /// Road-wheel angle, left positive \[rad\].
    pub angle: Option<f64>,
}

/// A row of `imu.csv`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GyroRow {
    /// Stamp \[s\].
    pub t: f64,
    /// Yaw rate \[rad/s\].
    pub yaw_rate: Option<f64>,
}

/// A row of `commands.csv`, which holds until the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CommandRow {
    /// Stamp \[s\].
    pub t: f64,
    /// Speed of the rear-axle centre, negative in reverse \[m/s\].
    pub speed: Option<f64>,
    /// Road-wheel angle \[rad\].
    pub steering: Option<f64>,
}

/// A row of `reference.csv`: the marker's pose in the reference's fixed frame, as reported.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReferenceRow {
    /// Stamp \[s\].
    pub t: f64,
    /// Position \[m\].
    pub x: Option<f64>,
    /// Position \[m\].
    pub y: Option<f64>,
    /// Heading, wrapped or not \[rad\].
    pub yaw: Option<f64>,
}

const WHEELS: &[&str] = &["fl", "fr", "rl", "rr"];

impl Row for CountRow {
    const FILE: &'static str = "encoders.csv";
    const COLUMNS: &'static [&'static str] = WHEELS;
    const NEEDED: Needed = Needed::Any;

    fn allowed(_: usize) -> Allowed {
        Allowed::Count
    }

    fn t(&self) -> f64 {
        self.t
    }

    fn set_t(&mut self, t: f64) {
        self.t = t;
    }

    fn set(&mut self, column: usize, field: &str) -> Option<()> {
        self.counts[column] = field::count(field)?;
        self.mask |= 1 << column;
        Some(())
    }

    fn append(&self, column: usize, out: &mut String) {
        if self.mask & (1 << column) != 0 {
            let _ = write!(out, "{}", self.counts[column]);
        }
    }
}

impl Row for SpeedRow {
    const FILE: &'static str = "wheels.csv";
    const COLUMNS: &'static [&'static str] = WHEELS;
    const NEEDED: Needed = Needed::Any;

    fn allowed(_: usize) -> Allowed {
        Allowed::within(FAST, "m/s")
    }

    fn t(&self) -> f64 {
        self.t
    }

    fn set_t(&mut self, t: f64) {
        self.t = t;
    }

    fn set(&mut self, column: usize, field: &str) -> Option<()> {
        self.speeds[column] = field::number(field, Self::allowed(column))?;
        self.mask |= 1 << column;
        Some(())
    }

    fn append(&self, column: usize, out: &mut String) {
        if self.mask & (1 << column) != 0 {
            let _ = write!(out, "{}", self.speeds[column]);
        }
    }
}

/// Rows whose columns are numbers, each of which may be missing.
macro_rules! number_row {
    ($row:ident $file:literal, needs $needed:literal, $($column:literal $field:ident $name:literal
       within $bound:expr, $unit:literal;)+) => {
        impl Row for $row {
            const FILE: &'static str = $file;
            const COLUMNS: &'static [&'static str] = &[$($name),+];
            const NEEDED: Needed = Needed::First($needed);

            fn allowed(column: usize) -> Allowed {
                match column {
                    $($column => Allowed::within($bound, $unit),)+
                    _ => Allowed::Count,
                }
            }

            fn t(&self) -> f64 {
                self.t
            }

            fn set_t(&mut self, t: f64) {
                self.t = t;
            }

            fn set(&mut self, column: usize, field: &str) -> Option<()> {
                let value = Some(field::number(field, Self::allowed(column))?);
                match column {
                    $($column => self.$field = value,)+
                    _ => return None,
                }
                Some(())
            }

            fn append(&self, column: usize, out: &mut String) {
                let value = match column {
                    $($column => self.$field,)+
                    _ => None,
                };
                if let Some(value) = value {
                    let _ = write!(out, "{value}");
                }
            }
        }
    };
}

number_row! { SteeringRow "steering.csv", needs 1,
    0 angle "angle" within PI, "rad";
}

number_row! { GyroRow "imu.csv", needs 1,
    0 yaw_rate "yaw_rate" within 1e3, "rad/s";
}

number_row! { CommandRow "commands.csv", needs 2,
    0 speed "speed" within FAST, "m/s";
    1 steering "steering" within PI, "rad";
}

number_row! { ReferenceRow "reference.csv", needs 2,
    0 x "x" within FAR, "m";
    1 y "y" within FAR, "m";
    2 yaw "yaw" within 1e6, "rad";
}

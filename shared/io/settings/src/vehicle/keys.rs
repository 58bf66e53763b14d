//! The keys of `vehicle.toml`.

use core::f64::consts::{FRAC_PI_2, PI};
use std::collections::BTreeMap;
use std::sync::LazyLock;

use kerbside_geometry::{
    Actuators, Drive, Footprint, Gyro, Limits, Pose, Reference, SteeringSensor, WHEELS,
};
use kerbside_simulation::effects::library;

use super::{Calibration, calibration};
use crate::declare::{Field, Kind, Range, Schema, Value};

/// A vehicle as far as its file states it; what is not stated is NaN.
pub(crate) struct VehicleDraft {
    pub(super) name: String,
    pub(super) wheelbase: f64,
    pub(super) track: [f64; 2],
    pub(super) radius: [f64; 4],
    pub(super) speed_radius: [Option<f64>; 4],
    pub(super) drive: Drive,
    pub(super) footprint: Footprint,
    pub(super) limits: Limits,
    pub(super) actuators: Actuators,
    pub(super) counts: [Option<f64>; 4],
    pub(super) counter_bits: u32,
    pub(super) noise_per_distance: Option<f64>,
    pub(super) encoder_rate: f64,
    pub(super) steering_sensor: SteeringSensor,
    pub(super) gyro: Gyro,
    pub(super) reference: Reference,
    pub(super) fields: BTreeMap<&'static str, Option<f64>>,
    pub(super) effects: BTreeMap<(&'static str, &'static str), Option<f64>>,
    pub(super) calibration: Calibration,
}

impl Default for VehicleDraft {
    fn default() -> Self {
        const N: f64 = f64::NAN;
        Self {
            name: String::new(),
            wheelbase: N,
            track: [N; 2],
            radius: [N; 4],
            speed_radius: [None; 4],
            drive: Drive::default(),
            footprint: Footprint { length: N, width: N, rear_overhang: N },
            limits: Limits {
                speed: N,
                acceleration: N,
                deceleration: N,
                steering: N,
                steering_rate: N,
            },
            actuators: Actuators::default(),
            counts: [None; 4],
            counter_bits: 0,
            noise_per_distance: None,
            encoder_rate: N,
            steering_sensor: SteeringSensor::new(N, N),
            gyro: Gyro { noise: N, rate: N, bias: 0.0 },
            reference: Reference {
                position_noise: N,
                yaw_noise: N,
                rate: N,
                marker: Pose::default(),
            },
            fields: BTreeMap::new(),
            effects: BTreeMap::new(),
            calibration: Calibration::default(),
        }
    }
}

impl Field for Drive {
    fn take(value: &Value) -> Option<Self> {
        match value {
            Value::Text(name) if name == "rear" => Some(Self::Rear),
            Value::Text(name) if name == "front" => Some(Self::Front),
            Value::Text(name) if name == "all" => Some(Self::All),
            _ => None,
        }
    }

    fn show(&self) -> Option<Value> {
        let name = match self {
            Self::Rear => "rear",
            Self::Front => "front",
            Self::All => "all",
        };
        Some(Value::Text(name.to_owned()))
    }
}

/// Fields of the vehicle that an uncertainty may be stated for, with their unit.
const UNCERTAIN: &[(&str, &str)] = &[
    ("wheelbase", "m"),
    ("track_front", "m"),
    ("track_rear", "m"),
    ("radius", "m"),
    ("acceleration", "m/s2"),
    ("deceleration", "m/s2"),
    ("steering_rate", "rad/s"),
    ("speed_delay", "s"),
    ("speed_lag", "s"),
    ("steering_delay", "s"),
    ("steering_lag", "s"),
];

/// Wide on purpose: what is in the wrong unit may still be read, and be found out as a mistake.
const LENGTH: Kind = Kind::metres(Range::above(0.0).to(10_000.0));
const OFFSET: Kind = Kind::metres(Range::from(0.0).to(10_000.0));
const RATE: Kind = Kind::unit("Hz", Range::above(0.0).to(10_000.0));
const GAIN: Kind = Kind::number(Range::above(0.0).to(100.0));
const DELAY: Kind = Kind::seconds(Range::from(0.0).to(10.0));

static SCHEMA: LazyLock<Schema<VehicleDraft>> = LazyLock::new(declare);

/// The keys of `vehicle.toml`.
pub(crate) fn schema() -> &'static Schema<VehicleDraft> {
    &SCHEMA
}

fn declare() -> Schema<VehicleDraft> {
    let schema = Schema::new(
        "vehicle.toml",
        "What the engineer believes the vehicle to be. SI units, angles in radians. The body frame \
         sits at the centre of the rear axle, on the ground: x forward, y left, yaw \
         counter-clockwise.",
        VehicleDraft::default,
    );
    let schema = declare_sensors(declare_motion(declare_speeds(declare_body(schema))));
    calibration::declare(declare_uncertainty(schema))
}

fn declare_body(schema: Schema<VehicleDraft>) -> Schema<VehicleDraft> {
    schema
        .required("name", Kind::Text, "Name of the vehicle, for people.", |v| &mut v.name)
        .required("wheelbase", LENGTH, "Front axle to rear axle.", |v| &mut v.wheelbase)
        .required(
            "track_front",
            OFFSET,
            "Between the contact points of the front wheels; 0 for one wheel on the centre \
             line, which is `fl`.",
            |v| &mut v.track[0],
        )
        .required(
            "track_rear",
            OFFSET,
            "Between the contact points of the rear wheels; 0 for one wheel on the centre line, \
             which is `rl`.",
            |v| &mut v.track[1],
        )
        .required(
            "drive",
            Kind::Choice(&["rear", "front", "all"]),
            "Which wheels the motor turns.",
            |v| &mut v.drive,
        )
        .section("radius", "Radii of the wheels.")
        .required("radius.fl", LENGTH, "Radius of the front left wheel.", |v| &mut v.radius[0])
        .optional(
            "radius.fr",
            LENGTH,
            "required, unless track_front is 0: there is no such wheel then",
            "Radius of the front right wheel.",
            |v| &mut v.radius[1],
        )
        .required("radius.rl", LENGTH, "Radius of the rear left wheel.", |v| &mut v.radius[2])
        .optional(
            "radius.rr",
            LENGTH,
            "required, unless track_rear is 0: there is no such wheel then",
            "Radius of the rear right wheel.",
            |v| &mut v.radius[3],
        )
        .section("footprint", "The rectangle the body covers, seen from above.")
        .required("footprint.length", LENGTH, "Along x.", |v| &mut v.footprint.length)
        .required("footprint.width", LENGTH, "Along y.", |v| &mut v.footprint.width)
        .required(
            "footprint.rear_overhang",
            OFFSET,
            "From the rear axle back to the rear edge.",
            |v| &mut v.footprint.rear_overhang,
        )
}

fn declare_motion(schema: Schema<VehicleDraft>) -> Schema<VehicleDraft> {
    let rate = Kind::unit("m/s2", Range::above(0.0).to(1000.0));
    schema
        .section("limits", "What the vehicle can do.")
        .required(
            "limits.speed",
            Kind::unit("m/s", Range::above(0.0).to(1000.0)),
            "Largest speed in either direction.",
            |v| &mut v.limits.speed,
        )
        .required("limits.acceleration", rate, "Largest acceleration.", |v| {
            &mut v.limits.acceleration
        })
        .optional(
            "limits.deceleration",
            rate,
            "as limits.acceleration",
            "Deceleration that the planner and the stop ramp of the gate may ask for.",
            |v| &mut v.limits.deceleration,
        )
        .required(
            "limits.steering",
            Kind::radians(Range::above(0.0).below(FRAC_PI_2)),
            "Largest road-wheel angle of the equivalent centre wheel.",
            |v| &mut v.limits.steering,
        )
        .required(
            "limits.steering_rate",
            Kind::unit("rad/s", Range::above(0.0).to(1000.0)),
            "Largest rate of that angle.",
            |v| &mut v.limits.steering_rate,
        )
        .optional_section(
            "actuators",
            "Nominal response: a gain, a pure delay, then a first-order lag. Absent: unknown.",
        )
        .required("actuators.speed_delay", DELAY, "Delay of the speed.", |v| {
            &mut v.actuators.speed_delay
        })
        .required("actuators.speed_lag", DELAY, "Time constant of the speed.", |v| {
            &mut v.actuators.speed_lag
        })
        .required("actuators.steering_delay", DELAY, "Delay of the steering.", |v| {
            &mut v.actuators.steering_delay
        })
        .required("actuators.steering_lag", DELAY, "Time constant of the steering.", |v| {
            &mut v.actuators.steering_lag
        })
        .key(
            "actuators.speed_gain",
            GAIN,
            "Speed reached per speed commanded; commands are divided by it.",
            |v| &mut v.actuators.speed_gain,
        )
        .key(
            "actuators.steering_gain",
            GAIN,
            "Angle of the rack reached per angle commanded; commands are divided by it.",
            |v| &mut v.actuators.steering_gain,
        )
        .key(
            "actuators.steering_offset",
            Kind::radians(Range::from(-PI).to(PI)),
            "By which the road wheels stand askew of the rack; taken from what is commanded.",
            |v| &mut v.actuators.steering_offset,
        )
}

fn declare_sensors(schema: Schema<VehicleDraft>) -> Schema<VehicleDraft> {
    let schema = declare_encoders(schema);
    schema
        .optional_section("steering_sensor", "The steering sensor. Absent: there is none.")
        .required(
            "steering_sensor.noise",
            Kind::radians(Range::from(0.0).to(PI)),
            "Standard deviation of a reading; a belief.",
            |v| &mut v.steering_sensor.noise,
        )
        .required("steering_sensor.rate", RATE, "Readings per second.", |v| {
            &mut v.steering_sensor.rate
        })
        .key(
            "steering_sensor.offset",
            Kind::radians(Range::from(-PI).to(PI)),
            "What it reads while the wheels stand straight; `kerbside calibrate` finds it.",
            |v| &mut v.steering_sensor.offset,
        )
        .key(
            "steering_sensor.gain",
            Kind::number(Range::above(0.0).to(100.0)),
            "Reading per road-wheel angle, beyond the offset.",
            |v| &mut v.steering_sensor.gain,
        )
        .optional_section("gyro", "The gyro. Absent: there is none.")
        .required(
            "gyro.noise",
            Kind::unit("rad/s", Range::from(0.0).to(100.0)),
            "Standard deviation of a reading; a belief.",
            |v| &mut v.gyro.noise,
        )
        .required("gyro.rate", RATE, "Readings per second.", |v| &mut v.gyro.rate)
        .key(
            "gyro.bias",
            Kind::unit("rad/s", Range::from(-1.0).to(1.0)),
            "What it reads at rest; the estimator begins with it, as surely as `uncertainty.effect` states of \
             `gyro_bias`.",
            |v| &mut v.gyro.bias,
        )
        .optional_section("reference", "The sensor of the reference pose. Absent: there is none.")
        .required(
            "reference.noise.position",
            OFFSET,
            "Standard deviation of each coordinate; a belief, measured before it is trusted.",
            |v| &mut v.reference.position_noise,
        )
        .required(
            "reference.noise.yaw",
            Kind::radians(Range::from(0.0).to(PI)),
            "Standard deviation of the yaw; a belief.",
            |v| &mut v.reference.yaw_noise,
        )
        .required("reference.rate", RATE, "Readings per second.", |v| &mut v.reference.rate)
        .key("reference.marker.x", Kind::metres(Range::ANY), "The marker in the body frame.", |v| {
            &mut v.reference.marker.x
        })
        .key("reference.marker.y", Kind::metres(Range::ANY), "The marker in the body frame.", |v| {
            &mut v.reference.marker.y
        })
        .key(
            "reference.marker.yaw",
            Kind::radians(Range::ANY),
            "The marker in the body frame.",
            |v| &mut v.reference.marker.yaw,
        )
}

fn declare_speeds(schema: Schema<VehicleDraft>) -> Schema<VehicleDraft> {
    let mut schema = schema.section(
        "speed_radius",
        "Radii by which the vehicle computes the wheel speeds that it reports, where these are not \
         `radius`: a calibration finds other radii, the vehicle goes on with its own.",
    );
    for wheel in WHEELS {
        schema = schema.optional(
            format!("speed_radius.{}", wheel.name()),
            LENGTH,
            "the wheel's radius",
            format!("Radius behind the reported speed of the wheel {}.", wheel.name()),
            move |v: &mut VehicleDraft| &mut v.speed_radius[wheel.index()],
        );
    }
    schema
}

fn declare_encoders(schema: Schema<VehicleDraft>) -> Schema<VehicleDraft> {
    let mut schema = schema
        .optional_section(
            "encoders",
            "The wheel encoders. Absent: there are none, the wheels report speeds.",
        )
        .section("encoders.counts_per_revolution", "Only the wheels that have an encoder.");
    for wheel in WHEELS {
        schema = schema.optional(
            format!("encoders.counts_per_revolution.{}", wheel.name()),
            Kind::number(Range::above(0.0).to(1e9)),
            "the wheel has no encoder",
            format!("Counts per turn of the wheel {}.", wheel.name()),
            move |v: &mut VehicleDraft| &mut v.counts[wheel.index()],
        );
    }
    schema
        .required(
            "encoders.counter_bits",
            Kind::Integer { unit: "bit", low: 4, high: 64 },
            "Width of the counters, after which they wrap.",
            |v| &mut v.counter_bits,
        )
        .optional(
            "encoders.noise_per_distance",
            Kind::unit("m/sqrt(m)", Range::from(0.0).to(10.0)),
            "unknown: the estimator's own figure is used",
            "Random part of a wheel's travel, standard deviation; a belief.",
            |v| &mut v.noise_per_distance,
        )
        .required("encoders.rate", RATE, "Readings per second.", |v| &mut v.encoder_rate)
}

fn declare_uncertainty(schema: Schema<VehicleDraft>) -> Schema<VehicleDraft> {
    let mut schema = schema.optional_section(
        "uncertainty",
        "One standard deviation of what a car in good order may differ by, per field. Absent: \
         nothing is known.",
    );
    for (name, unit) in UNCERTAIN {
        schema = schema.optional(
            format!("uncertainty.{name}"),
            Kind::unit(unit, Range::from(0.0).to(1000.0)),
            "taken as exact",
            format!("Standard deviation of {name}."),
            move |v: &mut VehicleDraft| v.fields.entry(*name).or_default(),
        );
    }
    schema = schema.section(
        "uncertainty.effect",
        "The same for what has no field: parameters of effects, about their neutral value.",
    );
    for definition in library() {
        for parameter in definition.parameters {
            let (id, parameter) = (definition.id, parameter.name);
            schema = schema.optional(
                format!("uncertainty.effect.{id}.{parameter}"),
                Kind::unit("the parameter's unit", Range::from(0.0).to(1000.0)),
                "taken as neutral",
                format!("Standard deviation of {parameter} of the effect {id}."),
                move |v: &mut VehicleDraft| v.effects.entry((id, parameter)).or_default(),
            );
        }
    }
    schema
}

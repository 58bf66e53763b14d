//! Effects that no list has: whoever looks for a cause can only say that there is one, and where.
use super::effect::{Definition, Link, Role, Unit, effect, of_wheel, other, size};
use core::f64::consts::PI;

/// Effects outside that list, in the order of cause. A size is drawn within the whole range.
pub const UNLISTED: &[Definition] = &[
    effect(
        "battery_sag",
        Link::SpeedActuation,
        &[size("rate", 0.0, 0.002, 0.02, Unit::Plain)],
        "the battery sags within a run: the speed gain falls by {rate} of its start value \
         every second and is back at the next run's start",
    ),
    effect(
        "weak_reverse",
        Link::SpeedActuation,
        &[size("loss", 0.0, 0.03, 0.3, Unit::Plain)],
        "in reverse the speed gain is {loss} less than forwards",
    ),
    effect(
        "quadratic_droop",
        Link::SpeedActuation,
        &[size("loss", 0.0, 0.05, 0.35, Unit::Plain)],
        "the motor falls short by the square of the speed: by {loss} of it at the top \
         speed",
    ),
    effect(
        "slow_release",
        Link::SpeedActuation,
        &[size("lag", 0.0, 0.1, 0.8, Unit::Plain)],
        "the motor slows down with a lag that is {lag} s longer than that with which it \
         speeds up",
    ),
    effect(
        "steering_stick",
        Link::SteeringActuation,
        &[size("width", 0.0, 0.02, 0.12, Unit::Plain)],
        "friction in the steering: the rack rests until it is asked for {width} rad more, \
         then goes all the way",
    ),
    effect(
        "uneven_steering",
        Link::SteeringActuation,
        &[size("difference", 0.0, 0.04, 0.3, Unit::Plain)],
        "the rack goes {difference} further for a command to the left than for one to the \
         right",
    ),
    effect(
        "bowed_steering",
        Link::SteeringActuation,
        &[size("loss", 0.0, 0.08, 0.4, Unit::Plain)],
        "the servo's horn turns too far: the rack falls short by the square of the angle, \
         by {loss} of it at full lock",
    ),
    effect(
        "shimmy",
        Link::Ground,
        &[
            size("amplitude", 0.0, 0.03, 0.1, Unit::Plain),
            other("speed", 0.25, 0.4, Unit::Speed, Role::Free),
            other("frequency", 1.0, 2.5, Unit::Plain, Role::Free),
        ],
        "a worn joint beyond the sensor lets the wheels shimmy by {amplitude} rad at \
         {frequency} Hz around a speed of {speed} m/s",
    ),
    effect(
        "offset_by_direction",
        Link::Ground,
        &[size("offset", 0.0, 0.008, 0.04, Unit::Plain)],
        "the wheels stand {offset} rad to the left of the rack when driving forwards and \
         as much to the right in reverse",
    ),
    effect(
        "brake_pull",
        Link::Ground,
        &[size("angle", 0.0, 0.02, 0.08, Unit::Plain)],
        "one brake grips first: when slowing down at the limit the wheels are turned by \
         {angle} rad to the left",
    ),
    effect(
        "carpet_nap",
        Link::Ground,
        &[
            size("ratio", 0.0, 0.015, 0.1, Unit::Plain),
            other("direction", -PI, PI, Unit::Plain, Role::Free),
        ],
        "the carpet's nap: driven wheels slip by {ratio} when heading {direction} rad and \
         gain as much on the way back",
    ),
    of_wheel(
        "out_of_round",
        &[size("share", 0.0, 0.02, 0.1, Unit::Plain)],
        Link::Ground,
        "the {wheel} wheel runs out of true: its rolling radius varies by {share} either \
         way once a turn",
    ),
    effect(
        "radius_growth",
        Link::Ground,
        &[size("rate", 0.0, 0.0005, 0.005, Unit::Plain)],
        "the tyres warm up and swell within a run: all radii grow by {rate} of their \
         value every second",
    ),
    effect(
        "floor_wave",
        Link::Ground,
        &[
            size("rate", 0.0, 0.02, 0.08, Unit::Plain),
            other("length", 1.0, 2.5, Unit::Length, Role::Free),
        ],
        "the floor is wavy: a side velocity of {rate} of the speed that changes its sign \
         with the place, once in {length} m along x",
    ),
    effect(
        "gyro_warming",
        Link::Sensing,
        &[
            size("bias", 0.0, 0.01, 0.04, Unit::Plain),
            other("time", 3.0, 10.0, Unit::Plain, Role::Free),
        ],
        "the gyro warms up: a bias of {bias} rad/s comes up within a time constant of \
         {time} s",
    ),
    effect(
        "gyro_vibration",
        Link::Sensing,
        &[size("bias", 0.0, 0.01, 0.04, Unit::Plain)],
        "vibration: the gyro has a bias of {bias} rad/s at the top speed, in proportion \
         to the speed in either direction",
    ),
    of_wheel(
        "encoder_eccentricity",
        &[size("angle", 0.0, 0.05, 0.15, Unit::Plain)],
        Link::Sensing,
        "the disc of the {wheel} encoder sits off its axle: it shows up to {angle} rad \
         too much or too little, once a turn",
    ),
    effect(
        "sensor_bow",
        Link::Sensing,
        &[size("share", 0.0, 0.05, 0.3, Unit::Plain)],
        "the steering sensor reads too much by the square of the angle on both sides, by \
         {share} of full lock there",
    ),
    effect(
        "reference_pull",
        Link::Reference,
        &[
            other("x", -2.0, 2.0, Unit::Length, Role::Place),
            other("y", -2.0, 2.0, Unit::Length, Role::Place),
            other("radius", 0.4, 0.9, Unit::Length, Role::Free),
            size("pull", 0.0, 0.02, 0.12, Unit::Length),
        ],
        "the reference's position is pulled towards ({x}, {y}) by up to {pull} m within \
         {radius} m of it",
    ),
    effect(
        "reference_turning",
        Link::Reference,
        &[size("rate", 0.0, 0.0005, 0.006, Unit::Plain)],
        "the reference's frame turns slowly about its origin, by {rate} rad/s from the \
         run's start",
    ),
    effect(
        "reference_stretch",
        Link::Reference,
        &[size("share", 0.0, 0.015, 0.1, Unit::Plain)],
        "the camera looks askew: \
         the reference's x is stretched by {share}, its y is not",
    ),
];

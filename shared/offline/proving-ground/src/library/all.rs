//! The manoeuvres: pieces of (time, speed, steering), the time in shares of the whole, speed and steering in shares of what
//! the style allows.

use super::piece::{Piece, Shape};
use Shape::{Ramp, Sine, Step, Triangle};

/// Names of the manoeuvres.
pub const NAMES: &[&str] = &[
    "straight",
    "straight-stops",
    "straight-both-ways",
    "circle-left",
    "circle-right",
    "circle-speeds",
    "circle-reverse",
    "eight",
    "slalom-small",
    "slalom-large",
    "slalom-growing",
    "speed-steps",
    "steering-steps",
    "shuttle",
    "parking",
    "creep",
    "triangle-sweep",
    "s-reverse",
    "still-start",
];

/// A piece: time, speed, steering and shape.
type Row = (f64, f64, f64, Shape);

/// A manoeuvre: name, kind and pieces.
type Entry = (&'static str, &'static str, &'static [Row]);

const LIBRARY: &[Entry] = &[
    (
        "straight",
        "straight",
        &[
            (1.0, 0.5, 0.0, Step),
            (10.0, 1.0, 0.0, Ramp),
            (4.0, 1.0, 0.0, Step),
            (1.5, 0.0, 0.0, Ramp),
        ],
    ),
    (
        "straight-stops",
        "straight",
        &[
            (3.0, 0.6, 0.0, Step),
            (1.2, 0.0, 0.0, Step),
            (3.5, 1.0, 0.0, Step),
            (1.2, 0.0, 0.0, Step),
            (3.0, 0.35, 0.0, Step),
            (1.2, 0.0, 0.0, Step),
            (3.0, 0.8, 0.0, Step),
            (1.0, 0.0, 0.0, Step),
        ],
    ),
    (
        "straight-both-ways",
        "straight",
        &[
            (3.5, 0.6, 0.0, Step),
            (1.2, 0.0, 0.0, Step),
            (3.5, -0.6, 0.0, Step),
            (1.2, 0.0, 0.0, Step),
            (2.5, 1.0, 0.0, Step),
            (1.3, 0.0, 0.0, Step),
            (2.5, -1.0, 0.0, Step),
            (1.0, 0.0, 0.0, Step),
        ],
    ),
    (
        "circle-left",
        "circle",
        &[
            (0.8, 0.0, 0.8, Ramp),
            (7.0, 0.6, 0.8, Step),
            (7.0, 0.9, 0.8, Step),
            (1.5, 0.0, 0.8, Step),
        ],
    ),
    (
        "circle-right",
        "circle",
        &[
            (0.8, 0.0, -0.8, Ramp),
            (7.0, 0.6, -0.8, Step),
            (7.0, 0.9, -0.8, Step),
            (1.5, 0.0, -0.8, Step),
        ],
    ),
    (
        "circle-speeds",
        "circle",
        &[
            (0.6, 0.0, 0.7, Ramp),
            (3.5, 0.35, 0.7, Step),
            (3.5, 1.0, 0.7, Step),
            (1.0, 1.0, -0.7, Ramp),
            (3.5, 1.0, -0.7, Step),
            (3.5, 0.35, -0.7, Step),
            (1.2, 0.0, 0.0, Ramp),
        ],
    ),
    (
        "circle-reverse",
        "circle",
        &[
            (0.8, 0.0, 0.7, Ramp),
            (5.0, 0.7, 0.7, Step),
            (1.5, 0.0, 0.7, Step),
            (5.0, -0.7, 0.7, Step),
            (1.5, 0.0, -0.7, Ramp),
            (3.0, -0.5, -0.7, Step),
            (1.0, 0.0, -0.7, Step),
        ],
    ),
    (
        "eight",
        "circle",
        &[
            (0.6, 0.0, 0.85, Ramp),
            (7.0, 0.75, 0.85, Step),
            (1.0, 0.75, -0.85, Ramp),
            (7.0, 0.75, -0.85, Step),
            (1.5, 0.0, 0.0, Ramp),
        ],
    ),
    ("slalom-small", "slalom", &[(16.0, 0.8, 0.35, Sine(4.0)), (1.0, 0.0, 0.0, Step)]),
    ("slalom-large", "slalom", &[(16.0, 0.6, 0.95, Sine(2.5)), (1.0, 0.0, 0.0, Step)]),
    (
        "slalom-growing",
        "slalom",
        &[
            (5.0, 0.7, 0.3, Sine(2.0)),
            (5.0, 0.7, 0.6, Sine(1.5)),
            (6.0, 0.7, 0.95, Sine(1.5)),
            (1.0, 0.0, 0.0, Step),
        ],
    ),
    (
        "speed-steps",
        "steps",
        &[
            (2.5, 0.3, 0.25, Step),
            (2.5, 0.9, 0.25, Step),
            (2.5, 0.5, 0.25, Step),
            (2.5, 1.0, -0.25, Step),
            (2.5, 0.2, -0.25, Step),
            (2.5, 0.7, -0.25, Step),
            (1.2, 0.0, -0.25, Step),
        ],
    ),
    (
        "steering-steps",
        "steps",
        &[
            (1.5, 0.6, 0.0, Step),
            (2.0, 0.6, 0.3, Step),
            (2.0, 0.6, -0.1, Step),
            (2.0, 0.6, 0.8, Step),
            (2.0, 0.6, -0.6, Step),
            (2.0, 0.6, 0.15, Step),
            (2.0, 0.6, -0.95, Step),
            (1.5, 0.6, 0.0, Step),
            (1.0, 0.0, 0.0, Step),
        ],
    ),
    (
        "shuttle",
        "shuttle",
        &[
            (2.5, 0.7, 0.3, Step),
            (1.0, 0.0, 0.3, Step),
            (2.5, -0.7, 0.3, Step),
            (1.0, 0.0, -0.3, Step),
            (2.5, 0.7, -0.3, Step),
            (1.0, 0.0, -0.3, Step),
            (2.5, -0.7, -0.3, Step),
            (1.0, 0.0, 0.0, Step),
        ],
    ),
    (
        "parking",
        "parking",
        &[
            (3.0, 0.6, 0.0, Step),
            (1.0, 0.0, 0.0, Step),
            (0.8, 0.0, 0.9, Step),
            (3.0, -0.45, 0.9, Step),
            (0.4, 0.0, -0.9, Ramp),
            (3.0, -0.45, -0.9, Step),
            (1.2, 0.0, 0.0, Step),
            (2.2, 0.35, 0.0, Step),
            (1.0, 0.0, 0.0, Step),
        ],
    ),
    (
        "creep",
        "creep",
        &[
            (3.5, 0.12, 0.3, Step),
            (3.5, 0.2, -0.3, Step),
            (1.0, 0.0, 0.0, Step),
            (3.5, -0.15, 0.5, Step),
            (3.5, 0.3, 0.5, Step),
            (1.2, 0.0, 0.0, Step),
        ],
    ),
    ("triangle-sweep", "steps", &[(16.0, 0.5, 0.9, Triangle(1.5)), (1.0, 0.0, 0.0, Step)]),
    (
        "s-reverse",
        "parking",
        &[
            (2.5, 0.7, 0.0, Step),
            (1.2, 0.0, 0.8, Step),
            (4.5, -0.6, 0.8, Step),
            (1.0, -0.6, -0.8, Ramp),
            (4.5, -0.6, -0.8, Step),
            (1.5, 0.0, 0.0, Ramp),
        ],
    ),
    (
        "still-start",
        "straight",
        &[
            (4.0, 0.0, 0.0, Step),
            (1.5, 0.0, 0.7, Step),
            (1.5, 0.0, -0.7, Step),
            (1.0, 0.0, 0.0, Step),
            (5.0, 0.8, 0.0, Step),
            (2.5, 0.4, 0.5, Step),
            (1.0, 0.0, 0.0, Step),
        ],
    ),
];

/// Name, kind and pieces of the manoeuvre called `name`; none of an unknown name.
pub(super) fn pieces(name: &str) -> Option<(&'static str, &'static str, Vec<Piece>)> {
    let (name, kind, rows) = LIBRARY.iter().find(|entry| entry.0 == name)?;
    let piece = |row: &Row| {
        let (duration, speed, steering, shape) = *row;
        Piece { duration, speed, steering, shape }
    };
    Some((name, kind, rows.iter().map(piece).collect()))
}

//! The framed serial protocol between host and vehicle.

//! The texts of `vehicle.toml` and `run.toml`.

use core::fmt::Write;

use kerbside_geometry::{Drive, Vehicle, WHEELS};

use super::record::Rows;
use super::specification::{Specification, Uncertainty};

/// What the description of a case's vehicle says.
#[must_use]
pub fn vehicle_text(case: &Specification) -> String {
    let mut text = String::new();
    // Writing to a string never fails.
    let _ = body(&mut text, &case.vehicle);
    let _ = sensors(&mut text, &case.vehicle);
    let _ = uncertain(&mut text, &case.uncertainty);
    text
}

fn body(text: &mut String, vehicle: &Vehicle) -> core::fmt::Result {
    let [fl, fr, rl, rr] = vehicle.radius;
    let drive = match vehicle.drive {
        Drive::Rear => "rear",
        Drive::Front => "front",
        Drive::All => "all",
    };
    writeln!(text, "name = \"{}\"", vehicle.name)?;
    writeln!(text, "wheelbase = {:?}", vehicle.wheelbase)?;
    writeln!(
        text,
        "track_front = {:?}\ntrack_rear = {:?}",
        vehicle.track_front, vehicle.track_rear
    )?;
    writeln!(text, "radius = {{ fl = {fl:?}, fr = {fr:?}, rl = {rl:?}, rr = {rr:?} }}")?;
    writeln!(text, "drive = \"{drive}\"")?;
    let outline = &vehicle.footprint;
    writeln!(text, "\n[footprint]\nlength = {:?}\nwidth = {:?}", outline.length, outline.width)?;
    writeln!(text, "rear_overhang = {:?}", outline.rear_overhang)?;
    let limits = &vehicle.limits;
    writeln!(
        text,
        "\n[limits]\nspeed = {:?}\nacceleration = {:?}",
        limits.speed, limits.acceleration
    )?;
    writeln!(text, "steering = {:?}\nsteering_rate = {:?}", limits.steering, limits.steering_rate)?;
    let Some(response) = &vehicle.actuators else { return Ok(()) };
    writeln!(text, "\n[actuators]\nspeed_delay = {:?}", response.speed_delay)?;
    writeln!(text, "speed_lag = {:?}", response.speed_lag)?;
    writeln!(text, "steering_delay = {:?}", response.steering_delay)?;
    writeln!(text, "steering_lag = {:?}", response.steering_lag)
}

fn sensors(text: &mut String, vehicle: &Vehicle) -> core::fmt::Result {
    if let Some(encoders) = &vehicle.encoders {
        let counts = WHEELS.into_iter().filter_map(|wheel| {
            let counts = encoders.counts_per_revolution[wheel.index()]?;
            Some(format!("{} = {counts}", wheel.name()))
        });
        let counts: Vec<_> = counts.collect();
        writeln!(text, "\n[encoders]\ncounts_per_revolution = {{ {} }}", counts.join(", "))?;
        writeln!(text, "counter_bits = {}\nrate = {:?}", encoders.counter_bits, encoders.rate)?;
    }
    if let Some(sensor) = &vehicle.steering_sensor {
        writeln!(
            text,
            "\n[steering_sensor]\nnoise = {:?}\nrate = {:?}",
            sensor.noise, sensor.rate
        )?;
    }
    if let Some(gyro) = &vehicle.gyro {
        writeln!(text, "\n[gyro]\nnoise = {:?}\nrate = {:?}", gyro.noise, gyro.rate)?;
    }
    if let Some(known) = &vehicle.reference {
        let (position, yaw, marker) = (known.position_noise, known.yaw_noise, known.marker);
        writeln!(text, "\n[reference]\nnoise = {{ position = {position:?}, yaw = {yaw:?} }}")?;
        writeln!(text, "rate = {:?}", known.rate)?;
        let (x, y, yaw) = (marker.x, marker.y, marker.yaw);
        writeln!(text, "marker = {{ x = {x:?}, y = {y:?}, yaw = {yaw:?} }}")?;
    }
    Ok(())
}

fn uncertain(text: &mut String, uncertainty: &Uncertainty) -> core::fmt::Result {
    writeln!(text, "\n[uncertainty]")?;
    for (name, deviation) in &uncertainty.fields {
        writeln!(text, "{name} = {deviation:?}")?;
    }
    writeln!(text, "\n[uncertainty.effect]")?;
    for (id, name, deviation) in &uncertainty.effects {
        writeln!(text, "{id}.{name} = {deviation:?}")?;
    }
    Ok(())
}

/// What is known of a run beside its files.
#[must_use]
pub fn run_text(rows: &Rows) -> String {
    let mut text = format!("name = \"{}\"\nmanoeuvre = \"{}\"\n", rows.name, rows.manoeuvre);
    // Writing to a string never fails.
    if let Some(of) = &rows.repeat_of {
        let _ = writeln!(text, "repeat_of = \"{of}\"");
    }
    if let Some(distance) = rows.distance {
        let _ = writeln!(text, "distance = {distance:.3}");
    }
    if let Some(start) = rows.start {
        let (x, y, yaw) = (start.x, start.y, start.yaw);
        let _ = write!(text, "\n[start]\nx = {x:.3}\ny = {y:.3}\nyaw = {yaw:.4}\n");
    }
    text
}

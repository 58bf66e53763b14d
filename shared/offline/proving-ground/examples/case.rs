//! Prints a case: `cargo run --release -p kerbside-proving-ground --example case -- 7 single`.

use kerbside_proving_ground::cases::{Case, Errors, Kind, vehicle_text};

fn main() {
    let mut arguments = std::env::args().skip(1);
    let seed = arguments.next().and_then(|seed| seed.parse().ok()).unwrap_or(7);
    let kind = match arguments.next().as_deref() {
        Some("null") => Kind::Null,
        Some("pair") => Kind::Pair,
        Some("unknown") => Kind::Unknown,
        _ => Kind::Single,
    };
    let case = Case::draw(seed, kind);
    println!("# vehicle.toml\n{}", vehicle_text(&case.specification));
    println!("# label.toml\n{}", case.label().text());
    let (runs, holdout) = (&case.specification.runs, &case.specification.holdout);
    println!("# runs");
    for plan in runs.iter().chain(holdout) {
        let rows = case.record(plan, true, Errors::Drawn(0));
        let (wheels, seen) = (rows.counts.len() + rows.speeds.len(), rows.reference.len());
        let (steering, gyro) = (rows.steering.len(), rows.yaw_rate.len());
        println!(
            "{:22} {:9} {wheels} of wheels, {steering} of steering, {gyro} of gyro, {seen} of reference{}",
            rows.name,
            rows.manoeuvre,
            rows.repeat_of.map_or_else(String::new, |of| format!(", repeats {of}")),
        );
    }
}

use super::piece::Shape;
use super::*;

fn car() -> Vehicle {
    Vehicle::paper_car()
}

#[test]
fn every_manoeuvre_stands_first_keeps_the_limits_and_moves() {
    let (car, duration) = (car(), 18.0);
    let all = Manoeuvre::all(&car, Style::BRISK, duration);
    assert_eq!(all.len(), NAMES.len());
    for manoeuvre in &all {
        let rows = manoeuvre.commands(20.0);
        assert_eq!(rows.len(), 360, "{}", manoeuvre.name);
        for row in &rows {
            assert!(row.speed.abs() <= 0.9 * car.limits.speed + 1e-12, "{}", manoeuvre.name);
            assert!(row.steering.abs() <= 0.9 * car.limits.steering + 1e-12, "{}", manoeuvre.name);
            assert!(row.time >= STILL || (row.speed, row.steering) == (0.0, 0.0));
        }
        let way: f64 = rows.iter().map(|row| row.speed.abs() / 20.0).sum();
        assert!(way > 0.1 * car.limits.speed * duration, "{} covers {way} m", manoeuvre.name);
    }
}

#[test]
fn no_two_manoeuvres_are_the_same_and_half_of_them_reverse_or_stop() {
    let all = Manoeuvre::all(&car(), Style::BRISK, 18.0);
    let rows: Vec<_> = all.iter().map(|manoeuvre| manoeuvre.commands(20.0)).collect();
    for (i, one) in rows.iter().enumerate() {
        assert!(rows[i + 1..].iter().all(|other| one != other), "{}", all[i].name);
    }
    let reversing = rows.iter().filter(|rows| rows.iter().any(|row| row.speed < 0.0)).count();
    assert!(reversing >= 6, "{reversing}");
}

#[test]
fn mirrored_is_the_other_side_and_durations_scale() {
    let style = Style { mirrored: true, ..Style::BRISK };
    let [left, right] = [Style::BRISK, style]
        .map(|style| Manoeuvre::new("eight", &car(), style, 20.0).expect("known").commands(10.0));
    assert!(left.iter().zip(&right).all(|(a, b)| a.steering == -b.steering && a.speed == b.speed));
    let long = Manoeuvre::new("eight", &car(), Style::BRISK, 39.0).expect("known");
    let short = Manoeuvre::new("eight", &car(), Style::BRISK, 20.0).expect("known");
    assert!((long.at(1.0 + 2.0 * 8.0).steering - short.at(9.0).steering).abs() < 1e-12);
    assert_eq!(Manoeuvre::new("loop", &car(), Style::BRISK, 20.0), None);
}

#[test]
fn shapes_go_where_they_say() {
    let piece = |shape| Piece { duration: 1.0, speed: 1.0, steering: 0.5, shape };
    assert_eq!(piece(Shape::Ramp).at(0.5, (0.0, -0.5)), (0.5, 0.0));
    let triangle = |share| piece(Shape::Triangle(1.0)).at(share, (0.0, 0.0)).1;
    for (share, expected) in [(0.0, 0.0), (0.125, 0.25), (0.25, 0.5), (0.5, 0.0), (0.75, -0.5)] {
        assert!((triangle(share) - expected).abs() < 1e-12, "{share}: {}", triangle(share));
    }
    let sine = piece(Shape::Sine(2.0)).at(0.125, (0.0, 0.0)).1;
    assert!((sine - 0.5).abs() < 1e-12, "{sine}");
}

//! The same case with a vehicle that differs by what its description may be wrong by.

use kerbside_geometry::WHEELS;

use super::Case;
use crate::insertions::Effect;

impl Case {
    /// One case for each thing that the description may be wrong by, with its name: the true vehicle deviates in it by one
    /// standard deviation more. The differences of what they record without noise are what such an uncertainty explains.
    /// Where the description leaves open what is put in as well, that deviates, too: so much of it a vehicle in good order
    /// may have.
    #[must_use]
    pub fn deviations(&self) -> Vec<(String, Self)> {
        let uncertainty = &self.specification.uncertainty;
        let mut out = Vec::new();
        for (field, deviation) in &uncertainty.fields {
            if *field == "radius" {
                let wheels = WHEELS.map(|wheel| {
                    let mut case = self.clone();
                    case.specification.truth.radius[wheel.index()] += deviation;
                    (format!("radius.{}", wheel.name()), case)
                });
                out.extend(wheels);
            } else {
                out.push(((*field).to_owned(), self.with_field(field, *deviation)));
            }
        }
        for (id, name, deviation) in &uncertainty.effects {
            out.push((format!("{id}.{name}"), self.with_habit(id, name, *deviation)));
        }
        out
    }

    fn with_field(&self, field: &str, deviation: f64) -> Self {
        let mut case = self.clone();
        let truth = &mut case.specification.truth;
        let mut response = truth.response();
        match field {
            "wheelbase" => truth.wheelbase += deviation,
            "track_front" => truth.track_front += deviation,
            "track_rear" => truth.track_rear += deviation,
            "speed_lag" => response.speed_lag += deviation,
            "steering_lag" => response.steering_lag += deviation,
            _ => {}
        }
        truth.actuators = Some(response);
        case
    }

    fn with_habit(&self, id: &'static str, name: &'static str, deviation: f64) -> Self {
        let mut case = self.clone();
        let moved = Effect::new(id, &[]).get(name) + deviation;
        let of = &mut case.specification;
        let mut known = of.effects.iter_mut().chain(&mut of.habits);
        let Some(habit) = known.find(|habit| habit.id == id) else {
            of.habits.push(Effect::new(id, &[(name, moved)]));
            return case;
        };
        match habit.values.iter_mut().find(|value| value.0 == name) {
            Some(value) => value.1 += deviation,
            None => habit.values.push((name, moved)),
        }
        case
    }
}

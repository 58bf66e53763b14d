//! Effects and their parameters.

use kerbside_geometry::{Vehicle, Wheel};

/// Where on the way from command to reading a gap arises.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Link {
    /// Commanded speed to wheel motion.
    SpeedActuation,
    /// Commanded steering to the rack.
    SteeringActuation,
    /// Motion of wheels, rack and body to counts, sensor and gyro.
    Sensing,
    /// Wheel motion and rack to motion of the body.
    Ground,
    /// Motion of the body to the reference's reading.
    Reference,
}

impl Link {
    /// The name that files use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::SpeedActuation => "speed_actuation",
            Self::SteeringActuation => "steering_actuation",
            Self::Sensing => "sensing",
            Self::Ground => "ground",
            Self::Reference => "reference",
        }
    }
}

/// What a parameter grows with from the car of scale 1:6 to another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Nothing.
    Plain,
    /// With the wheelbase.
    Length,
    /// With the largest speed.
    Speed,
    /// With the largest acceleration.
    Acceleration,
    /// As one over an acceleration.
    PerAcceleration,
    /// As one over the square of a speed.
    PerSpeedSquared,
    /// With the time in which the car covers its wheelbase.
    Passage,
    /// With the largest rate of the steering.
    SteeringRate,
}

impl Unit {
    /// Factor from the 1:6 car to `vehicle`.
    #[must_use]
    pub fn scale(self, vehicle: &Vehicle) -> f64 {
        let limits = &vehicle.limits;
        let (length, speed) = (vehicle.wheelbase / 0.5, limits.speed / 0.5);
        let acceleration = limits.acceleration / 0.3;
        match self {
            Self::Plain => 1.0,
            Self::Length => length,
            Self::Speed => speed,
            Self::Acceleration => acceleration,
            Self::PerAcceleration => 1.0 / acceleration,
            Self::PerSpeedSquared => 1.0 / (speed * speed),
            Self::Passage => length / speed,
            Self::SteeringRate => limits.steering_rate / 0.8,
        }
    }
}

/// What a parameter says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// How strong the effect is: neutral to one end of its range, to either end where it may have both signs.
    Size,
    /// The lower, the stronger; neutral is infinite.
    Limit,
    /// Anything within the range.
    Free,
    /// A coordinate that the drives pass by.
    Place,
}

/// A parameter of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Its name.
    pub name: &'static str,
    /// The value that changes nothing.
    pub neutral: f64,
    /// Lowest sane value, of the 1:6 car.
    pub low: f64,
    /// Highest sane value, of the 1:6 car.
    pub high: f64,
    /// How the range grows with the car.
    pub unit: Unit,
    /// What it says.
    pub role: Role,
}

/// An effect as such.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Definition {
    /// Its name.
    pub id: &'static str,
    /// Where its gap arises.
    pub link: Link,
    /// Its parameters.
    pub parameters: &'static [Parameter],
    /// Whether it is about one wheel.
    pub of_wheel: bool,
    /// What happens, for people; `{name}` stands for the parameter's value.
    pub sentence: &'static str,
}

/// An effect that is put in.
#[derive(Clone, Debug, PartialEq)]
pub struct Effect {
    /// Its name.
    pub id: &'static str,
    /// Values of its parameters.
    pub values: Vec<(&'static str, f64)>,
    /// Which wheel, where it is about one.
    pub wheel: Option<Wheel>,
}

impl Effect {
    /// An effect about no single wheel.
    #[must_use]
    pub fn new(id: &'static str, values: &[(&'static str, f64)]) -> Self {
        Self { id, values: values.to_vec(), wheel: None }
    }

    /// An effect about `wheel`.
    #[must_use]
    pub fn of_wheel(id: &'static str, wheel: Wheel, values: &[(&'static str, f64)]) -> Self {
        Self { wheel: Some(wheel), ..Self::new(id, values) }
    }

    /// The value of a parameter; of one that is not given what changes nothing.
    #[must_use]
    pub fn get(&self, name: &str) -> f64 {
        let given = self.values.iter().find(|value| value.0 == name).map(|value| value.1);
        given.unwrap_or_else(|| neutral(self.id, name))
    }

    /// What happens, for people.
    #[must_use]
    pub fn sentence(&self) -> String {
        let mut text =
            super::definition(self.id).map_or("", |definition| definition.sentence).to_owned();
        for (name, value) in &self.values {
            text = text.replace(&format!("{{{name}}}"), &format!("{value:.4}"));
        }
        let wheel = self.wheel.map_or("", |wheel| match wheel {
            Wheel::FrontLeft => "front left",
            Wheel::FrontRight => "front right",
            Wheel::RearLeft => "rear left",
            Wheel::RearRight => "rear right",
        });
        text.replace("{wheel}", wheel)
    }
}

fn neutral(id: &str, name: &str) -> f64 {
    let parameters = super::definition(id).map_or(&[][..], |definition| definition.parameters);
    parameters.iter().find(|parameter| parameter.name == name).map_or(0.0, |known| known.neutral)
}

/// `small` effects together, their distances from neutral added where ids meet, and `inserted` ones in their place.
#[must_use]
pub fn merged(small: &[&[Effect]], inserted: &[Effect]) -> Vec<Effect> {
    let mut all: Vec<Effect> = Vec::new();
    let is_inserted = |id: &str| inserted.iter().any(|effect| effect.id == id);
    for effect in small.iter().copied().flatten().filter(|effect| !is_inserted(effect.id)) {
        let Some(known) = all.iter_mut().find(|known| known.id == effect.id) else {
            all.push(effect.clone());
            continue;
        };
        for (name, value) in &effect.values {
            let distance = value - neutral(effect.id, name);
            match known.values.iter_mut().find(|known| known.0 == *name) {
                Some(known) => known.1 += distance,
                None => known.values.push((name, *value)),
            }
        }
    }
    all.extend(inserted.iter().cloned());
    all
}

/// A size.
pub(super) const fn size(
    name: &'static str,
    neutral: f64,
    low: f64,
    high: f64,
    unit: Unit,
) -> Parameter {
    Parameter { name, neutral, low, high, unit, role: Role::Size }
}

/// A parameter that is no size.
pub(super) const fn other(
    name: &'static str,
    low: f64,
    high: f64,
    unit: Unit,
    role: Role,
) -> Parameter {
    let neutral = if matches!(role, Role::Limit) { f64::INFINITY } else { 0.0 };
    Parameter { name, neutral, low, high, unit, role }
}

/// An effect about no single wheel.
pub(super) const fn effect(
    id: &'static str,
    link: Link,
    parameters: &'static [Parameter],
    sentence: &'static str,
) -> Definition {
    Definition { id, link, parameters, of_wheel: false, sentence }
}

/// An effect about one wheel.
pub(super) const fn of_wheel(
    id: &'static str,
    parameters: &'static [Parameter],
    link: Link,
    sentence: &'static str,
) -> Definition {
    Definition { id, link, parameters, of_wheel: true, sentence }
}

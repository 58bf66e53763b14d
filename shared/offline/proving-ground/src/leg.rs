//! A stretch of path driven in one direction.

/// A piece of path of constant curvature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Along the path, positive \[m\].
    pub length: f64,
    /// Left of the vehicle positive, in reverse as well: tan(steering) / wheelbase \[1/m\].
    pub curvature: f64,
}

impl Section {
    /// A straight of `length` \[m\].
    #[must_use]
    pub const fn straight(length: f64) -> Self {
        Self { length, curvature: 0.0 }
    }

    /// An arc of `radius` \[m\], left positive, on which the car turns by `angle` \[rad\], positive.
    #[must_use]
    pub fn arc(radius: f64, angle: f64) -> Self {
        Self { length: radius.abs() * angle, curvature: 1.0 / radius }
    }
}

/// Where the curvature changes how it changes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Knot {
    distance: f64,
    curvature: f64,
}

/// A stretch of path driven in one direction: the curvature is piecewise linear in the distance.
#[derive(Clone, Debug, PartialEq)]
pub struct Leg {
    direction: f64,
    knots: Vec<Knot>,
}

impl Leg {
    /// A leg along `sections`, `forward` or in reverse. Where two of them meet, the curvature goes from one to the other
    /// over `ramp` \[m\], half of it in each (less where one is too short); so neither the length of the path nor
    /// the angle it turns by depends on the ramps. Sections without length are left out.
    #[must_use]
    pub fn new(forward: bool, sections: &[Section], ramp: f64) -> Self {
        let sections: Vec<_> = sections.iter().filter(|section| section.length > 0.0).collect();
        let first = sections.first().map_or(0.0, |section| section.curvature);
        let mut knots = vec![Knot { distance: 0.0, curvature: first }];
        let mut distance = 0.0;
        for pair in sections.windows(2) {
            let (before, behind) = (pair[0], pair[1]);
            distance += before.length;
            let half = 0.5 * ramp.min(before.length).min(behind.length).max(0.0);
            if before.curvature != behind.curvature {
                let knot = |distance, curvature| Knot { distance, curvature };
                knots.push(knot(distance - half, before.curvature));
                knots.push(knot(distance + half, behind.curvature));
            }
        }
        if let Some(last) = sections.last() {
            knots.push(Knot { distance: distance + last.length, curvature: last.curvature });
        }
        Self { direction: if forward { 1.0 } else { -1.0 }, knots }
    }

    /// 1 forward, -1 in reverse.
    #[must_use]
    pub fn direction(&self) -> f64 {
        self.direction
    }

    /// Length of the path \[m\].
    #[must_use]
    pub fn length(&self) -> f64 {
        self.knots.last().map_or(0.0, |knot| knot.distance)
    }

    /// Curvature \[1/m\] and its change per metre of path \[1/m^2\] at `distance` \[m\]; beyond its ends the leg goes on
    /// as it ends. Where the curvature jumps, what is behind the jump.
    #[must_use]
    pub fn curvature(&self, distance: f64) -> (f64, f64) {
        let behind = self.knots.partition_point(|knot| knot.distance <= distance);
        if behind == 0 || behind == self.knots.len() {
            let knot = if behind == 0 { self.knots.first() } else { self.knots.last() };
            return (knot.map_or(0.0, |knot| knot.curvature), 0.0);
        }
        let (a, b) = (&self.knots[behind - 1], &self.knots[behind]);
        let slope = (b.curvature - a.curvature) / (b.distance - a.distance);
        (a.curvature + slope * (distance - a.distance), slope)
    }

    /// The next knot behind `distance` \[m\], infinity for none.
    pub(crate) fn next_knot(&self, distance: f64) -> f64 {
        let behind = self.knots.partition_point(|knot| knot.distance <= distance);
        self.knots.get(behind).map_or(f64::INFINITY, |knot| knot.distance)
    }

    /// Distances of the knots \[m\].
    pub(crate) fn knots(&self) -> impl Iterator<Item = f64> + '_ {
        self.knots.iter().map(|knot| knot.distance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ramps_change_neither_length_nor_angle() {
        let sections = [Section::straight(1.0), Section::arc(1.2, 1.5), Section::straight(0.5)];
        let leg = Leg::new(true, &sections, 0.15);
        assert!((leg.length() - (1.5 + 1.8)).abs() < 1e-12);
        let (steps, mut turned) = (100_000, 0.0);
        let step = leg.length() / f64::from(steps);
        for k in 0..steps {
            turned += leg.curvature((f64::from(k) + 0.5) * step).0 * step;
        }
        assert!((turned - 1.5).abs() < 1e-9, "{turned}");
        assert!((leg.curvature(1.0).0 - 0.5 / 1.2).abs() < 1e-12, "half-way where they meet");
        assert!((leg.curvature(1.0).1 - 1.0 / 1.2 / 0.15).abs() < 1e-9);
        assert_eq!(leg.curvature(0.9).0, 0.0);
        assert_eq!(leg.curvature(9.0), (0.0, 0.0));
    }

    #[test]
    fn without_a_ramp_the_curvature_jumps() {
        let leg = Leg::new(false, &[Section::straight(1.0), Section::arc(-2.0, 0.5)], 0.0);
        assert_eq!((leg.curvature(0.999_999).0, leg.curvature(1.0).0), (0.0, -0.5));
        assert_eq!(leg.direction(), -1.0);
        assert_eq!(Leg::new(true, &[], 0.1).length(), 0.0);
    }
}

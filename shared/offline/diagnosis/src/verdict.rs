//! What a diagnosis says.

use kerbside_simulation::effects::Link;

/// The answer in one word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// One or more listed effects.
    Effects,
    /// Several sets of effects that these runs cannot tell apart.
    Ambiguous,
    /// No gap beyond the floor and what a car in good order may have.
    None,
    /// A real gap that no listed effect explains.
    Unknown,
    /// A mistake in vehicle.toml or in a recorded signal.
    Mistake,
}

impl Verdict {
    /// As in diagnosis.json.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Effects => "effects",
            Self::Ambiguous => "ambiguous",
            Self::None => "none",
            Self::Unknown => "unknown",
            Self::Mistake => "mistake",
        }
    }
}

/// A value with its 90 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Most likely.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// A parameter of an effect, in the unit of effects.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundParameter {
    /// Name.
    pub name: &'static str,
    /// Unit, empty for none.
    pub unit: &'static str,
    /// Value.
    pub value: Interval,
}

/// An effect that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundEffect {
    /// Name in the library.
    pub id: &'static str,
    /// Where its gap arises.
    pub link: Link,
    /// Which wheel, of effects that have one: fl, fr, rl or rr.
    pub wheel: Option<&'static str>,
    /// Parameters.
    pub parameters: Vec<FoundParameter>,
    /// Probability that it is at work.
    pub probability: f64,
}

/// A set of effects said to act together.
#[derive(Clone, Debug, PartialEq)]
pub struct Alternative {
    /// Names in the library.
    pub ids: Vec<&'static str>,
    /// Probability.
    pub probability: f64,
}

/// A rival worth showing: a set of effects, `none` or `unknown`.
#[derive(Clone, Debug, PartialEq)]
pub struct Rival {
    /// Names joined by ` + `.
    pub name: String,
    /// Probability.
    pub probability: f64,
    /// Twice the gain in log-likelihood over no effect.
    pub gain: f64,
    /// The same on each run while it was left out of the fit, in the order of the runs.
    pub left_out: Vec<f64>,
}

/// How far one link's output is from what its measured input explains, over two seconds.
#[derive(Clone, Debug, PartialEq)]
pub struct LinkGap {
    /// Which.
    pub link: Link,
    /// The signal that shows most, in words.
    pub signal: &'static str,
    /// Unit of all that follows.
    pub unit: &'static str,
    /// Root mean square of the residual.
    pub gap: f64,
    /// What noise alone makes of it.
    pub floor: f64,
    /// What a car in good order may add.
    pub allowance: f64,
    /// What is left.
    pub excess: f64,
    /// 90 % interval of the excess: bootstrap over runs and blocks.
    pub low: f64,
    /// See `low`.
    pub high: f64,
    /// Whether the runs have what the link needs.
    pub measured: bool,
}

/// How far the trajectory's gap shrinks, on runs that chose and fitted nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct Shrinkage {
    /// Root mean square position error from a common start, nominal vehicle \[m\].
    pub before: f64,
    /// With the effects \[m\].
    pub after: f64,
    /// Of noise alone \[m\].
    pub floor: f64,
    /// Share of the explainable gap that is removed; none where there is nothing to explain. Of a single run nothing is
    /// known of its interval: then its ends are not numbers.
    pub removed: Option<Interval>,
    /// On which runs.
    pub judged: Judged,
    /// The same of yaw: before, after, floor \[rad\].
    pub yaw: [f64; 3],
    /// Position errors after each effect is added, in their order \[m\].
    pub steps: Vec<f64>,
}

/// On which runs it is judged how far a gap shrinks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judged {
    /// Each while it was left out of choice and fit.
    LeftOut,
    /// All of them, with effects that were given by hand.
    ByHand,
    /// The only one, to which the effects were fitted.
    Fitted,
}

impl Judged {
    /// In words.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::LeftOut => "runs left out",
            Self::ByHand => "these runs",
            Self::Fitted => "the run that it was fitted to",
        }
    }
}

/// A mistake in one's own description or in a recorded signal.
#[derive(Clone, Debug, PartialEq)]
pub struct Mistake {
    /// `sign`, `degrees`, `swap`, `track_for_wheelbase`, `diameter_for_radius`, `unit` or `frame`.
    pub kind: &'static str,
    /// In words.
    pub detail: String,
    /// The link whose input is wrong.
    pub link: Link,
}

/// A point of the map: where the residual is large.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapPoint {
    /// Place in the reference frame \[m\].
    pub x: f64,
    /// See `x`.
    pub y: f64,
    /// Residual over its floor, of the link that is shown.
    pub excess: f64,
    /// Direction in which the vehicle went astray in the reference frame \[rad\].
    pub direction: f64,
}

/// A run's paths, each laid on the measured start \[m\].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunPaths {
    /// Name.
    pub name: String,
    /// As measured by the reference.
    pub measured: Vec<(f64, f64)>,
    /// As the nominal vehicle would have gone.
    pub nominal: Vec<(f64, f64)>,
    /// As the vehicle with the effects would have gone.
    pub after: Vec<(f64, f64)>,
    /// Where the residual is large.
    pub map: Vec<MapPoint>,
    /// Time and distance from the measured path, nominal and with effects \[s, m, m\].
    pub errors: Vec<(f64, f64, f64)>,
}

/// The residual against what it depends on most, before and after.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RegimePlot {
    /// The axis, in words, with its unit.
    pub axis: String,
    /// The residual, in words, with its unit.
    pub signal: String,
    /// Axis value, residual before, residual after.
    pub points: Vec<(f64, f64, f64)>,
}

/// What to drive next.
#[derive(Clone, Debug, PartialEq)]
pub struct Next {
    /// Name of the manoeuvre.
    pub manoeuvre: String,
    /// The sets of effects that it separates.
    pub separates: Vec<Vec<&'static str>>,
    /// Expected difference in standard deviations of the noise.
    pub sigma: f64,
    /// Its commands: t \[s\], speed \[m/s\], steering \[rad\].
    pub commands: Vec<(f64, f64, f64)>,
}

/// Everything that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnosis {
    /// Name of the case.
    pub case: String,
    /// The answer.
    pub verdict: Verdict,
    /// One sentence that a tired engineer understands.
    pub sentence: String,
    /// Links of the answer, in the order of cause; empty for `none`.
    pub links_named: Vec<Link>,
    /// Links whose patterns the residuals have before any effect is fitted, at most two, the likeliest first; empty
    /// where nothing is beyond floor and allowance.
    pub moved: Vec<Link>,
    /// The answer's effects; of an ambiguous one the likeliest alternative's.
    pub effects: Vec<FoundEffect>,
    /// The 90 % set.
    pub alternatives: Vec<Alternative>,
    /// Probability that another effect acts beside the answer's that is too small for these runs; it is part of no
    /// alternative.
    pub unseen: f64,
    /// Every rival worth showing, likeliest first.
    pub ranking: Vec<Rival>,
    /// The mistake, where the verdict is one.
    pub mistake: Option<Mistake>,
    /// Every link, in the order of cause.
    pub links: Vec<LinkGap>,
    /// How far the gap shrinks; none where there is no reference.
    pub gap: Option<Shrinkage>,
    /// Under which circumstances the gap shows, in words; empty where there is none.
    pub regime: String,
    /// Effects that these runs cannot show.
    pub not_excited: Vec<&'static str>,
    /// The smallest size of each effect that would have been seen.
    pub smallest_seen: Vec<(&'static str, f64)>,
    /// What to drive next; none where nothing is left to separate.
    pub next: Option<Next>,
    /// Paths of every run.
    pub paths: Vec<RunPaths>,
    /// The residual against the circumstance that matters; none where there is none.
    pub plot: Option<RegimePlot>,
    /// Error of the position over horizons, nominal, with effects and floor: \[s, m, m, m\].
    pub horizons: Vec<(f64, f64, f64, f64)>,
    /// What a person should know: what was missing, merged, widened.
    pub notices: Vec<String>,
    /// Duration of all runs \[s\].
    pub duration: f64,
}

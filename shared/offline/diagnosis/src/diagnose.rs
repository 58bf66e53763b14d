//! From a case to an answer.

use kerbside_simulation::effects::Link;
use kerbside_simulation::{Command, Effects, Overlay};
use thiserror::Error;

use crate::analyse::{Analysis, analyse, prior};
use crate::answer;
use crate::blocks;
use crate::case::Case;
use crate::decide::{Decision, decide};
use crate::fit::Search;
use crate::folds::{self, Linearised};
use crate::gauge::gauge;
use crate::links;
use crate::mistakes;
use crate::moved;
use crate::nuisance::{Nuisance, nuisances};
use crate::pictures;
use crate::prepare::Ready;
use crate::shrink;
use crate::trust;
use crate::unseen;
use crate::verdict::{Diagnosis, FoundEffect, Mistake, Rival, Verdict};
use crate::words;

/// A manoeuvre that could be driven next.
#[derive(Clone, Debug, PartialEq)]
pub struct Manoeuvre {
    /// Its name.
    pub name: String,
    /// Its commands.
    pub commands: Vec<Command>,
}

/// What a diagnosis is given besides the case.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// Effects given by hand: the gap is shown before and after these instead of those that are found.
    pub model: Option<Overlay>,
    /// Manoeuvres from which the next one is chosen.
    pub menu: Vec<Manoeuvre>,
}

/// Why a case cannot be diagnosed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum DiagnosisError {
    /// Nothing was recorded.
    #[error("there is no run")]
    NoRun,
    /// Nothing moved, or nothing can be predicted of what was recorded.
    #[error("the runs hold nothing that a model could be held against: {0}")]
    Nothing(String),
}

/// Rivals that are shown and from which left-out runs choose.
const RIVALS: usize = 8;

/// Diagnoses a case. `progress` is told what is being done and how much is done, 0 to 1.
///
/// # Errors
/// [`DiagnosisError`] where the case has nothing to diagnose.
pub fn diagnose(
    case: &Case,
    settings: &Settings,
    progress: &dyn Fn(&str, f64),
) -> Result<Diagnosis, DiagnosisError> {
    if case.runs.is_empty() {
        return Err(DiagnosisError::NoRun);
    }
    progress("looking for mistakes", 0.0);
    let recorded = case;
    let blocks::Cut { case, drives, notices } = &blocks::cut(case);
    if case.runs.is_empty() {
        let why = notices.join("; ");
        return Err(DiagnosisError::Nothing(why));
    }
    let differ = nuisances(case);
    let mistake = mistakes::find(&blocks::excerpt(case), &differ, prior);
    let mut ready = Ready::new(case);
    ready.drives.clone_from(drives);
    let found = analyse(&ready, &differ, progress).ok_or_else(|| {
        DiagnosisError::Nothing("no sensor shows anything that commands could explain".to_owned())
    })?;
    progress("which of them", 0.86);
    let mut decision = decide(&found);
    let search = Search { bench: &found.bench, candidates: &found.candidates };
    trust::distrust(&found, &search, &mut decision);
    unseen::account(&found, &search, &mut decision);
    let mut told = told(
        case,
        &Found { analysis: &found, decision: &decision, nuisances: &differ },
        settings,
        mistake,
        progress,
    );
    told.notices = words::notices(recorded);
    told.notices.extend(notices.iter().cloned());
    Ok(told)
}

/// What was found, in one place.
pub(crate) struct Found<'a> {
    pub analysis: &'a Analysis<'a>,
    pub decision: &'a Decision,
    pub nuisances: &'a [Nuisance],
}

fn told(
    case: &Case,
    found: &Found<'_>,
    settings: &Settings,
    mistake: Option<Mistake>,
    progress: &dyn Fn(&str, f64),
) -> Diagnosis {
    let Found { analysis, decision, .. } = found;
    let search = Search { bench: &analysis.bench, candidates: &analysis.candidates };
    let verdict = if mistake.is_some() { Verdict::Mistake } else { decision.verdict };
    let named = matches!(verdict, Verdict::Effects | Verdict::Ambiguous);
    let effects = if named { answer::effects(found, &search) } else { Vec::new() };
    let by_hand = settings.model.as_ref().map(Effects::from);
    let after = by_hand.or_else(|| named.then(|| analysis.fits[decision.sets[0].fit].effects));
    let neutral: Vec<_> = analysis
        .bench
        .all()
        .iter()
        .map(|run| analysis.bench.raw_of(*run, &Effects::NEUTRAL))
        .collect();
    progress("the gap, link by link", 0.87);
    let chain = links::chain(&analysis.bench, &analysis.noise, &neutral);
    let links_named = links_named(verdict, mistake.as_ref(), decision, &effects);
    let rivals: Vec<usize> = decision.sets.iter().take(RIVALS).map(|weighed| weighed.fit).collect();
    progress("how far the gap shrinks", 0.88);
    let gap = shrink::shrinkage(found, &search, &rivals, by_hand.as_ref(), named);
    progress("what to drive next", 0.94);
    let gauges = gauge(&search);
    let next = answer::next(case, found, &search, settings);
    let mut diagnosis = Diagnosis {
        case: case.name.clone(),
        verdict,
        sentence: String::new(),
        links_named,
        moved: moved::moved(&search, &analysis.beside_nothing).iter().map(|(l, _)| *l).collect(),
        alternatives: answer::alternatives(found),
        effects,
        unseen: if named { decision.sets[0].unseen } else { 0.0 },
        ranking: ranking(found, &search, &rivals),
        mistake,
        links: chain,
        gap,
        regime: words::regime(found, verdict),
        not_excited: gauges.iter().filter(|gauge| !gauge.excited).map(|gauge| gauge.id).collect(),
        smallest_seen: gauges
            .iter()
            .filter(|gauge| gauge.excited)
            .map(|g| (g.id, g.smallest))
            .collect(),
        next,
        paths: pictures::paths(found, after.as_ref()),
        plot: pictures::plot(found, after.as_ref()),
        horizons: pictures::horizons(found, after.as_ref()),
        notices: Vec::new(),
        duration: case.runs.iter().map(|run| run.span()).map(|(begin, end)| end - begin).sum(),
    };
    if verdict == Verdict::Mistake {
        diagnosis.alternatives.clear();
    }
    diagnosis.sentence = words::sentence(&diagnosis, decision);
    diagnosis
}

/// Links of the answer, in the order of cause.
fn links_named(
    verdict: Verdict,
    mistake: Option<&Mistake>,
    decision: &Decision,
    effects: &[FoundEffect],
) -> Vec<Link> {
    match verdict {
        Verdict::Mistake => mistake.into_iter().map(|mistake| mistake.link).collect(),
        Verdict::None => Vec::new(),
        Verdict::Unknown => {
            decision.unknown_links.first().map(|(link, _)| *link).into_iter().collect()
        }
        Verdict::Effects | Verdict::Ambiguous => {
            let mut links: Vec<Link> = effects.iter().map(|effect| effect.link).collect();
            links.sort_unstable();
            links.dedup();
            links
        }
    }
}

/// Every rival worth showing, likeliest first.
fn ranking(found: &Found<'_>, search: &Search<'_>, rivals: &[usize]) -> Vec<Rival> {
    let Found { analysis, decision, .. } = found;
    let nothing = Linearised::new(search, &analysis.nothing);
    let mut ranking: Vec<Rival> = decision
        .sets
        .iter()
        .filter(|weighed| rivals.contains(&weighed.fit))
        .map(|weighed| {
            let fit = &analysis.fits[weighed.fit];
            let own = Linearised::new(search, fit);
            let left_out = match (&nothing, &own) {
                (Some(nothing), Some(own)) => folds::left_out(search, nothing, fit, own),
                _ => Vec::new(),
            };
            let names: Vec<&str> =
                fit.set.iter().map(|c| analysis.candidates[*c].definition.id).collect();
            let (probability, gain) = (weighed.probability, analysis.nothing.cost - fit.cost);
            Rival { name: names.join(" + "), probability, gain, left_out }
        })
        .collect();
    let rest = |name: &str, probability: f64, gain: f64| Rival {
        name: name.to_owned(),
        probability,
        gain,
        left_out: Vec::new(),
    };
    ranking.push(rest("none", decision.none, 0.0));
    let shape = decision.shape.map_or(0.0, |shape| shape.gain);
    ranking.push(rest("unknown", decision.unknown, shape));
    ranking.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    ranking.truncate(RIVALS);
    ranking
}

//! The page of a diagnosis.

use kerbside_diagnosis::{Interval, Judged, Verdict as Answer};

use super::data::{DiagnoseReport, plain};
use super::place::capital;
use crate::ReportError;
use crate::format::{self, UNKNOWN, percent, probability, significant, with_unit};
use crate::page::{Block, KeyFigure, Page, Section, Verdict};
use crate::svg::Tone;

impl DiagnoseReport {
    /// The report as one HTML file.
    ///
    /// # Errors
    /// Where the page's template cannot be filled.
    pub fn render(&self) -> Result<String, ReportError> {
        self.page().render()
    }

    /// The report as a page, for those who want to add to it.
    #[must_use]
    pub fn page(&self) -> Page {
        let mut sections = Vec::new();
        sections.extend(self.mistake_section());
        sections.extend([self.place_section(), self.which_section()]);
        sections.extend(self.far_section());
        sections.extend([self.sure_section(), self.next_section()]);
        sections.push(self.provenance.section());
        let runs = format::plural(self.runs.len() as u64, "run", "runs");
        let duration = with_unit(&format::fixed(self.diagnosis.duration, 0), "s");
        Page {
            title: self.diagnosis.case.clone(),
            kind: "Diagnosis".to_owned(),
            subtitle: format!("{}, {runs}, {duration} in all", self.vehicle),
            verdict: self.verdict(),
            key_figures: self.key_figures(),
            sections,
            footer: self.provenance.footer(),
        }
    }

    fn verdict(&self) -> Verdict {
        let (tone, headline) = match self.diagnosis.verdict {
            Answer::Effects if self.diagnosis.effects.len() > 1 => (Tone::Warn, "Several effects."),
            Answer::Effects => (Tone::Warn, "One effect."),
            Answer::Ambiguous => (Tone::Warn, "Not decided."),
            Answer::None => (Tone::Good, "No gap."),
            Answer::Unknown => (Tone::Bad, "Unknown cause."),
            Answer::Mistake => (Tone::Bad, "A mistake."),
        };
        let sentence = self.diagnosis.sentence.clone();
        Verdict { tone, headline: headline.to_owned(), sentence }
    }

    fn key_figures(&self) -> Vec<KeyFigure> {
        let diagnosis = &self.diagnosis;
        let links: Vec<String> =
            diagnosis.links_named.iter().map(|link| plain(link.name())).collect();
        let place = if links.is_empty() { "nowhere".to_owned() } else { links.join(", ") };
        let gap = diagnosis.gap.as_ref();
        let metres = |value: Option<f64>| {
            format::optional(value, |value| with_unit(&significant(value, 3), "m"))
        };
        let has_effects = !diagnosis.effects.is_empty();
        let removed = gap.and_then(|gap| gap.removed).filter(|_| has_effects);
        let on = removed.map_or_else(
            || "of the explainable gap".to_owned(),
            |removed| between(&removed, gap.map_or(Judged::LeftOut, |gap| gap.judged)),
        );
        let regime = match diagnosis.regime.as_str() {
            "" if links.is_empty() => "no link is beyond what is allowed",
            "" => "in the chain from command to reference",
            regime => regime,
        };
        vec![
            KeyFigure::plain("Where", capital(&place), regime),
            KeyFigure::plain("Cause", capital(&self.cause()), &self.cause_note()),
            KeyFigure::plain("Probability", self.probability(), &self.probability_note()),
            KeyFigure::plain(
                "Gap removed",
                format::optional(removed.map(|r| r.value), percent),
                &on,
            ),
            KeyFigure::plain(
                "Error before",
                metres(gap.map(|gap| gap.before)),
                "position, rms along the way",
            ),
            KeyFigure::plain(
                "Error after",
                metres(gap.filter(|_| has_effects).map(|gap| gap.after)),
                "with the effects",
            ),
            KeyFigure::plain(
                "Noise alone",
                metres(gap.map(|gap| gap.floor)),
                "no model does better",
            ),
            KeyFigure::plain(
                "Not excited",
                format::count(diagnosis.not_excited.len() as u64),
                "effects these runs cannot show",
            ),
        ]
    }

    fn cause(&self) -> String {
        let diagnosis = &self.diagnosis;
        let names =
            |ids: Vec<&str>, and: &str| ids.into_iter().map(plain).collect::<Vec<_>>().join(and);
        match (diagnosis.verdict, &diagnosis.mistake) {
            (Answer::Effects, _) => {
                names(diagnosis.effects.iter().map(|effect| effect.id).collect(), " + ")
            }
            (Answer::Ambiguous, _) => {
                let sets = diagnosis.alternatives.iter();
                sets.map(|set| names(set.ids.clone(), " + ")).collect::<Vec<_>>().join(" or ")
            }
            (Answer::Mistake, Some(mistake)) => plain(mistake.kind),
            (verdict, _) => verdict.name().to_owned(),
        }
    }

    /// The size of a single effect of a single parameter, else what kind of answer it is.
    fn cause_note(&self) -> String {
        match (&self.diagnosis.effects[..], self.diagnosis.verdict) {
            ([effect], Answer::Effects) => {
                let words = effect.parameters.iter().map(|parameter| {
                    let value = parameter.value;
                    let text = format::interval([value.value, value.low, value.high]);
                    format!("{} {}", plain(parameter.name), with_unit(&text, parameter.unit))
                });
                words.collect::<Vec<_>>().join(", ")
            }
            (_, Answer::Effects) => "sizes below".to_owned(),
            (_, Answer::Ambiguous) => "these runs cannot tell".to_owned(),
            (_, Answer::None) => "beyond noise and allowance".to_owned(),
            (_, Answer::Unknown) => "no listed effect explains it".to_owned(),
            (_, Answer::Mistake) => "in the description or a signal".to_owned(),
        }
    }

    /// Of the answer: of its alternative, else of its rival.
    fn probability(&self) -> String {
        let diagnosis = &self.diagnosis;
        let ids: Vec<&str> = diagnosis.effects.iter().map(|effect| effect.id).collect();
        let same = |set: &[&str]| set.len() == ids.len() && set.iter().all(|id| ids.contains(id));
        let found = match diagnosis.verdict {
            Answer::Effects | Answer::Ambiguous => {
                diagnosis.alternatives.iter().find(|set| same(&set.ids)).map(|set| set.probability)
            }
            verdict => {
                let rival = diagnosis.ranking.iter().find(|rival| rival.name == verdict.name());
                rival.map(|rival| rival.probability)
            }
        };
        found.map_or_else(|| UNKNOWN.to_owned(), probability)
    }

    /// What the rest of the probability is, where a second effect may act unseen.
    fn probability_note(&self) -> String {
        match self.diagnosis.unseen {
            unseen if unseen > 0.0 => format!("{} that another acts unseen", probability(unseen)),
            _ => "of this answer".to_owned(),
        }
    }

    fn mistake_section(&self) -> Option<Section> {
        let mistake = self.diagnosis.mistake.as_ref()?;
        let fact = |name: &str, value: String| (name.to_owned(), value);
        let facts = vec![
            fact("Kind", plain(mistake.kind)),
            fact("Link", plain(mistake.link.name())),
            fact("What", mistake.detail.clone()),
        ];
        let lead =
            "It sits in vehicle.toml or in a recorded signal; the vehicle itself is not to blame.";
        Some(Section::new("mistake", "The mistake", vec![Block::Facts(facts)]).with_lead(lead))
    }
}

/// The interval of a share of the gap, and on which runs.
fn between(removed: &Interval, judged: Judged) -> String {
    let runs = judged.words();
    if removed.low.is_finite() {
        format!("{} to {}, {runs}", percent(removed.low), percent(removed.high))
    } else {
        format!("on {runs}")
    }
}

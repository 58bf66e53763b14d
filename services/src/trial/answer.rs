//! diagnosis.json as it is scored; the rules of what is valid are those of the format.

use std::collections::BTreeMap;

use kerbside_simulation::effects::{Link, definition};
use serde_json::Value;

const VERDICTS: [&str; 5] = ["effects", "ambiguous", "none", "unknown", "mistake"];
/// Probabilities may exceed 1 by so much that is lost in rounding.
const ROUNDING: f64 = 1e-3;

/// An answer.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answer {
    /// The verdict.
    pub verdict: String,
    /// Links.
    pub links: Vec<String>,
    /// Links that moved before any effect was fitted, at most two.
    pub moved: Vec<String>,
    /// Effects.
    pub effects: Vec<Found>,
    /// The 90 % set: names, sorted, and probability.
    pub alternatives: Vec<(Vec<String>, f64)>,
    /// Every rival that is shown: names, sorted, and probability.
    pub ranking: Vec<(Vec<String>, f64)>,
}

/// An effect that was found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Found {
    /// Its name.
    pub id: String,
    /// Its probability.
    pub probability: f64,
    /// Which wheel.
    pub wheel: Option<String>,
    /// Value, low, high by name.
    pub parameters: BTreeMap<String, [f64; 3]>,
}

fn sorted(mut names: Vec<String>) -> Vec<String> {
    names.sort();
    names
}

fn words(value: &Value) -> Vec<String> {
    let each = |value: &Value| value.as_str().map(str::to_owned);
    match value {
        Value::Array(several) => several.iter().filter_map(each).collect(),
        single => each(single).into_iter().collect(),
    }
}

fn probability(value: &Value) -> Result<f64, String> {
    let number = value.as_f64().ok_or("a probability is missing")?;
    if (0.0..=1.0).contains(&number) {
        Ok(number)
    } else {
        Err(format!("a probability of {number}"))
    }
}

impl Answer {
    /// Reads the document of `case`.
    ///
    /// # Errors
    /// What makes it invalid.
    pub fn read(document: &Value, case: &str) -> Result<Self, String> {
        if document["case"] != case {
            return Err(format!("it is about {}", document["case"]));
        }
        let verdict = document["verdict"].as_str().unwrap_or_default().to_owned();
        if !VERDICTS.contains(&verdict.as_str()) {
            return Err(format!("the verdict is {verdict:?}"));
        }
        let links = words(&document["where"]);
        let moved = words(&document["moved"]);
        let known = |name: &String| Link::ALL.iter().any(|link| link.name() == name);
        if let Some(name) = links.iter().chain(&moved).find(|name| !known(name)) {
            return Err(format!("no link is called {name:?}"));
        }
        let list = |name: &str| {
            document[name].as_array().cloned().ok_or_else(|| format!("{name} is no list"))
        };
        let effects = list("effects")?.iter().map(Found::read).collect::<Result<Vec<_>, _>>()?;
        let set = |value: &Value| {
            let ids = sorted(words(&value["ids"]));
            if ids.is_empty() || ids.iter().any(|id| definition(id).is_none()) {
                return Err("an alternative without known effects".to_owned());
            }
            Ok((ids, probability(&value["probability"])?))
        };
        let alternatives = list("alternatives")?.iter().map(set).collect::<Result<Vec<_>, _>>()?;
        let rival = |value: &Value| {
            let names = value[0].as_str()?.split(" + ").map(str::to_owned).collect();
            Some((sorted(names), value[1].as_f64()?))
        };
        let ranking = document["ranking"].as_array().into_iter().flatten().filter_map(rival);
        let ranking = ranking.collect();
        let answer = Self { verdict, links, moved, effects, alternatives, ranking };
        answer.contradiction().map_or(Ok(answer), Err)
    }

    fn contradiction(&self) -> Option<String> {
        let sum: f64 = self.alternatives.iter().map(|set| set.1).sum();
        let wrong = match self.verdict.as_str() {
            _ if sum > 1.0 + ROUNDING => true,
            "effects" => self.effects.is_empty(),
            "ambiguous" => self.alternatives.len() < 2,
            "none" | "unknown" => !self.effects.is_empty(),
            _ => false,
        };
        wrong.then(|| format!("the verdict {} contradicts what is listed", self.verdict))
    }

    /// Names of the effects, sorted.
    #[must_use]
    pub fn ids(&self) -> Vec<String> {
        sorted(self.effects.iter().map(|effect| effect.id.clone()).collect())
    }

    /// Probability that the answer gives to itself; only a verdict `effects` has one.
    #[must_use]
    pub fn stated(&self) -> Option<f64> {
        let ids = self.ids();
        let of_set = self.alternatives.iter().find(|set| set.0 == ids).map(|set| set.1);
        let product = || self.effects.iter().map(|effect| effect.probability).product();
        (self.verdict == "effects").then(|| of_set.unwrap_or_else(product))
    }

    /// Probability that it gives to `ids`, of all rivals that it shows.
    #[must_use]
    pub fn probability_of(&self, ids: &[&str]) -> f64 {
        let shown = self.ranking.iter().chain(&self.alternatives);
        shown.filter(|set| set.0 == ids).map(|set| set.1).reduce(f64::max).unwrap_or(0.0)
    }
}

impl Found {
    fn read(value: &Value) -> Result<Self, String> {
        let id = value["id"].as_str().unwrap_or_default().to_owned();
        if definition(&id).is_none() {
            return Err(format!("no effect is called {id:?}"));
        }
        let mut found =
            Self { probability: probability(&value["probability"])?, id, ..Self::default() };
        for (name, parameter) in value["parameters"].as_object().into_iter().flatten() {
            if name == "wheel" {
                found.wheel = parameter["value"].as_str().map(str::to_owned);
                continue;
            }
            let [value, low, high] = ["value", "low", "high"].map(|key| parameter[key].as_f64());
            let (Some(value), Some(low), Some(high)) = (value, low, high) else {
                return Err(format!("{}.{name} needs value, low and high", found.id));
            };
            if !(low <= value && value <= high) {
                return Err(format!("{}.{name} lies outside its interval", found.id));
            }
            found.parameters.insert(name.clone(), [value, low, high]);
        }
        Ok(found)
    }
}

//! The label of a case: what was put in, how large it is, and what the vehicle has. Its text is sealed; what is scored is
//! read back from that text and from nothing else.

use std::collections::BTreeMap;
use std::fmt::Write;

use kerbside_proving_ground::cases::{Case, Kind};
use toml_edit::{DocumentMut, Item, Table};

use super::twins::{TWIN, Twin};

/// What was put in, as it is scored.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Label {
    /// `single`, `pair`, `null` or `unknown`.
    pub kind: String,
    /// Links, in the order of cause.
    pub links: Vec<String>,
    /// Listed effects.
    pub effects: Vec<Truth>,
    /// Names of all that was put in, listed or not.
    pub put_in: Vec<String>,
    /// Size d of the weakest effect; none where there is none.
    pub size: Option<f64>,
    /// Sets of effects that the runs cannot tell from what was put in, the closest first.
    pub twins: Vec<Vec<String>>,
    /// What the vehicle has: a word of letters, see [`sensors`].
    pub sensors: String,
}

/// A listed effect with its parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Truth {
    /// Its name.
    pub id: String,
    /// Which wheel, of an effect that has one.
    pub wheel: Option<String>,
    /// Values by name.
    pub values: BTreeMap<String, f64>,
    /// Half the range in which a value was measured, by name.
    pub spread: BTreeMap<String, f64>,
}

/// The text of the label, with `sizes` of its effects and what comes close to them.
#[must_use]
pub fn text(case: &Case, sizes: &[f64], twins: &[Twin]) -> String {
    let mut text = case.label().text();
    // Writing to a string never fails.
    for (effect, size) in case.specification.effects.iter().zip(sizes) {
        let _ = write!(text, "\n[[size]]\nid = \"{}\"\nd = {size:.3}\n", effect.id);
    }
    for Twin { of, id, apart } in twins {
        let _ = write!(text, "\n[[twin]]\nof = \"{of}\"\nid = \"{id}\"\nd = {apart:.3}\n");
    }
    let _ = write!(
        text,
        "\n[case]\nseed = {}\nsensors = \"{}\"\n",
        case.specification.seed,
        sensors(case)
    );
    text
}

/// c counts (else speeds), w all wheels are read, s steering sensor, g gyro, r reference, y with a yaw.
#[must_use]
pub fn sensors(case: &Case) -> String {
    let vehicle = &case.specification.vehicle;
    let counts = vehicle.encoders.as_ref();
    let all = counts.is_none_or(|known| known.counts_per_revolution.iter().all(Option::is_some));
    let has = [
        ('c', counts.is_some()),
        ('w', all),
        ('s', vehicle.steering_sensor.is_some()),
        ('g', vehicle.gyro.is_some()),
        ('r', vehicle.reference.is_some()),
        ('y', case.specification.reference_yaw),
    ];
    has.iter().filter(|known| known.1).map(|known| known.0).collect()
}

impl Label {
    /// Reads a label's text.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(text: &str) -> Result<Self, String> {
        let document: DocumentMut =
            text.parse().map_err(|error: toml_edit::TomlError| error.to_string())?;
        let word = |item: Option<&Item>| item.and_then(Item::as_str).unwrap_or_default().to_owned();
        let kind = word(document.get("kind"));
        if ![Kind::Null, Kind::Single, Kind::Pair, Kind::Unknown].iter().any(|k| k.name() == kind) {
            return Err(format!("no kind of case is called {kind:?}"));
        }
        let links = document.get("links").and_then(Item::as_array);
        let links = links.into_iter().flatten().filter_map(|link| Some(link.as_str()?.to_owned()));
        let links = links.collect();
        let blocks = |name: &str| -> Vec<&Table> {
            let found = document.get(name).and_then(Item::as_array_of_tables);
            found.into_iter().flatten().collect()
        };
        let mut effects: Vec<Truth> = blocks("effect").into_iter().map(Truth::parse).collect();
        for block in blocks("spread") {
            let (id, name) = (word(block.get("id")), word(block.get("parameter")));
            let half = block.get("half_range").and_then(number).unwrap_or_default();
            for effect in effects.iter_mut().filter(|effect| effect.id == id) {
                effect.spread.insert(name.clone(), half);
            }
        }
        let sizes = blocks("size");
        let put_in = sizes.iter().map(|block| word(block.get("id"))).collect();
        let sizes = sizes.iter().filter_map(|block| block.get("d").and_then(number));
        let size = sizes.reduce(f64::min);
        let ids: Vec<&str> = effects.iter().map(|effect| effect.id.as_str()).collect();
        let twins = indistinct(&ids, &blocks("twin"));
        let case = document.get("case").and_then(Item::as_table);
        let sensors = word(case.and_then(|case| case.get("sensors")));
        Ok(Self { kind, links, effects, put_in, size, twins, sensors })
    }

    /// Names of the effects, sorted.
    #[must_use]
    pub fn ids(&self) -> Vec<&str> {
        let mut ids: Vec<&str> = self.effects.iter().map(|effect| effect.id.as_str()).collect();
        ids.sort_unstable();
        ids
    }

    /// Whether there is a steering sensor.
    #[must_use]
    pub fn has_steering_sensor(&self) -> bool {
        self.sensors.contains('s')
    }
}

/// The sets of effects that no run tells from `ids`.
fn indistinct(ids: &[&str], blocks: &[&Table]) -> Vec<Vec<String>> {
    let word = |block: &Table, key: &str| block.get(key).and_then(Item::as_str).map(str::to_owned);
    let twin = |block: &&Table| {
        let (of, id) = (word(block, "of")?, word(block, "id")?);
        let apart = block.get("d").and_then(number).filter(|apart| *apart < TWIN)?;
        let mut set: Vec<String> = ids.iter().map(|own| (*own).to_owned()).collect();
        set.iter_mut().filter(|own| **own == of).for_each(|own| own.clone_from(&id));
        set.sort_unstable();
        Some((apart, set))
    };
    let mut twins: Vec<(f64, Vec<String>)> = blocks.iter().filter_map(twin).collect();
    twins.sort_by(|a, b| a.0.total_cmp(&b.0));
    twins.into_iter().map(|(_, set)| set).collect()
}

impl Truth {
    fn parse(block: &Table) -> Self {
        let word = |name: &str| block.get(name).and_then(Item::as_str).map(str::to_owned);
        let values = block.iter().filter_map(|(name, item)| Some((name.to_owned(), number(item)?)));
        Self {
            id: word("id").unwrap_or_default(),
            wheel: word("wheel"),
            values: values.collect(),
            spread: BTreeMap::new(),
        }
    }
}

#[allow(clippy::cast_precision_loss)] // Whole numbers of a label are small.
fn number(item: &Item) -> Option<f64> {
    item.as_float().or_else(|| item.as_integer().map(|whole| whole as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_label_is_read_as_it_was_written() {
        for (seed, kind) in
            [(3, Kind::Null), (4, Kind::Single), (5, Kind::Pair), (6, Kind::Unknown)]
        {
            let case = Case::draw(seed, kind);
            let sizes: Vec<f64> = case.specification.effects.iter().map(|_| 12.5).collect();
            let label = Label::parse(&text(&case, &sizes, &[])).unwrap();
            assert_eq!(label.kind, kind.name());
            let put_in = case.specification.effects.iter().map(|effect| effect.id);
            assert!(label.put_in.iter().map(String::as_str).eq(put_in));
            assert_eq!(label.links.len(), case.label().links.len());
            assert_eq!(label.sensors, sensors(&case));
            assert_eq!(label.size, (kind != Kind::Null).then_some(12.5));
            for (read, known) in label.effects.iter().zip(case.label().effects) {
                assert_eq!(read.id, known.id);
                for (name, value) in known.values {
                    assert_eq!(read.values[name], value, "{} {name}", read.id);
                }
            }
        }
        assert!(Label::parse("kind = \"other\"").is_err());
    }

    #[test]
    fn a_twin_is_what_comes_close_enough_in_place_of_what_was_put_in() {
        let request = kerbside_proving_ground::cases::Request {
            ids: vec!["understeer", "gyro_bias"],
            ..kerbside_proving_ground::cases::Request::new(Kind::Pair)
        };
        let case = (0..200).find_map(|seed| Case::of(seed, &request)).unwrap();
        let twin = |id: &'static str, apart: f64| Twin { of: "understeer", id, apart };
        let twins = [
            twin("wheelbase_scale", 2.5),
            twin("steering_lag", 3.5),
            twin("steering_compliance", 1.0),
        ];
        let label = Label::parse(&text(&case, &[12.0, 30.0], &twins)).unwrap();
        assert_eq!(
            label.twins,
            [["gyro_bias", "steering_compliance"], ["gyro_bias", "wheelbase_scale"]]
        );
    }
}

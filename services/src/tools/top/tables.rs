//! The two tables of `top`, as cells; and as text for a pipe.

use super::watch::{ProcessLine, Snapshot, TopicLine};
use crate::tables;

/// Header of the table of processes.
pub const PROCESS_HEADER: [&str; 10] =
    ["process", "pid", "state", "work", "max", "late", "miss", "rest", "MiB", "CPU %"];
/// Width of each column.
pub const PROCESS_WIDTHS: [u16; 10] = [10, 7, 9, 6, 6, 6, 6, 4, 5, 5];
/// Header of the table of topics.
pub const TOPIC_HEADER: [&str; 6] = ["topic", "from", "Hz", "of", "age ms", "refused"];
/// Width of each column.
pub const TOPIC_WIDTHS: [u16; 6] = [10, 13, 8, 6, 9, 8];

/// The cells of a process.
#[must_use]
pub fn process(line: &ProcessLine) -> [String; 10] {
    let ms = |value: fn(&super::watch::Beat) -> f64, digits| {
        number(line.beat.map(|beat| 1e3 * value(&beat)), digits)
    };
    [
        line.name.to_owned(),
        if line.pid == 0 { "-".to_owned() } else { line.pid.to_string() },
        line.state.to_owned(),
        ms(|beat| beat.work_mean, 2),
        ms(|beat| beat.work_max, 1),
        ms(|beat| beat.lateness_max, 1),
        line.misses.to_string(),
        line.restarts.to_string(),
        number(line.usage.memory, 0),
        number(line.usage.processor, 1),
    ]
}

/// The cells of a topic.
#[must_use]
pub fn topic(line: &TopicLine) -> [String; 6] {
    let from = match line.topic.publisher {
        kerbside_messages::Publisher::One(process) => process.name(),
        kerbside_messages::Publisher::Each => "every process",
        kerbside_messages::Publisher::Any => "anyone",
    };
    [
        line.topic.name.to_owned(),
        from.to_owned(),
        if line.full { "full".to_owned() } else { number(line.rate, 1) },
        number(line.nominal(), 0),
        age(line.age),
        line.refused.to_string(),
    ]
}

/// An age; of one beyond ten seconds nobody asks for milliseconds.
fn age(age: Option<f64>) -> String {
    match age {
        Some(age) if age >= 10.0 => format!("{age:.0} s"),
        age => number(age.map(|age| 1e3 * age), 1),
    }
}

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.digits$}"))
}

/// What the columns of a process are.
pub const LEGEND: &str = "work, max, late [ms]: step, longest step, longest from sample to end";

/// The line above the tables.
#[must_use]
pub fn headline(snapshot: &Snapshot) -> String {
    let cause = if snapshot.cause.is_empty() { "" } else { ": " };
    format!("instance {}, {}{cause}{}", snapshot.instance, snapshot.mode, snapshot.cause)
}

/// What processes say, and why samples were refused: a line each.
#[must_use]
pub fn remarks(snapshot: &Snapshot) -> Vec<String> {
    let says = snapshot.processes.iter().filter(|line| !line.says.is_empty());
    let says = says.map(|line| format!("{}: {}", line.name, line.says));
    let refused = snapshot.topics.iter().filter_map(|line| {
        let why = line.refusal?;
        Some(format!("{}: {} refused, the newest: {why}", line.topic.name, line.refused))
    });
    says.chain(refused).collect()
}

/// Everything as text.
#[must_use]
pub fn text(snapshot: &Snapshot) -> String {
    let mut processes = tables::dense_figures(&PROCESS_HEADER, &[1, 3, 4, 5, 6, 7, 8, 9]);
    snapshot.processes.iter().for_each(|line| {
        processes.add_row(process(line));
    });
    let mut topics = tables::dense_figures(&TOPIC_HEADER, &[2, 3, 4, 5]);
    snapshot.topics.iter().for_each(|line| {
        topics.add_row(topic(line));
    });
    let mut text = format!("{}\n{processes}\n{LEGEND}\n{topics}", headline(snapshot));
    for remark in remarks(snapshot) {
        text.push('\n');
        text.push_str(&remark);
    }
    text
}

#[cfg(test)]
pub mod tests {
    use kerbside_messages::Refusal;
    use kerbside_messages::topics::{HEARTBEAT, TABLE};

    use super::super::usage::Usage;
    use super::super::watch::Beat;
    use super::*;

    /// A stack with everything that needs room.
    pub fn crowded() -> Snapshot {
        let process = |name, says: &str| ProcessLine {
            name,
            pid: 4_194_304,
            state: "given up",
            restarts: 9999,
            misses: 100_000,
            beat: Some(Beat {
                work_mean: 0.0123,
                work_max: 0.9999,
                lateness_max: 0.5,
                ..Beat::default()
            }),
            usage: Usage { memory: Some(1023.9), processor: Some(199.9) },
            says: says.to_owned(),
        };
        let topic = |topic| TopicLine {
            topic,
            rate: Some(1000.0),
            age: Some(9.9999),
            skipped: 3,
            refused: 1_000_000,
            refusal: None,
            full: false,
        };
        let mut topics: Vec<_> = TABLE.iter().map(topic).collect();
        topics[0].refusal = Some(Refusal::Version { found: 2 });
        topics[1] = TopicLine { full: true, age: Some(4000.0), ..topic(&HEARTBEAT) };
        Snapshot {
            instance: "one".to_owned(),
            mode: "faulted",
            cause: "process died: tracker".to_owned(),
            processes: vec![
                process("interface", "waits for the device"),
                process("supervisor", ""),
            ],
            topics,
        }
    }

    #[test]
    fn the_tables_fit_a_terminal_and_say_why_samples_were_refused() {
        let shown = text(&crowded());
        assert!(shown.lines().all(|line| line.chars().count() <= 80), "{shown}");
        for words in
            ["4194304", "given up", "12.30", "999.9", "500.0", "1024", "4000 s", "full", "400"]
        {
            assert!(shown.contains(words), "{words}:\n{shown}");
        }
        assert!(
            shown.contains("raw: 1000000 refused, the newest: layout version 2, ours is"),
            "{shown}"
        );
        assert!(shown.contains("interface: waits for the device"), "{shown}");
        assert_eq!(topic(&crowded().topics[0])[1], "interface");
    }
}

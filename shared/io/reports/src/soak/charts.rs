//! Stops, latency and memory over a soak.

use super::data::SoakReport;
use crate::svg::{Chart, Cloud, Figure, Ink, Line, Trace};

impl SoakReport {
    /// Every stop against what is allowed: below 1 is within the bound.
    pub(super) fn stop_chart(&self) -> Figure {
        let kinds = ["kill", "stall"];
        let cloud = |(index, kind): (usize, &&str)| Cloud {
            label: (*kind).to_owned(),
            ink: Ink::nth(index),
            points: self
                .faults
                .iter()
                .filter(|fault| fault.kind == **kind)
                .filter_map(|fault| fault.stop)
                .enumerate()
                .map(|(number, (rolled, bound))| {
                    #[allow(clippy::cast_precision_loss)] // faults of a soak
                    let number = number as f64 + 1.0;
                    [number, rolled / bound]
                })
                .collect(),
        };
        let chart = Chart {
            id: "stops".to_owned(),
            title: "Stops against the bound".to_owned(),
            description: "Share of the allowed stop distance that each fault used.".to_owned(),
            x_title: "fault".to_owned(),
            y_title: "share of the bound".to_owned(),
            limits: vec![1.0],
            clouds: kinds.iter().enumerate().map(cloud).collect(),
            ..Chart::default()
        };
        chart.figure()
    }

    pub(super) fn latency_chart(&self) -> Figure {
        let names = ["p50", "p99", "longest"];
        let trace = |(index, name): (usize, &&str)| Trace {
            label: (*name).to_owned(),
            line: Line::new(Ink::nth(index)),
            points: self.latency.iter().map(|row| [row[0], row[index + 1] / 1e3]).collect(),
        };
        let chart = Chart {
            id: "latency".to_owned(),
            title: "From reading to command".to_owned(),
            description: "Median, 99th percentile and longest latency of each minute.".to_owned(),
            x_title: "minute".to_owned(),
            y_title: "ms".to_owned(),
            traces: names.iter().enumerate().map(trace).collect(),
            ..Chart::default()
        };
        chart.figure()
    }

    pub(super) fn memory_chart(&self) -> Figure {
        let memory = self.slopes.iter().filter(|slope| slope.resource.starts_with("memory"));
        let trace = |(index, slope): (usize, &super::SoakSlope)| Trace {
            label: slope.process.clone(),
            line: Line::new(Ink::nth(index)),
            points: slope.points.iter().map(|point| [point[0], point[1] / 1024.0]).collect(),
        };
        let chart = Chart {
            id: "memory".to_owned(),
            title: "Resident memory".to_owned(),
            description: "Resident memory of each process over time.".to_owned(),
            x_title: "minute".to_owned(),
            y_title: "MiB".to_owned(),
            traces: memory.enumerate().map(trace).collect(),
            ..Chart::default()
        };
        chart.figure()
    }
}

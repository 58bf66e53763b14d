//! Runs in two: where there is one drive alone, its beginning calibrates and its end judges.

use kerbside_calibration::{Run, Series};

/// A share of a run's time, exclusive of both ends.
///
/// # Errors
/// What was found and what is allowed.
pub fn parse_share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(share) if share > 0.0 && share < 1.0 => Ok(share),
        _ => Err(format!("found {text:?}, allowed is a share of the time between 0 and 1")),
    }
}

/// `run` up to a share of its time, and from there on; none where its wheels were not read together.
///
/// What was measured by hand belongs to the whole run and goes with neither.
#[must_use]
pub fn split(run: &Run, share: f64) -> Option<[Run; 2]> {
    let (from, to) = run.span()?;
    let at = from + share * (to - from);
    let begin = part(run, format!("{} until {at:.1} s", run.name), |t| t <= at);
    let end = part(run, format!("{} from {at:.1} s", run.name), |t| t >= at);
    Some([Run { start: run.start, ..begin }, end])
}

fn part(run: &Run, name: String, within: impl Fn(f64) -> bool) -> Run {
    let cut = |series: &Series| {
        let both = series.t.iter().zip(&series.value).filter(|(t, _)| within(**t));
        let (t, value) = both.map(|(t, value)| (*t, *value)).unzip();
        Series { t, value }
    };
    Run {
        name,
        manoeuvre: run.manoeuvre.clone(),
        rotation: run.rotation.each_ref().map(|series| series.as_ref().map(cut)),
        steering: run.steering.as_ref().map(cut),
        yaw_rate: run.yaw_rate.as_ref().map(cut),
        reference: run.reference.iter().copied().filter(|pose| within(pose.t)).collect(),
        start: None,
        end_pose: None,
        distance: None,
        net_turn: None,
    }
}

#[cfg(test)]
mod tests {
    use kerbside_calibration::ReferencePose;

    use super::*;

    fn series(count: u32) -> Series {
        let t: Vec<f64> = (0..count).map(f64::from).collect();
        Series { value: t.iter().map(|t| 2.0 * t).collect(), t }
    }

    #[test]
    fn two_parts_hold_the_whole() {
        let pose = |t| ReferencePose { t, x: t, y: 0.0, yaw: None };
        let run = Run {
            name: "loop".to_owned(),
            rotation: [None, None, Some(series(11)), Some(series(11))],
            steering: Some(series(5)),
            reference: (0..11).map(|t| pose(f64::from(t))).collect(),
            distance: Some(10.0),
            ..Run::default()
        };
        let [begin, end] = split(&run, 0.35).unwrap();
        assert_eq!(
            (begin.name.as_str(), end.name.as_str()),
            ("loop until 3.5 s", "loop from 3.5 s")
        );
        let wheels = [&begin, &end].map(|part| part.rotation[2].as_ref().map(Series::len).unwrap());
        assert_eq!(wheels, [4, 7]);
        assert_eq!([begin.reference.len(), end.reference.len()], [4, 7]);
        assert_eq!((begin.distance, end.distance), (None, None));
        assert_eq!(end.steering.unwrap().t, vec![4.0]);
        assert!(split(&Run::default(), 0.5).is_none());
    }

    #[test]
    fn a_share_is_one() {
        assert_eq!(parse_share("0.5"), Ok(0.5));
        for bad in ["0", "1", "-1", "half", "nan"] {
            assert!(parse_share(bad).unwrap_err().contains("between 0 and 1"), "{bad}");
        }
    }
}

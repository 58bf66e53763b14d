use core::f64::consts::PI;

use proptest::prelude::*;

use super::*;

/// A drive along `curvature` \[1/m\] for `length` \[m\], ten samples a metre, a metre a second:
/// the truth, and an estimate whose wheels measure `scale` of the way and whose heading drifts by
/// `bias` \[rad/m\].
fn drive(
    length: f64,
    curvature: f64,
    scale: f64,
    bias: f64,
) -> (Vec<EstimatedPose>, Vec<EstimatedPose>) {
    let (mut truth, mut estimate) = (vec![EstimatedPose::default()], Vec::new());
    estimate.push(EstimatedPose::default());
    let steps = (length * 10.0) as u64;
    for step in 1..=steps {
        let next = |last: &EstimatedPose, way: f64, turn: f64| EstimatedPose {
            stamp: step * 100_000_000,
            pose: last.pose.advance(way, turn),
            distance: last.distance + way,
        };
        truth.push(next(truth.last().unwrap(), 0.1, 0.1 * curvature));
        let turn = 0.1 * (curvature + bias);
        estimate.push(next(estimate.last().unwrap(), 0.1 * scale, turn));
    }
    (truth, estimate)
}

/// What a reference in a frame of its own says of `truth`, the marker being at `marker`.
fn reference(truth: &[EstimatedPose], frame: &Pose, marker: &Pose) -> Vec<ReferencePose> {
    let seen = |estimate: &EstimatedPose| {
        let pose = frame.compose(&estimate.pose).compose(marker);
        let yaw = Some(angle::wrap(pose.yaw));
        ReferencePose { stamp: estimate.stamp, x: pose.x, y: pose.y, yaw }
    };
    truth.iter().map(seen).collect()
}

fn without_yaw(mut references: Vec<ReferencePose>) -> Vec<ReferencePose> {
    references.iter_mut().for_each(|reference| reference.yaw = None);
    references
}

const FRAME: Pose = Pose::new(40.0, -7.0, 2.5);
const MARKER: Pose = Pose::new(0.3, -0.1, 0.4);

#[test]
fn windows_are_a_tenth_within_bounds() {
    assert_eq!(window_length(5000.0), 100.0);
    assert_eq!(window_length(200.0), 20.0);
    assert_eq!(window_length(4.0), 1.0);
    assert_eq!(window_length(1.0), 0.5);
}

#[test]
fn a_scale_error_is_its_percentage_with_and_without_yaw() {
    let (truth, estimate) = drive(50.0, 0.0, 1.01, 0.0);
    let references = reference(&truth, &FRAME, &MARKER);
    for references in [references.clone(), without_yaw(references)] {
        let drift = drift(&estimate, &references, &MARKER).unwrap();
        // One part in 101: distance is what the estimate rolled.
        assert!((drift.position_percent - 100.0 / 101.0).abs() < 1e-6, "{drift:?}");
        assert!(drift.heading_rad_per_m < 1e-9, "{drift:?}");
        assert!((drift.end_error.distance() - 0.5).abs() < 1e-6, "{drift:?}");
        assert!((drift.distance - 50.5).abs() < 1e-9 && drift.windows > 100);
    }
}

#[test]
fn a_heading_drift_is_found_with_its_sign() {
    for bias in [0.002, -0.002] {
        let (truth, estimate) = drive(50.0, 0.0, 1.0, bias);
        let references = reference(&truth, &FRAME, &MARKER);
        let found = drift(&estimate, &references, &MARKER).unwrap();
        assert!((found.heading_bias_rad_per_m - bias).abs() < 1e-9, "{found:?}");
        assert!((found.heading_rad_per_m - bias.abs()).abs() < 1e-9, "{found:?}");
        assert!((found.end_error.yaw - 50.0 * bias).abs() < 1e-9, "{found:?}");
        assert_eq!(found.aligned_by, AlignedBy::Pose);
        // Of the body itself: half the curvature times the squared length, over the length.
        let body = Pose::default();
        let bodily = drift(&estimate, &reference(&truth, &FRAME, &body), &body).unwrap();
        let expected = 50.0 * 0.002 * bodily.window;
        assert!((bodily.position_percent - expected).abs() < 1e-2, "{bodily:?}");
        let found = drift(&estimate, &without_yaw(references), &MARKER).unwrap();
        assert!((found.heading_bias_rad_per_m - bias).abs() < 0.02 * bias.abs(), "{found:?}");
        assert_eq!(found.aligned_by, AlignedBy::Path);
    }
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let (truth, estimate) = drive(50.0, 0.0, 1.0, 0.0);
    let references = reference(&truth, &FRAME, &MARKER);
    let late: Vec<_> = references
        .iter()
        .map(|r| ReferencePose { stamp: r.stamp + 1_000_000_000_000, ..*r })
        .collect();
    assert_eq!(drift(&estimate, &late, &MARKER), Err(DriftError::Apart));
    assert_eq!(drift(&[], &references, &MARKER), Err(DriftError::Apart));
    assert_eq!(drift(&estimate, &[], &MARKER), Err(DriftError::Apart));
    let (truth, estimate) = drive(0.1, 0.0, 1.0, 0.0);
    let found = drift(&estimate, &reference(&truth, &FRAME, &MARKER), &MARKER);
    assert!(matches!(found, Err(DriftError::Short { .. })), "{found:?}");
    // On the spot there is a distance to the odometry, but no direction to the reference.
    let turning: Vec<_> = (0..50)
        .map(|step| EstimatedPose {
            stamp: step * 1_000_000,
            pose: Pose::new(0.0, 0.0, 0.1 * step as f64),
            distance: 0.1 * step as f64,
        })
        .collect();
    let spot = without_yaw(reference(&turning, &FRAME, &Pose::default()));
    assert_eq!(drift(&turning, &spot, &Pose::default()), Err(DriftError::NoDirection));
}

#[test]
fn a_stand_at_the_start_averages_the_references_noise() {
    let (mut truth, mut estimate) = drive(20.0, 0.0, 1.0, 0.0);
    let stand = EstimatedPose::default();
    let shift = |pose: &mut EstimatedPose| pose.stamp += 20_000_000_000;
    truth.iter_mut().for_each(shift);
    estimate.iter_mut().for_each(shift);
    let standing = (0..200).map(|step| EstimatedPose { stamp: step * 100_000_000, ..stand });
    truth.splice(0..0, standing.clone());
    estimate.splice(0..0, standing);
    let mut references = reference(&truth, &FRAME, &MARKER);
    for (index, reference) in references.iter_mut().enumerate().take(200) {
        reference.yaw = reference.yaw.map(|yaw| yaw + if index % 2 == 0 { 0.01 } else { -0.01 });
    }
    let found = drift(&estimate, &references, &MARKER).unwrap();
    // A single pose would have put 0.01 rad on 20 m; of 201 none is left over.
    assert!(found.end_error.distance() < 0.003, "{found:?}");
}

proptest! {
    #[test]
    fn frames_marker_and_interpolation_do_not_matter(
        (x, y, yaw) in (-100.0..100.0, -100.0..100.0, -PI..PI),
        (ahead, aside, turned) in (-2.0..2.0, -1.0..1.0, -PI..PI),
        curvature in -0.2..0.2,
        every in 1_usize..4,
    ) {
        let (truth, _) = drive(30.0, curvature, 1.0, 0.0);
        let marker = Pose::new(ahead, aside, turned);
        let references = reference(&truth, &Pose::new(x, y, yaw), &marker);
        let fewer: Vec<_> = truth.iter().step_by(every).copied().collect();
        let found = drift(&fewer, &references, &marker).unwrap();
        // Chords for arcs: an eighth of the curvature times the squared step, 0.3 m at most.
        prop_assert!(found.position_percent < 0.1, "{found:?}");
        prop_assert!(found.heading_rad_per_m < 1e-9, "{found:?}");
        prop_assert!(found.end_error.distance() < 0.01, "{found:?}");
    }

    #[test]
    fn scale_and_heading_are_told_apart_on_curves(
        scale in 0.95_f64..1.05,
        bias in -0.005..0.005,
        curvature in -0.1..0.1,
    ) {
        let (truth, estimate) = drive(40.0, curvature, scale, bias);
        let found = drift(&estimate, &reference(&truth, &FRAME, &MARKER), &MARKER).unwrap();
        prop_assert!((found.heading_bias_rad_per_m - bias / scale).abs() < 1e-6, "{found:?}");
        prop_assert!(found.position_percent <= found.position_percent_max);
    }
}

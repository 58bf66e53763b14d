//! Every row with few trials: it runs, its figures are there, and the same seed gives the same bits.

#![allow(clippy::unwrap_used, clippy::float_cmp)] // Helpers of tests are tests.

use kerbside_reproduction::{
    Asked, Contender, Driver, Reproduction, ReproductionError, Scene, Verdict, reproduce,
};

fn run(trials: usize, rows: &[u8]) -> Reproduction {
    let asked = Asked { trials, seed: 5, rows: rows.to_vec() };
    let mut told = 0;
    let out = reproduce(&asked, &mut |done, total, _| {
        told += 1;
        assert!(done == told && done <= total);
        true
    });
    out.unwrap()
}

/// No figure of the rows is missed beyond what so few trials leave open.
fn assert_not_missed(out: &Reproduction, but: &[&str]) {
    let missed = |figure: &&kerbside_reproduction::Figure| {
        let known = but.iter().any(|part| figure.name.contains(part));
        out.verdict(figure) == Verdict::Missed && !known
    };
    let missed: Vec<_> = out.figures.iter().filter(missed).collect();
    assert!(missed.is_empty(), "{missed:#?}");
    let rows: Vec<u8> = out.figures.iter().map(|figure| figure.row).collect();
    assert!(out.asked.rows.iter().all(|row| rows.contains(row)), "{rows:?}");
}

#[test]
fn rows_1_to_3_calibrate() {
    let out = run(14, &[1, 2, 3]);
    // An interval over two repetitions covers all or nothing.
    assert_not_missed(&out, &["intervals cover", "mean", "worst rms over"]);
    let fine = &out.calibrations[0];
    assert!(fine.bound[2] < 20e-6 && fine.bound[5] < 0.3e-3, "{:?}", fine.bound);
    for found in &fine.found {
        assert!((0..4).all(|i| found.joint[i].abs() < 70e-6), "{:?}", found.joint);
        assert_eq!(found.rejected, 0);
    }
}

#[test]
fn rows_4_and_5_and_6_hold_on_the_s_path() {
    let out = run(16, &[4, 5, 6]);
    assert_not_missed(&out, &["paper (ii)"]);
    assert_eq!(out.ends.len(), 12);
    for ends in &out.ends {
        let (fused, rear) = (ends.variance(Contender::Fused), ends.variance(Contender::Rear));
        assert!(fused < rear, "{}: {fused} {rear}", ends.name());
        assert_eq!(ends.truth.len(), ends.of(Contender::Fused).unwrap().path.len());
    }
}

#[test]
fn row_7_shows_that_the_papers_covariance_is_none() {
    let out = run(4, &[7]);
    let of = |name: &str| -> Vec<f64> {
        let named = out.figures.iter().filter(|figure| figure.name.starts_with(name));
        named.map(|figure| figure.ours).collect()
    };
    assert!(of("paper (i) NEES/3").iter().all(|nees| *nees > 10.0));
    let fused = of("fused NEES/3");
    assert!(fused.len() > 30 && fused.iter().all(|nees| (0.1..20.0).contains(nees)), "{fused:?}");
    let mean = fused.iter().take(12).sum::<f64>() / 12.0;
    assert!((0.6..1.5).contains(&mean), "{mean}");
}

#[test]
fn row_8_finds_slips() {
    let out = run(4, &[8]);
    assert_not_missed(&out, &["mean error"]);
    assert!(out.figures.iter().any(|figure| figure.name.starts_with("false flags")));
}

#[test]
fn row_9_parks_and_needs_its_calibration() {
    let out = run(6, &[9]);
    assert_not_missed(&out, &["mean |y|"]);
    for scene in Scene::ALL {
        let of = |driver: Driver| {
            out.parkings.iter().find(|line| line.scene == scene && line.driver == driver).unwrap()
        };
        assert_eq!(of(Driver::Fused).arrived, 6);
        assert!(of(Driver::Perfect).mean_abs(0) < 0.004);
        assert!(of(Driver::Uncalibrated).mean_abs(0) > 0.03);
    }
}

#[test]
fn the_same_seed_gives_the_same_bits_and_another_one_others() {
    let asked = |seed| Asked { trials: 2, seed, rows: vec![3, 5, 9] };
    let run = |seed| reproduce(&asked(seed), &mut |_, _, _| true).unwrap();
    let (one, same, other) = (run(1), run(1), run(2));
    assert!(one == same && one != other);
}

#[test]
fn too_few_trials_are_refused_and_a_watcher_ends_it() {
    let asked = Asked { trials: 1, seed: 1, rows: vec![4] };
    assert_eq!(reproduce(&asked, &mut |_, _, _| true), Err(ReproductionError::FewTrials(1)));
    let asked = Asked { trials: 2, seed: 1, rows: vec![9] };
    assert_eq!(reproduce(&asked, &mut |_, _, _| false), Err(ReproductionError::Interrupted));
}

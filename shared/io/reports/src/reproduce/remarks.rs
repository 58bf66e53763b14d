//! What the paper leaves open, and how it was closed here.

/// What is not stated in the paper, and what was taken instead.
pub(super) const OPEN: [&str; 8] = [
    "Not stated: wheelbase, counts per turn, sample time, steering sensor. Taken: 0.50 m, 2000 \
     counts, 50 Hz, a steering sensor with 0.2 deg of white noise.",
    "Not stated: lengths and shapes of the paths of Figures 7 to 9. Taken: an S of 5.77 m with \
     bends of 1.2 m.",
    "Not stated: length of the straights, radius, angle and number of the arcs. Taken: 10 \
     straights of 5 m, 10 full circles of 1.5 m to both sides, 2 mm and 2 mrad at both ends; \
     beside it the paper's reference of 5 cm and 5 deg.",
    "Not stated: Q, R and P0 of the filter, and whether the front pose is integrated from its own \
     last pose (i) or from the fused one (ii). Both readings are run.",
    "Not stated: planner, tracker and gains, slot sizes, speed and number of parkings, frame of \
     Table 3. Taken: given paths of 2.63 m and 1.86 m at 0.1 m/s, a law of Kanayama's kind, x \
     along the slot.",
    "The straights in which the steering is turned on those parking paths are not known; they are \
     set so that the paths' lengths are met.",
    "No number is printed with Figures 6, 7 and 8.",
    "Units behind \"variance\" in Figure 9 are not stated.",
];

/// What does not fit together in the paper.
pub(super) const CONTRADICTIONS: [&str; 6] = [
    "The paper's b is the track (left to right), though it is called wheelbase throughout.",
    "0.429 m^2 is a deviation of 0.65 m, twenty times what wheels of any sort leave after such a \
     path and impossible beside paths that are nearly equal: only the ratio of Figure 9, 0.66, \
     can be compared.",
    "That ratio, from 60 runs, has a 95 % interval of 0.46 to 0.95. Several filters explain it; \
     the one with the fewest assumptions is reading (ii) under an ordinary residual error of the \
     calibration.",
    "1 to 2 cm and about 1 deg in Table 3 lie below the reference's own 5 cm and 5 deg, and are \
     signed means of an unknown number of runs: they say nothing of the spread. Here magnitudes \
     and 95 % quantiles are given, against the truth.",
    "The epsilons of Table 1 lie within one deviation of what such a reference can tell unless \
     the car runs perfectly straight; a steering zero off by 0.2 deg explains them as well.",
    "A dead-reckoned pose is no fresh reading: taken for one, the covariance shrinks while the \
     error grows. The normalised squared error of both readings of the filter shows it.",
];

//! Which declared key a misspelt one was meant to be.

/// The candidate nearest to `name`, if it is near enough to be meant.
///
/// Two paths are near when few letters differ, or when they end in the same word: a key put into
/// the wrong table.
pub(crate) fn nearest<'a>(
    name: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    let cost = |candidate: &str| {
        let enough = 2.max(name.len() / 4);
        let misplaced = last_word(name) == last_word(candidate);
        if !misplaced && name.len().abs_diff(candidate.len()) > enough {
            return None;
        }
        let letters = distance(name, candidate);
        let misplaced = misplaced.then_some(1000 + letters);
        if letters <= enough { Some(letters) } else { misplaced }
    };
    candidates
        .into_iter()
        .filter_map(|candidate| cost(candidate).map(|cost| (cost, candidate)))
        .min()
        .map(|(_, candidate)| candidate)
}

fn last_word(path: &str) -> &str {
    path.rsplit('.').next().unwrap_or(path)
}

/// Levenshtein's distance, a swap of neighbours counting as one (optimal string alignment).
fn distance(a: &str, b: &str) -> usize {
    // A hostile file may hold a key of megabytes; what is so long was not meant to be any of ours.
    let a: Vec<char> = a.chars().take(100).collect();
    let b: Vec<char> = b.chars().take(100).collect();
    let mut rows = vec![vec![0; b.len() + 1]; a.len() + 1];
    rows[0] = (0..=b.len()).collect();
    for i in 1..=a.len() {
        rows[i][0] = i;
        for j in 1..=b.len() {
            let same = usize::from(a[i - 1] != b[j - 1]);
            let mut best =
                (rows[i - 1][j] + 1).min(rows[i][j - 1] + 1).min(rows[i - 1][j - 1] + same);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                best = best.min(rows[i - 2][j - 2] + 1);
            }
            rows[i][j] = best;
        }
    }
    rows[a.len()][b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_of_the_finger_is_found_and_noise_is_not() {
        let keys = ["limits.speed", "limits.steering", "wheelbase", "footprint.width"];
        assert_eq!(nearest("wheelbas", keys), Some("wheelbase"));
        assert_eq!(nearest("limits.sepeed", keys), Some("limits.speed"));
        assert_eq!(nearest("speed", keys), Some("limits.speed"));
        assert_eq!(nearest("colour", keys), None);
    }

    #[test]
    fn a_swap_costs_one() {
        assert_eq!(distance("width", "wdith"), 1);
        assert_eq!(distance("", "abc"), 3);
        assert_eq!(distance("kitten", "sitting"), 3);
    }
}

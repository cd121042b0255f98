//! "Did you mean": the nearest of a list of names.

/// The name nearest to `given`, if it is near enough to be a slip of the pen.
///
/// Near enough: an edit distance (insertions, deletions, substitutions, swaps of neighbours; case ignored) of at most a
/// third of the length, at least 1; or one name contains the other and is at least four letters long.
pub(crate) fn nearest<'a>(given: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let wanted = given.to_lowercase();
    if wanted.is_empty() || wanted.len() > 64 {
        return None;
    }
    let limit = (wanted.chars().count() / 3).max(1);
    let mut best: Option<(usize, &str)> = None;
    for name in names {
        let candidate = name.to_lowercase();
        let mut distance = distance(&wanted, &candidate);
        let contained =
            candidate.len() >= 4 && wanted.len() >= 4 && (candidate.contains(&wanted) || wanted.contains(&candidate));
        if contained {
            distance = distance.min(limit);
        }
        if distance <= limit && best.is_none_or(|(d, _)| distance < d) {
            best = Some((distance, name));
        }
    }
    best.map(|(_, name)| name)
}

/// Optimal-string-alignment distance between two words.
fn distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    let mut before: Vec<usize> = Vec::new();
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i; b.len() + 1];
        for j in 1..=b.len() {
            let change = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            row[j] = change.min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(before[j - 2] + 1);
            }
        }
        before = std::mem::replace(&mut last, row);
    }
    last[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_of_known_pairs() {
        assert_eq!(distance("sigma_a", "sigm_a"), 1);
        assert_eq!(distance("ab", "ba"), 1);
        assert_eq!(distance("", "abc"), 3);
        assert_eq!(distance("kitten", "sitting"), 3);
    }

    #[test]
    fn a_slip_is_found_and_a_different_word_is_not() {
        assert_eq!(nearest("sigm_a", ["sigma_s", "sigma_a"]), Some("sigma_a"));
        assert_eq!(nearest("skin1", ["Skin2", "Skin1"]), Some("Skin1"));
        assert_eq!(nearest("zebra", ["fov", "lensradius"]), None);
    }
}

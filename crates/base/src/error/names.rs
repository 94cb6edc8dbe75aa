//! Names in messages: lists of those that there are, and the one that was probably meant.

/// Some names as a list for a message, cut after forty.
pub fn list_of<'n>(names: impl Iterator<Item = &'n str>) -> String {
    const SHOWN: usize = 40;
    let mut names = names;
    let mut list = names.by_ref().take(SHOWN).collect::<Vec<_>>().join(", ");
    let more = names.count();
    if more > 0 {
        list += &format!(" and {more} more");
    }
    list
}

/// The name that is most similar to `word`, if the edit distance is small or one is a prefix of the
/// other.
pub fn nearest<'n>(word: &str, mut names: impl Iterator<Item = &'n str>) -> Option<&'n str> {
    nearest_of(word, &mut names)
}

/// As [`nearest`], compiled once for all iterators.
fn nearest_of<'n>(word: &str, names: &mut dyn Iterator<Item = &'n str>) -> Option<&'n str> {
    let allowed = (word.chars().count() / 3).max(1);
    let is_prefix =
        |name: &str| word.len().min(name.len()) >= 3 && (name.starts_with(word) || word.starts_with(name));
    let measured = names.map(|name| {
        let distance = edit_distance(word, name);
        (if is_prefix(name) { distance.min(allowed) } else { distance }, name)
    });
    measured.filter(|(distance, _)| *distance <= allowed).min_by_key(|(d, _)| *d).map(|(_, name)| name)
}

/// The number of insertions, deletions, replacements and transpositions that transform one word
/// into the other (optimal string alignment distance).
fn edit_distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    // Names of users may be long, and the table is quadratic.
    if a.len() > 64 || b.len() > 64 {
        return usize::MAX;
    }
    let mut rows = vec![vec![0; b.len() + 1]; a.len() + 1];
    for (i, row) in rows.iter_mut().enumerate() {
        row[0] = i;
    }
    rows[0] = (0..=b.len()).collect();
    for i in 1..=a.len() {
        for j in 1..=b.len() {
            let replaced = rows[i - 1][j - 1] + usize::from(a[i - 1] != b[j - 1]);
            let mut best = replaced.min(rows[i - 1][j] + 1).min(rows[i][j - 1] + 1);
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
    fn distances() {
        assert_eq!(edit_distance("", "abc"), 3);
        assert_eq!(edit_distance("kitten", "sitting"), 3);
        assert_eq!(edit_distance("vertcies", "vertices"), 1);
        assert_eq!(nearest("chain", ["none", "chained"].into_iter()), Some("chained"));
        assert_eq!(nearest("hit", ["miss", "callable"].into_iter()), None);
    }
}

//! Compares expected with found items: the number of differences, and the first difference.

use std::fmt::Debug;

/// Returns the number of indices at which the items differ or only one slice has an item.
pub fn count_differences<T: PartialEq>(expected: &[T], found: &[T]) -> usize {
    let pairs = expected.iter().zip(found);
    pairs.filter(|(expected, found)| expected != found).count()
        + expected.len().abs_diff(found.len())
}

/// Returns a text with the first index at which the items differ and both items, each cut to 300
/// characters. If only the numbers of items differ, the text contains both numbers. Returns `None`
/// if all items are equal.
pub fn first_difference<T: PartialEq + Debug>(expected: &[T], found: &[T]) -> Option<String> {
    let text = |item: &T| format!("{item:?}").chars().take(300).collect::<String>();
    let mut pairs = expected.iter().zip(found).enumerate();
    if let Some((index, (expected, found))) = pairs.find(|(_, (expected, found))| expected != found)
    {
        return Some(format!("{index}: {}, not {}", text(found), text(expected)));
    }
    let [expected, found] = [expected.len(), found.len()];
    (expected != found).then(|| format!("{found} of {expected}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_counted_and_the_first_is_named_with_its_place() {
        for (found, count, first) in [
            (&[1, 2, 3][..], 0, None),
            (&[1, 9, 8], 2, Some("1: 9, not 2")),
            (&[1, 2], 1, Some("2 of 3")),
        ] {
            assert_eq!(count_differences(&[1, 2, 3], found), count);
            assert_eq!(first_difference(&[1, 2, 3], found).as_deref(), first);
        }
    }
}

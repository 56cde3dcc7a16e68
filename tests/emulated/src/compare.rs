//! Differences between expected and found items: their number, and the first of them.

use std::fmt::Debug;

use link::Code;

/// Number of indices at which the items differ, or at which only one slice has an item.
pub fn count_differences<T: PartialEq>(expected: &[T], found: &[T]) -> usize {
    let pairs = expected.iter().zip(found);
    pairs.filter(|(expected, found)| expected != found).count()
        + expected.len().abs_diff(found.len())
}

/// Description of the first item that is not the expected one; `None` if all are equal.
pub fn first_difference<T: PartialEq + Debug>(expected: &[T], found: &[T]) -> Option<String> {
    let mut pairs = expected.iter().zip(found).enumerate();
    match pairs.find(|(_, (expected, found))| expected != found) {
        Some((index, (expected, found))) => Some(format!("{index}: {found:?}, not {expected:?}")),
        None => different_lengths(expected, found),
    }
}

/// Names the fields in which the first code that is not the expected one differs; `None` if all
/// codes are equal.
pub fn first_different_code(expected: &[Code], found: &[Code]) -> Option<String> {
    let mut pairs = expected.iter().zip(found);
    let Some((expected, found)) = pairs.find(|(expected, found)| expected != found) else {
        return different_lengths(expected, found).map(|lengths| format!("{lengths} codes"));
    };
    let fields = [
        ("window", expected.window == found.window),
        ("first sample", expected.first_sample == found.first_sample),
        ("values", expected.values == found.values),
        ("flags", expected.flags == found.flags),
    ];
    let differing = fields.iter().filter(|(_, equal)| !equal);
    let names: Vec<&str> = differing.map(|(name, _)| *name).collect();
    let names = if names.is_empty() {
        "counts of clipped values and channels at the rail".to_owned()
    } else {
        names.join(", ")
    };
    let window = expected.window;
    Some(format!("the code of window {window} differs in {names}"))
}

fn different_lengths<T>(expected: &[T], found: &[T]) -> Option<String> {
    let [expected, found] = [expected.len(), found.len()];
    (expected != found).then(|| format!("{found} of {expected}"))
}

#[cfg(test)]
mod tests {
    use link::Streams;

    use super::*;
    use crate::frames::Boot;
    use crate::host;
    use crate::input::Input;

    #[test]
    fn the_field_of_a_code_that_differs_is_named() {
        let sent = host::sent(Streams::CODES, &Input::new(40).samples);
        let expected = Boot::only(&sent).codes();
        let mut found = expected.clone();
        assert_eq!(first_different_code(&expected, &found), None);
        found[7].flags = link::Flags::OVERRUN;
        found[7].first_sample += 1;
        assert_eq!(count_differences(&expected, &found), 1);
        assert_eq!(
            first_different_code(&expected, &found).as_deref(),
            Some("the code of window 7 differs in first sample, flags")
        );
        found.pop();
        assert_eq!(count_differences(&expected, &found), 2);
        assert_eq!(
            first_different_code(&expected, &expected[..39]).as_deref(),
            Some("39 of 40 codes")
        );
    }

    #[test]
    fn the_first_item_that_differs_is_named_with_its_place() {
        let first = |found: &[u8]| first_difference(&[1, 2, 3], found);
        assert_eq!(first(&[1, 2, 3]), None);
        assert_eq!(first(&[1, 9, 8]).as_deref(), Some("1: 9, not 2"));
        assert_eq!(first(&[1, 2]).as_deref(), Some("2 of 3"));
    }
}

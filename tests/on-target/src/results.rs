//! Parses the image's output on the PC, which receives it from QEMU or probe-rs.

use std::borrow::ToOwned;
use std::format;
use std::string::String;
use std::vec::Vec;

/// A line of the image's output that reports a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line<'l> {
    /// The output of a vector was as expected.
    Passed {
        /// Time that the vector took, in ticks of the image's clock.
        ticks: u64,
        /// Name of the vector that passed.
        vector: &'l str,
    },
    /// The output of a vector was not as expected; the line states why.
    Failed,
    /// The last line: the image has run all vectors.
    End {
        /// Number of vectors that the image ran.
        vectors: usize,
        /// Number of vectors that failed.
        failed: usize,
    },
}

impl<'l> Line<'l> {
    /// Parses a line that the image printed; returns `None` if it reports no result.
    pub fn parse(line: &'l str) -> Option<Self> {
        if line.starts_with("FAILED ") {
            return Some(Self::Failed);
        }
        if let Some(rest) = line.strip_prefix("passed ") {
            let (ticks, vector) = rest.split_once(' ')?;
            let ticks = ticks.parse().ok()?;
            return Some(Self::Passed { ticks, vector });
        }
        let (vectors, failed) = line.split_once(" vectors, ")?;
        Some(Self::End {
            vectors: vectors.parse().ok()?,
            failed: failed.strip_suffix(" failed")?.parse().ok()?,
        })
    }
}

/// Returns a line for the user: the time of a passed vector is converted by `from_ticks` and
/// followed by `unit`; other lines are unchanged.
pub fn readable(line: &str, unit: &str, from_ticks: impl Fn(u64) -> u64) -> String {
    match Line::parse(line) {
        Some(Line::Passed { ticks, vector }) => {
            format!("passed  {vector:36} {:>11} {unit}", from_ticks(ticks))
        }
        _ => line.to_owned(),
    }
}

/// Checks that each vector has passed, and that the image's last line states the number of vectors.
/// An exit status of 0 alone does not suffice: a run that the user ends with Ctrl-C has it too.
///
/// # Errors
/// Returns why the run does not count as passed.
pub fn check(lines: &[String]) -> Result<(), String> {
    let results: Vec<Line<'_>> = lines.iter().filter_map(|line| Line::parse(line)).collect();
    let is_passed = |line: &&Line<'_>| matches!(line, Line::Passed { .. });
    let vectors = results.iter().filter(is_passed).count();
    let end = Line::End { vectors, failed: 0 };
    if vectors > 0 && results.last() == Some(&end) {
        return Ok(());
    }
    Err(format!(
        "{vectors} vectors passed, and the image did not print at its end that these are all; it printed {lines:?}"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_an_image_that_counts_all_its_vectors_as_passed_is_accepted() {
        let accepted = |lines: &[&str]| {
            let lines: Vec<String> = lines.iter().map(|&line| line.to_owned()).collect();
            check(&lines).is_ok()
        };
        let [first, second] = ["passed 70 filters, 512 Hz", "passed 80 network's sum"];
        assert!(accepted(&[first, second, "2 vectors, 0 failed"]));
        assert!(accepted(&["a warning", first, "1 vectors, 0 failed"]));
        assert!(!accepted(&[first, second]));
        assert!(!accepted(&[first, "2 vectors, 0 failed"]));
        assert!(!accepted(&[first, "FAILED x: y", "2 vectors, 1 failed"]));
        assert!(!accepted(&["0 vectors, 0 failed"]));
        assert!(!accepted(&[]));
    }

    #[test]
    fn ticks_are_printed_in_the_unit_of_the_machine() {
        let line = readable("passed 2560 network's sum", "instructions", |ticks| ticks / 256);
        assert!(line.starts_with("passed  network's sum "), "{line}");
        assert!(line.ends_with(" 10 instructions"), "{line}");
        let other = readable("something else", "cycles", |ticks| ticks);
        assert_eq!(other, "something else");
    }
}

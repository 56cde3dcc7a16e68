//! Violations of the reference manual and of the USB specification, which the models of core and
//! host detect.

use std::fmt;

/// A violation of the reference manual or of the USB specification, and how often it has occurred.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// Virtual time at which the violation first occurred, in ns.
    pub at_ns: u64,
    /// Text that names the register or request, what has happened, and the section that forbids it.
    pub text: String,
    /// Number of violations with this text, at least 1.
    pub count: u64,
}

impl fmt::Display for Violation {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} ns: {}", self.at_ns, self.text)?;
        if self.count > 1 {
            write!(formatter, " ({} times)", self.count)?;
        }
        Ok(())
    }
}

/// All violations so far, one for each text, in the order in which they first occurred.
#[derive(Clone, Debug, Default)]
pub(super) struct Violations(Vec<Violation>);

impl Violations {
    pub(super) fn record(&mut self, at_ns: u64, text: impl Into<String>) {
        let text = text.into();
        match self.0.iter_mut().find(|known| known.text == text) {
            Some(known) => known.count += 1,
            None => self.0.push(Violation { at_ns, text, count: 1 }),
        }
    }

    /// Records a violation for each of the `rules` that is false; they are stated in `section`.
    pub(super) fn expect<const N: usize>(
        &mut self,
        at_ns: u64,
        section: &str,
        rules: [(bool, &str); N],
    ) {
        for (_, what) in rules.into_iter().filter(|(holds, _)| !holds) {
            self.record(at_ns, format!("{what} ({section})"));
        }
    }

    /// Moves all violations from `other` into this list, and adds up the counts of equal texts.
    pub(super) fn take_from(&mut self, other: &mut Self) {
        for violation in other.0.drain(..) {
            match self.0.iter_mut().find(|known| known.text == violation.text) {
                Some(known) => known.count += violation.count,
                None => self.0.push(violation),
            }
        }
    }

    pub(super) fn to_vec(&self) -> Vec<Violation> {
        self.0.clone()
    }
}

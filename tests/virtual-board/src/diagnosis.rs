//! Where a board stands when it does not do what it should.

use std::fmt;

use crate::Findings;

/// Where a board stands.
#[derive(Clone, Debug, Default)]
pub struct Diagnosis {
    /// Virtual time since power on, us.
    pub now_us: u64,
    /// Instructions retired.
    pub instructions: u64,
    /// Where the core stood last, the newest last.
    pub places: Vec<String>,
    /// What the emulator noticed.
    pub findings: Findings,
    /// Frames received.
    pub frames: usize,
    /// Frames that could not be used.
    pub bad: Vec<String>,
}

impl fmt::Display for Diagnosis {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            now_us,
            instructions,
            frames,
            ..
        } = self;
        writeln!(
            formatter,
            "  at {now_us} us, {instructions} instructions, {frames} frames, {} bad",
            self.bad.len()
        )?;
        let resets: Vec<_> = self.findings.resets.iter().collect();
        let resets: Vec<_> = resets
            .iter()
            .map(|(us, why)| format!("{us} us: {why}"))
            .collect();
        for (title, lines) in [
            ("program counters, the newest last", &self.places),
            ("resets", &resets),
            ("unmapped", &self.findings.unmapped),
            ("refused", &self.findings.refused),
            ("told", &self.findings.told),
            ("bad frames", &self.bad),
        ] {
            if lines.is_empty() {
                continue;
            }
            writeln!(formatter, "  {title}:")?;
            for line in lines.iter().rev().take(16).rev() {
                writeln!(formatter, "    {line}")?;
            }
        }
        Ok(())
    }
}

/// What went wrong, and where the board stood.
#[derive(Clone, thiserror::Error)]
#[error("{what}\n{diagnosis}")]
pub struct Trouble {
    what: String,
    diagnosis: Box<Diagnosis>,
}

impl Trouble {
    pub(crate) fn new(what: String, diagnosis: Diagnosis) -> Self {
        let diagnosis = Box::new(diagnosis);
        Self { what, diagnosis }
    }
}

// A test that returns it prints it so.
impl fmt::Debug for Trouble {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{self}")
    }
}

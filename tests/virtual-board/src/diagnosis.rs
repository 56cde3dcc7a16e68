//! Error type with a snapshot of the board at the time of the failure.

use std::fmt;

use crate::findings::Findings;

/// Snapshot of a board for error messages.
#[derive(Clone, Debug, Default)]
pub struct Diagnosis {
    /// Virtual time since power-on, in us.
    pub now_us: u64,
    /// Number of instructions retired since power-on.
    pub instructions: u64,
    /// Most recent program counters, each with the function it is in, the newest last.
    pub program_counters: Vec<String>,
    /// Problems that the emulator has detected since power-on.
    pub findings: Findings,
    /// Number of frames decoded since power-on.
    pub frames: usize,
    /// Decoding error of each frame that could not be decoded.
    pub decode_errors: Vec<String>,
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
            "  at {now_us} us, {instructions} instructions, {frames} frames, {} not decoded",
            self.decode_errors.len()
        )?;
        let resets: Vec<_> = self.findings.resets.iter().collect();
        let resets: Vec<_> = resets
            .iter()
            .map(|(us, why)| format!("{us} us: {why}"))
            .collect();
        for (title, lines) in [
            ("program counters, the newest last", &self.program_counters),
            ("resets", &resets),
            ("unmapped", &self.findings.unmapped),
            ("refused", &self.findings.refused),
            (
                "violations of the reference manual",
                &self.findings.manual_violations,
            ),
            ("frames that could not be decoded", &self.decode_errors),
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

/// An error of a board, with a snapshot of the board at the time of the error.
#[derive(Clone, thiserror::Error)]
#[error("{what}\n{diagnosis}")]
pub struct BoardError {
    what: String,
    diagnosis: Box<Diagnosis>,
}

impl BoardError {
    pub(crate) fn new(what: String, diagnosis: Diagnosis) -> Self {
        let diagnosis = Box::new(diagnosis);
        Self { what, diagnosis }
    }
}

// `Debug` prints the same text as `Display`, because a test that returns this error prints it with `Debug`.
impl fmt::Debug for BoardError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{self}")
    }
}

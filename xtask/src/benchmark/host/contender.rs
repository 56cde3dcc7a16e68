//! A program that has turns.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use crate::command::typed;
use crate::failure::Failure;

/// A running contender; ended when it is dropped.
#[derive(Debug)]
pub(crate) struct Process {
    child: Child,
    turns: ChildStdin,
    answers: BufReader<ChildStdout>,
    name: String,
    /// Its first line: processor or version.
    pub(crate) greeting: String,
}

impl Process {
    /// Starts it in `folder` and waits until it is ready.
    ///
    /// # Errors
    /// It does not start, or ends before it is ready.
    pub(crate) fn start(mut command: Command, folder: &Path) -> Result<Self, Failure> {
        command
            .current_dir(folder)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped());
        let name = typed(&command);
        let mut child = command
            .spawn()
            .map_err(|error| failed(&name, error.to_string()))?;
        let (Some(turns), Some(answers)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(failed(&name, "it has no standard streams".to_owned()));
        };
        let mut process = Self {
            child,
            turns,
            answers: BufReader::new(answers),
            name,
            greeting: String::new(),
        };
        process.greeting = process.line()?;
        Ok(process)
    }

    /// Gives it a turn: codes per second.
    ///
    /// # Errors
    /// It has ended, or its answer makes no sense.
    pub(crate) fn turn(&mut self, contender: &str) -> Result<f64, Failure> {
        writeln!(self.turns, "{contender}")
            .map_err(|error| failed(&self.name, error.to_string()))?;
        let answer = self.line()?;
        codes_per_second(&answer)
            .ok_or_else(|| failed(&self.name, format!("its answer was {answer:?}")))
    }

    fn line(&mut self) -> Result<String, Failure> {
        let mut line = String::new();
        match self.answers.read_line(&mut line) {
            Ok(0) => Err(failed(&self.name, "it has ended".to_owned())),
            Ok(_) => Ok(line.trim_end().to_owned()),
            Err(error) => Err(failed(&self.name, error.to_string())),
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // Both fail when it has ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn failed(name: &str, why: String) -> Failure {
    Failure::Check {
        what: format!("the contender `{name}`"),
        why,
        next: "read its own words above".to_owned(),
    }
}

/// From an answer `CODES NANOSECONDS`.
fn codes_per_second(answer: &str) -> Option<f64> {
    let (codes, nanoseconds) = answer.split_once(' ')?;
    let [codes, nanoseconds] = [codes.parse::<u32>(), nanoseconds.parse::<u32>()];
    let (codes, nanoseconds) = (codes.ok()?, nanoseconds.ok()?);
    (codes > 0 && nanoseconds > 0).then(|| f64::from(codes) / f64::from(nanoseconds) * 1e9)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_is_codes_and_nanoseconds() {
        assert_eq!(codes_per_second("250 125000000"), Some(2_000.0));
        for wrong in ["", "250", "250 ", "250 0", "0 5", "-1 5", "panicked at"] {
            assert_eq!(codes_per_second(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn a_contender_that_ends_is_a_failure() {
        let ended = Process::start(Command::new("true"), Path::new("."));
        let failure = ended.expect_err("nothing was said").to_string();
        assert!(failure.contains("`true` failed: it has ended"), "{failure}");
    }
}

//! The emulated microcontrollers check the golden vectors themselves and print the instructions of each.
//!
//! `cargo xtask hil --board` runs the same image on a real board.
#![forbid(unsafe_code)]

use std::time::Duration;

use emulated::board::{boards, or_panic};
use emulator::{Qemu, Uart};

const TEST: &str = "golden vectors on emulated microcontrollers";

/// Package and program of the image.
const IMAGE: &str = "on-target";

/// One instruction lasts 2^10 ns of virtual time, which is 25.6 ticks of the image's 25 MHz clock.
const INSTRUCTION_SHIFT: u8 = 10;
const TICKS_OF_10_INSTRUCTIONS: u64 = 256;

/// Longest time from one vector to the next, and to start QEMU, on a busy PC.
const SILENCE: Duration = Duration::from_mins(1);

#[test]
fn every_golden_vector_passes() {
    for board in boards(TEST, IMAGE) {
        let folder = or_panic(board.image.create_folder("emulated"));
        let mut qemu = Qemu::new(&board.image, board.machine, &folder, &[IMAGE]);
        qemu.instruction_time(INSTRUCTION_SHIFT).uart(Uart::None);
        let lines = qemu.run(SILENCE, |line| println!("  {}", in_instructions(line)));
        check(&or_panic(lines));
    }
}

/// A line of the image.
#[derive(Debug, PartialEq, Eq)]
enum Line<'l> {
    Passed { ticks: u64, vector: &'l str },
    Failed,
    End { vectors: usize, failed: usize },
}

impl<'l> Line<'l> {
    /// `None` for a line that is not one of the image's results.
    fn parse(line: &'l str) -> Option<Self> {
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

/// The line with its ticks as instructions.
fn in_instructions(line: &str) -> String {
    match Line::parse(line) {
        Some(Line::Passed { ticks, vector }) => {
            let instructions = ticks * 10 / TICKS_OF_10_INSTRUCTIONS;
            format!("passed  {vector:36} {instructions:>11} instructions")
        }
        _ => line.to_owned(),
    }
}

/// Checks that the image has reached its end, where it counts its vectors, and that each of them has passed.
fn check(lines: &[String]) {
    let results: Vec<_> = lines.iter().filter_map(|line| Line::parse(line)).collect();
    let passed = results.iter();
    let passed = passed.filter(|line| matches!(line, Line::Passed { .. }));
    let vectors = passed.count();
    assert!(vectors > 0, "no golden vector has passed: {lines:?}");
    let end = Line::End { vectors, failed: 0 };
    assert_eq!(
        results.last(),
        Some(&end),
        "the image did not end after {vectors} vectors that have passed; the vectors are in tests/on-target/src"
    );
}

#[test]
fn only_an_image_that_counts_all_its_vectors_as_passed_is_accepted() {
    let accepted = |lines: &[&str]| {
        let lines: Vec<String> = lines.iter().map(|&line| line.to_owned()).collect();
        emulated::refusal::message(|| check(&lines)).is_empty()
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
fn ticks_are_printed_as_instructions() {
    let line = in_instructions("passed 2560 network's sum");
    assert!(line.starts_with("passed  network's sum "), "{line}");
    assert!(line.ends_with(" 100 instructions"), "{line}");
    assert_eq!(in_instructions("something else"), "something else");
}

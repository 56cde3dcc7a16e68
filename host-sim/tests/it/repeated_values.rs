//! Recordings that repeat their values exactly are no faults of the converters.

use std::{env, fs, io::Write as _, path::Path};

use link::{Flags, ToHost};

use crate::edf_file::EdfFile;
use crate::host::frames;
use crate::program::run;

/// Plays a recording into a file and returns the number of its codes and of those with a bad
/// status.
fn codes_and_bad_ones(input: &Path) -> (usize, usize) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("codes");
    let input = format!("--input={}", input.display());
    let output = format!("--output=file:{}", path.display());
    let finished = run(&["run", &input, &output]);
    assert_eq!(finished.status, Some(0), "{finished:?}");
    assert!(!finished.log.contains("bad in"), "{finished:?}");
    let bytes = fs::read(path).expect("the codes");
    let codes = frames(&bytes, |frame| match frame.message {
        ToHost::Code(code) => Some(code.flags.contains(Flags::ADC_STATUS_BAD)),
        _ => None,
    });
    (codes.len(), codes.iter().filter(|is_bad| **is_bad).count())
}

#[test]
fn a_flat_recording_shows_no_fault_of_a_converter() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("flat.edf");
    let mut file = EdfFile::with_all_electrodes(4);
    file.is_flat = true;
    fs::write(&path, file.bytes()).expect("writable");
    let steps = 4 * usize::from(model::STEP_RATE_HZ);
    let codes = (steps - model::STEPS) / model::HOP + 1;
    assert_eq!(codes_and_bad_ones(&path), (codes, 0));
}

#[test]
fn a_real_recording_with_flat_stretches_shows_no_fault_of_a_converter() {
    let Some(folder) = env::var_os("CORTICODE_DATA") else {
        let skipped = "SKIPPED: bdf_edf/test.edf not played, CORTICODE_DATA is not set";
        // Written to stderr directly, because the test harness captures `eprintln!`.
        writeln!(std::io::stderr(), "{skipped}").expect("stderr");
        return;
    };
    let path = Path::new(&folder).join("bdf_edf/test.edf");
    let steps = 60 * usize::from(model::STEP_RATE_HZ);
    let codes = (steps - model::STEPS) / model::HOP + 1;
    assert_eq!(codes_and_bad_ones(&path), (codes, 0));
}

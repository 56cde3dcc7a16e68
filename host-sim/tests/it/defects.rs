//! A defect of a recording causes a warning, even with -q, or an error that says what to do. Values
//! that repeat exactly are not a defect.

use std::{fs, path::Path};

use link::{Flags, ToHost};

use crate::edf_file::{EdfFile, Signal};
use crate::gdf_file::gdf_file;
use crate::program::{Finished, frames, run};

fn play(path: &Path) -> Finished {
    let input = format!("--input={}", path.display());
    run(&["run", "-q", &input, "--output=file:/dev/null"])
}

/// Writes these bytes to a file and plays it as a recording.
fn play_bytes(name: &str, bytes: &[u8]) -> Finished {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join(name);
    fs::write(&path, bytes).expect("writable");
    play(&path)
}

fn assert_warns(file: &EdfFile, warning: &str) {
    let finished = play_bytes("defect.edf", &file.bytes());
    assert_eq!(finished.status, Some(0), "{finished:?}");
    assert!(finished.log.contains(warning), "{finished:?}");
}

fn assert_refused(name: &str, bytes: &[u8], reason: &str) {
    let finished = play_bytes(name, bytes);
    assert_eq!(finished.status, Some(2), "{finished:?}");
    assert!(finished.log.contains(reason), "{name}: {finished:?}");
}

#[test]
fn a_sound_recording_has_no_warning() {
    let finished = play_bytes("sound.edf", &EdfFile::with_all_electrodes(2).bytes());
    assert_eq!((finished.status, &*finished.log), (Some(0), ""));
}

#[test]
fn one_to_three_electrodes_are_too_few_to_interpolate_the_others() {
    let labels: Vec<&str> = model::LABELS.split(' ').collect();
    for count in 1..=3 {
        let file = EdfFile::with_labels(2, &labels[..count]);
        let of_all = format!("only {count} of the {} electrodes", labels.len());
        assert_warns(&file, &of_all);
    }
    let finished = play_bytes("four.edf", &EdfFile::with_labels(2, &labels[..4]).bytes());
    assert_eq!(finished.log, "");
}

#[test]
fn an_electrode_that_is_recorded_twice_has_a_warning() {
    let mut file = EdfFile::with_all_electrodes(2);
    let first = file.signals[1].label.clone();
    file.signals.push(Signal::new(&format!("EEG {first}-REF")));
    let warning = format!("electrode {first} is recorded twice: signal {first} is used");
    assert_warns(&file, &warning);
}

#[test]
fn a_reversed_digital_range_has_a_warning() {
    let mut file = EdfFile::with_all_electrodes(2);
    file.signals[0].digital = ["32767", "-32768"];
    assert_warns(&file, "digital minimum is above the maximum");
}

#[test]
fn an_electrode_without_samples_is_refused_by_name() {
    let mut file = EdfFile::with_all_electrodes(2);
    file.signals[2].samples_per_record = 0;
    let reason = format!("signal {} has no samples", file.signals[2].label);
    assert_refused("none.edf", &file.bytes(), &reason);
}

#[test]
fn a_transfer_in_text_mode_is_recognised() {
    let mut damaged = Vec::new();
    for byte in EdfFile::with_all_electrodes(2).bytes() {
        if byte == b'\n' {
            damaged.push(b'\r');
        }
        damaged.push(byte);
    }
    assert_refused("text.edf", &damaged, "transfer the recording again in binary mode");
}

#[test]
fn files_that_are_no_recording_say_what_to_do() {
    assert_refused("empty.edf", b"", "the file is empty");
    let export = "read_raw_brainvision('FILE.vhdr').export('FILE.edf')";
    assert_refused("eeg.eeg", &[1; 1000], export);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let finished = play(folder.path());
    assert_eq!(finished.status, Some(2), "{finished:?}");
    assert!(finished.log.contains("is a folder; name one recording in it"), "{finished:?}");
}

#[test]
fn a_flat_recording_shows_no_fault_of_a_converter() {
    let rate = model::ADC_RATE_HZ;
    let flat = gdf_file(rate, 4 * rate, &[], |_| vec![40.0; model::ELECTRODES]);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("codes");
    let input = format!("--input={}", flat.path().display());
    let output = format!("--output=file:{}", path.display());
    let finished = run(&["run", &input, &output]);
    assert_eq!(finished.status, Some(0), "{finished:?}");
    assert!(!finished.log.contains("is bad in"), "{finished:?}");
    let bytes = fs::read(path).expect("the codes");
    let bad = frames(&bytes, |frame| match frame.message {
        ToHost::Code(code) => Some(code.flags.contains(Flags::ADC_STATUS_BAD)),
        _ => None,
    });
    let steps = 4 * usize::from(model::STEP_RATE_HZ);
    assert_eq!(bad, vec![false; (steps - model::STEPS) / model::HOP + 1]);
}

#[test]
fn values_that_the_adc_cannot_represent_have_a_warning_also_without_a_summary() {
    let rate = model::ADC_RATE_HZ;
    let file = gdf_file(rate, 2 * rate, &[], |row| {
        let mut values = vec![300_000.0; model::ELECTRODES];
        values[0] = if row == 7 { f32::NAN } else { 1.0 };
        values
    });
    let folder = tempfile::tempdir().expect("a folder");
    let codes = folder.path().join("a.codes");
    let [file, codes] = [file.path(), &codes].map(|path| path.to_str().expect("text"));
    for arguments in [
        ["run", "-q", "--output=file:/dev/null", "--input", file],
        ["encode", "-q", "--jobs=1", file, codes],
    ] {
        let finished = run(&arguments);
        assert_eq!(finished.status, Some(0), "{finished:?}");
        for warning in [
            format!(" {} counts are at the rail", (model::ELECTRODES - 1) * 2 * usize::from(rate)),
            " 1 samples are no number".to_owned(),
        ] {
            assert!(finished.log.contains(&warning), "{warning}: {finished:?}");
        }
    }
}

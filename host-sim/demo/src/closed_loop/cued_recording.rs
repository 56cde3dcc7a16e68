//! Recordings of synthetic EEG with cues to move the left or the right hand.

use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use host_sim::synthetic::{Generator, Hand, SyntheticSpec};
use pipeline::Mains;
use recordings::{EdfWriter, FileToWrite};

use crate::Failure;

/// Labels of the cues for the left and the right hand, and their event codes in ROS.
pub(super) const EVENTS: &str = "T1=769,T2=770";
/// Part of each trial from which a classifier decides: start and end, seconds after the trial's
/// cue.
pub(super) const TRIAL: &str = "0.5..2";

/// The cues of a run: 0 for the left hand, 1 for the right one.
const CUES: [usize; 12] = [0, 1, 1, 0, 0, 1, 0, 1, 1, 0, 1, 0];
/// Time before the first cue, in which the device's filters settle, seconds.
const SETTLING_S: usize = 10;
/// Time from a cue to the next one, and duration of the movement, samples.
const PERIOD: usize = RATE * 5 / 2;
const MOVEMENT: usize = RATE * 2;
const RATE: usize = model::ADC_RATE_HZ as usize;
/// Amplitude of the sensorimotor rhythm of each hand area at rest, uV RMS at C3 and C4.
const MU_UV: f64 = 4.0;

/// Writes three runs of 40 s as BDF+ files. One generator makes all of them, so they have the same
/// head. Returns their paths.
///
/// # Errors
/// A file cannot be written, or the model has an electrode that host-sim does not know.
pub(super) fn write(folder: &Path, mains: Mains, seed: u64) -> Result<[PathBuf; 3], Failure> {
    let mut spec = SyntheticSpec::new(seed, model::LABELS.split(' '));
    spec.mu_uv = MU_UV;
    spec.mains_hz = if mains == Mains::Hz60 { 60 } else { 50 };
    let next = "compare the model's montage with the electrodes that host-sim knows";
    let mut generator = Generator::new(&spec)
        .map_err(|error| Failure::check("synthesising a recording", error, next))?;
    let runs = [1, 2, 3].map(|run| folder.join(format!("run{run}.bdf")));
    for (path, run) in runs.iter().zip(0..) {
        let next = "is the disk full? is TMPDIR writable?";
        write_run(path, run, &spec, &mut generator)
            .map_err(|error| Failure::check("writing a recording", error, next))?;
    }
    Ok(runs)
}

fn write_run(
    path: &Path,
    run: usize,
    spec: &SyntheticSpec,
    generator: &mut Generator,
) -> io::Result<()> {
    let length = SETTLING_S * RATE + CUES.len() * PERIOD;
    let cue = |trial: usize| CUES[(trial + run) % CUES.len()];
    let annotations = (0..CUES.len()).map(|trial| {
        let row = (SETTLING_S * RATE + trial * PERIOD) as u64;
        (row..row + MOVEMENT as u64, ["T1", "T2"][cue(trial)].to_owned())
    });
    let file = BufWriter::new(File::create(path)?);
    let annotations = annotations.collect();
    let mut writer = EdfWriter::bdf(file, &content(spec), length as u64, annotations)?;
    let mut record = Vec::new();
    for row in 0..length {
        let since = row.checked_sub(SETTLING_S * RATE);
        let moving = since.filter(|since| since % PERIOD < MOVEMENT);
        generator.move_hand(moving.map(|since| [Hand::Left, Hand::Right][cue(since / PERIOD)]));
        #[expect(clippy::cast_possible_truncation, reason = "24 bits fit")]
        let uv = |count: &i32| (f64::from(*count) * spec.lsb_uv) as f32;
        let counts = generator.next_sample();
        record.extend(counts.iter().take(spec.electrodes.len()).map(uv));
        if record.len() == RATE * spec.electrodes.len() {
            writer.write_record(&record)?;
            record.clear();
        }
    }
    writer.finish().map(drop)
}

/// Returns the header of a recording whose records last one second.
fn content(spec: &SyntheticSpec) -> FileToWrite {
    let rails = [-8_388_608.0, 8_388_607.0];
    let range = rails.map(|counts| counts * spec.lsb_uv);
    FileToWrite {
        description: "synthetic EEG with cues".to_owned(),
        ..FileToWrite::microvolts(&spec.electrodes, range, spec.rate_hz, spec.rate_hz)
    }
}

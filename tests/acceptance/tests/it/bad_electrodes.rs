//! Checks how often the default model excludes electrodes in recordings of people.

use std::path::Path;

use acceptance::real_data;
use emulator::skip::skipped;
use model::{LABELS, STEP_RATE_HZ, SUBSTITUTION, Substitution as Table};
use pipeline::{Acquisition, ExclusionPolicy, Mains, Substitution};

use crate::inputs::recorded;

const TEST: &str = "exclusions of the recordings of eight people";

/// Largest permitted number of exclusions per hour after the filters have settled, 20 % above the
/// measured 64.
const MOST_PER_HOUR: f64 = 77.0;

/// No faults were added to these recordings, so an exclusion is a real fault, an artefact or a
/// false alarm. The table of substitutions was fitted to other recordings of the same people.
#[test]
fn few_electrodes_of_real_eeg_are_excluded() {
    let Some(table) = &SUBSTITUTION else {
        return skipped(TEST, "the model has no table of substitutions");
    };
    let (mut exclusions, mut hours) = (0, 0.0);
    for subject in 1..=8 {
        for run in ["R01", "R02", "R11", "R12"] {
            let name = format!("S{subject:03}{run}");
            let Some(path) = real_data::path(TEST, &format!("eegmmidb_S{subject:03}/{name}.edf"))
            else {
                return;
            };
            let (found, settled) = excluded(&path, table);
            for (step, label) in &found {
                println!("{name} {:.1} s: {label}", step / f64::from(STEP_RATE_HZ));
            }
            exclusions += found.len();
            hours += settled / f64::from(STEP_RATE_HZ) / 3_600.0;
        }
    }
    #[expect(clippy::cast_precision_loss, reason = "some tens")]
    let per_hour = exclusions as f64 / hours;
    println!("{exclusions} exclusions in {hours:.2} h: {per_hour:.0} per hour");
    assert!(per_hour < MOST_PER_HOUR && exclusions > 0, "{per_hour}");
}

/// Returns the step and the label of each exclusion in a recording, and the number of its steps in
/// which the filters have settled.
fn excluded(path: &Path, table: &Table<'_>) -> (Vec<(f64, &'static str)>, f64) {
    let labels: Vec<&str> = LABELS.split(' ').collect();
    // The recordings come from a country where the mains frequency is 60 Hz.
    let mains = Mains::Hz60;
    let mut acquisition = Acquisition::new(mains);
    let mut substitution = Box::new(Substitution::NEW);
    substitution.restart(mains);
    let (mut found, mut steps, mut settled, mut before) = (Vec::new(), 0.0, 0.0, 0);
    for sample in recorded(path) {
        substitution.observe_sample(&sample);
        let Some(mut step) = acquisition.process_sample(&sample) else {
            continue;
        };
        substitution.fill_step(&mut step, ExclusionPolicy::AUTOMATIC, table);
        let new = step.excluded & !before;
        let electrodes = (0..labels.len()).filter(|electrode| new >> electrode & 1 != 0);
        found.extend(electrodes.map(|electrode| (steps, labels[electrode])));
        before = step.excluded;
        steps += 1.0;
        settled += f64::from(!step.settling);
    }
    (found, settled)
}

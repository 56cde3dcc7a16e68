//! Finds and interpolates the bad electrodes of a recording: those that the other electrodes hardly
//! predict.

use crate::error::FitError;
use crate::innovation::{columns, median, prediction, residual, seconds};
use crate::track::Track;
use nalgebra::DMatrix;
use recordings::montage_map::Origin;
use recordings::{Missing, MontageMap};

/// RMS below which an electrode counts as having no signal, uV. An ADS1299 with shorted input has
/// 0.14 uV of noise at gain 24 (SBAS499C, table 1).
const SILENT_UV: f64 = 0.1;

/// First of two conditions for a bad electrode: the energy of its innovation (median over all
/// seconds) is more than this many times the median over all electrodes. In recordings R03 to R12
/// of EEGMMIDB S001 to S008, the ratio is 176 to 1,056 for FT8 of S004, up to 209 for FT7 of S006,
/// and up to 94 for every other electrode.
const BAD_INNOVATION: f64 = 100.0;

/// Second condition for a bad electrode: the energy of its innovation is more than this fraction of
/// the energy of its signal, so the other electrodes hardly predict it. In the recordings of
/// [`BAD_INNOVATION`], the fraction is 0.95 to 0.99 for FT8 of S004 and up to 0.69 for FT7 of S006.
const BAD_PART: f64 = 0.8;

/// Finds the bad electrodes of one person's recordings, and interpolates them.
///
/// A bad electrode spoils the predictions of its neighbours. So the worst electrodes are
/// interpolated first, and the others are judged again, until none is bad.
///
/// # Errors
/// [`FitError::SilentRecording`] if no electrode of a recording has a signal.
///
/// # Panics
/// If there is no recording.
pub fn interpolate_bad(tracks: &mut [&mut Track], electrodes: &[String]) -> Result<(), FitError> {
    for track in &mut *tracks {
        track.bad = silent_electrodes(track, electrodes)?;
        interpolate(track, electrodes);
    }
    loop {
        let own = tracks.iter().map(|track| &**track);
        let prediction = prediction(own).expect("no recording is silent");
        let mut is_done = true;
        for track in &mut *tracks {
            let found = noisy_electrodes(&prediction, track, electrodes);
            is_done &= found.is_empty();
            track.bad.extend(found);
            interpolate(track, electrodes);
        }
        if is_done {
            return Ok(());
        }
    }
}

/// Returns the indices of the electrodes that have no signal in a recording.
///
/// # Errors
/// [`FitError::SilentRecording`] if no electrode has a signal.
pub(crate) fn silent_electrodes(
    track: &Track,
    electrodes: &[String],
) -> Result<Vec<usize>, FitError> {
    let energies = energies(&columns(track).map(f64::from));
    let silent = energies.iter().enumerate();
    let silent = silent.filter(|(_, energy)| **energy < SILENT_UV.powi(2));
    let silent: Vec<usize> = silent.map(|(index, _)| index).collect();
    if silent.len() == electrodes.len() {
        return Err(FitError::SilentRecording(track.name.clone()));
    }
    let is_recorded = |index: &usize| !track.interpolated.contains(&electrodes[*index]);
    Ok(silent.into_iter().filter(is_recorded).collect())
}

/// Returns the mean square of each row.
fn energies(rows: &DMatrix<f64>) -> Vec<f64> {
    let rows = rows.row_iter();
    let energies = rows.map(|row| row.norm_squared() / row.len().max(1) as f64);
    energies.collect()
}

/// Returns the indices of the electrodes of a recording that are newly found to be bad. Their
/// innovation exceeds both limits, and it is at least half of the largest innovation that exceeds
/// them. `prediction` predicts each electrode from the others. An electrode that the recording
/// lacks is never bad.
fn noisy_electrodes(prediction: &DMatrix<f64>, track: &Track, electrodes: &[String]) -> Vec<usize> {
    let innovation = residual(prediction, track);
    let [signal, all] = [energies(&columns(track).map(f64::from)), energies(&innovation)];
    let in_seconds = innovation.row_iter().map(|row| {
        let seconds = seconds(row.iter());
        // A recording shorter than a second has no whole second to judge.
        if seconds.is_empty() { 0.0 } else { median(seconds) }
    });
    let in_seconds: Vec<f64> = in_seconds.collect();
    let limit = BAD_INNOVATION * median(in_seconds.clone());
    let mut noisy: Vec<usize> = (0..electrodes.len()).collect();
    noisy.retain(|&electrode| {
        in_seconds[electrode] > limit
            && all[electrode] > BAD_PART * signal[electrode]
            && !track.bad.contains(&electrode)
            && !track.interpolated.contains(&electrodes[electrode])
    });
    let largest = noisy.iter().map(|&electrode| in_seconds[electrode]);
    let largest = largest.fold(0.0, f64::max);
    noisy.retain(|&electrode| in_seconds[electrode] >= largest / 2.0);
    noisy
}

/// Replaces the bad electrodes of a recording by mixes of its other electrodes, as if the recording
/// lacked them.
pub(crate) fn interpolate(track: &mut Track, electrodes: &[String]) {
    let bad = &track.bad;
    if bad.is_empty() {
        return;
    }
    let is_recorded =
        |&index: &usize| !bad.contains(&index) && !track.interpolated.contains(&electrodes[index]);
    let recorded: Vec<usize> = (0..electrodes.len()).filter(is_recorded).collect();
    let labels: Vec<&String> = recorded.iter().map(|&index| &electrodes[index]).collect();
    let map = MontageMap::new(&labels, electrodes, Missing::Interpolate)
        .expect("the recording's own map has accepted these labels, of which some are left");
    for step in track.values.chunks_exact_mut(electrodes.len()) {
        for &index in bad {
            let Origin::Interpolated(mix) = &map.origins()[index] else {
                continue;
            };
            let mix = mix.iter();
            let value = mix.map(|&(signal, weight)| f64::from(step[recorded[signal]]) * weight);
            #[expect(clippy::cast_possible_truncation, reason = "a float network takes f32")]
            let value = value.sum::<f64>() as f32;
            step[index] = value;
        }
    }
}

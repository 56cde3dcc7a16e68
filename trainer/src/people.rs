//! The people whose recordings a model is trained on or tested with: their signal power, and their
//! bad electrodes.
//!
//! ```text
//! tracks --> bad electrodes interpolated --> as recorded: ranges, tests
//!                                        --> every person at equal power: training
//! ```
//!
//! At equal power, the weight of a person in training depends only on the length of the recordings.
//! At the recorded power, a person with twice the amplitude would have four times the weight.

use crate::error::TrainerError;
use crate::progress::ProgressObserver;
use crate::selection::TrainingFiles;
use crate::subject::subject_of;
use artifact::{Description, Person};
use packed_fit::bad_electrodes::interpolate_bad;
use packed_fit::innovation::median;
use packed_fit::{FitError, Track};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Recordings of one or several people. In each recording, bad electrodes are interpolated.
#[derive(Clone, Debug)]
pub(crate) struct People {
    /// Recordings in the given order, with their original amplitude.
    pub(crate) tracks: Vec<Track>,
    /// For each recording, the index of its person in `cards`.
    of: Vec<usize>,
    /// Entry of each person in training cards, sorted by name.
    cards: Vec<Person>,
}

impl People {
    /// Reads recordings as [`read_tracks`] does, and groups them as [`People::new`] does.
    pub(crate) fn read(
        recordings: &[PathBuf],
        options: &TrainingFiles,
        description: &Description,
        observer: &mut impl ProgressObserver,
    ) -> Result<Self, TrainerError> {
        let tracks = read_tracks(recordings, description, options.mains_hz, observer)?;
        let electrodes = &description.montage.electrodes;
        Self::new(tracks, electrodes, options.subject.as_deref(), observer)
    }

    /// Groups recordings by person, and interpolates the bad electrodes of each recording from
    /// their neighbours; a warning names these electrodes. If `subject` is given, all recordings
    /// are of this person.
    ///
    /// # Errors
    /// [`FitError::SilentRecording`] if a recording has no signal at any electrode.
    pub(crate) fn new(
        mut tracks: Vec<Track>,
        electrodes: &[String],
        subject: Option<&str>,
        observer: &mut impl ProgressObserver,
    ) -> Result<Self, TrainerError> {
        let name = |track: &Track| match subject {
            Some(subject) => subject.to_owned(),
            None => subject_of(Path::new(&track.name)),
        };
        let names: Vec<String> = tracks.iter().map(name).collect();
        let mut by_name: BTreeMap<&String, Vec<usize>> = BTreeMap::new();
        for (index, name) in names.iter().enumerate() {
            by_name.entry(name).or_default().push(index);
        }
        let (mut of, mut cards) = (vec![0; tracks.len()], Vec::new());
        for (subject, indices) in by_name {
            let mut own: Vec<&mut Track> = tracks
                .iter_mut()
                .zip(&names)
                .filter_map(|(track, name)| (name == subject).then_some(track))
                .collect();
            // For each bad electrode, the number of recordings in which it is bad.
            let mut bad: BTreeMap<usize, usize> = BTreeMap::new();
            interpolate_bad(&mut own, electrodes)?;
            for electrode in own.iter().flat_map(|track| &track.bad) {
                *bad.entry(*electrode).or_default() += 1;
            }
            let values = own.iter().flat_map(|track| &track.values);
            let energy: f64 = values.clone().map(|&uv| f64::from(uv).powi(2)).sum();
            let count = values.count().max(1) as f64;
            for &index in &indices {
                of[index] = cards.len();
            }
            for (electrode, count) in &bad {
                observer.message(&format!(
                    "warning: {subject}: electrode {} is bad in {count} of {} recordings and is \
                     interpolated there; check its contact, or leave these recordings out",
                    electrodes[*electrode],
                    indices.len()
                ));
            }
            cards.push(Person {
                subject: subject.clone(),
                sd_uv: (energy / count).sqrt(),
                bad: bad.keys().map(|&index| electrodes[index].clone()).collect(),
            });
        }
        Ok(Self { tracks, of, cards })
    }

    /// Returns the recordings for training. Each person's recordings are multiplied by one factor,
    /// so that all people have the standard deviation of the median person. With a single person,
    /// the recordings stay as they are.
    pub(crate) fn at_equal_power(&self, observer: &mut impl ProgressObserver) -> Vec<Track> {
        if self.cards.is_empty() {
            return Vec::new();
        }
        let typical = median(self.cards.iter().map(|person| person.sd_uv).collect());
        if self.cards.len() > 1 {
            let people = self.cards.iter();
            let people = people.map(|person| format!("{} {:.1} uV", person.subject, person.sd_uv));
            observer.message(&format!(
                "standard deviation of {}; for training, all are scaled to the median, {typical:.1} uV",
                people.collect::<Vec<_>>().join(", ")
            ));
        }
        let tracks = self.tracks.iter().zip(&self.of);
        let scaled = tracks.map(|(track, &person)| {
            let factor = typical / self.cards[person].sd_uv;
            #[expect(clippy::cast_possible_truncation, reason = "a float network takes f32")]
            let scaled = |uv: &f32| (f64::from(*uv) * factor) as f32;
            Track { values: track.values.iter().map(scaled).collect(), ..track.clone() }
        });
        scaled.collect()
    }

    /// Returns the people for a training card; empty for a single person without bad electrodes.
    pub(crate) fn card(&self) -> Vec<Person> {
        match self.cards.as_slice() {
            [person] if person.bad.is_empty() => Vec::new(),
            people => people.to_vec(),
        }
    }

    /// Returns all people except `subject`, and the recordings of `subject`.
    pub(crate) fn leave_out(&self, subject: &str) -> (Self, Vec<Track>) {
        let mut others = self.clone();
        let is_left_out = |of: &usize| self.cards[*of].subject == subject;
        let (mut left_out, mut kept) = (Vec::new(), Vec::new());
        for (track, of) in others.tracks.drain(..).zip(&self.of) {
            if is_left_out(of) {
                left_out.push(track);
            } else {
                kept.push(track);
            }
        }
        others.tracks = kept;
        others.of.retain(|of| !is_left_out(of));
        let place = self.cards.iter().position(|card| card.subject == subject);
        if let Some(place) = place {
            others.cards.remove(place);
            for of in &mut others.of {
                *of -= usize::from(*of > place);
            }
        }
        (others, left_out)
    }

    /// Returns the indices of each person's recordings.
    pub(crate) fn recordings(&self) -> Vec<Vec<usize>> {
        let mut indices = vec![Vec::new(); self.cards.len()];
        for (index, &person) in self.of.iter().enumerate() {
            indices[person].push(index);
        }
        indices
    }

    pub(crate) fn count(&self) -> usize {
        self.cards.len()
    }

    /// Returns each person's recordings.
    pub(crate) fn each(&self) -> impl Iterator<Item = (&Person, Vec<Track>)> {
        self.each_of(&self.tracks)
    }

    /// Returns each person's recordings from `tracks`, which are the same recordings in the same
    /// order, possibly processed differently.
    pub(crate) fn each_of<'a>(
        &'a self,
        tracks: &'a [Track],
    ) -> impl Iterator<Item = (&'a Person, Vec<Track>)> {
        self.cards.iter().enumerate().map(move |(index, person)| {
            let own = tracks.iter().zip(&self.of);
            let own = own.filter(|(_, of)| **of == index);
            let own = own.map(|(track, _)| track.clone());
            (person, own.collect())
        })
    }
}

/// Reads each recording of a list as [`Track::read`] does, and reports its length and its warnings.
pub(crate) fn read_tracks(
    files: &[PathBuf],
    description: &Description,
    mains_hz: u32,
    observer: &mut impl ProgressObserver,
) -> Result<Vec<Track>, TrainerError> {
    let tracks = files.iter().map(|file| {
        let (track, warnings) = Track::read(file, description, mains_hz)?;
        observer.message(&track.to_string());
        for warning in warnings {
            observer.message(&format!("{}: warning: {warning}", track.name));
        }
        Ok(track)
    });
    Ok(tracks.collect::<Result<_, FitError>>()?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const LABELS: [&str; 9] = ["F3", "Fz", "F4", "C3", "Cz", "C4", "P3", "Pz", "P4"];
    const MIDDLE: usize = 4;

    /// Collects the messages of a command.
    #[derive(Default)]
    struct Messages(Vec<String>);

    impl ProgressObserver for Messages {
        fn message(&mut self, text: &str) {
            self.0.push(text.to_owned());
        }
    }

    /// Returns a recording of 20 s in which neighbouring electrodes are similar. `change` gets each
    /// step's index, a random number from -1 to 1, and the value of Cz, which it may replace.
    fn track(name: &str, gain: f32, change: impl Fn(usize, f32, &mut f32)) -> Track {
        let mut rng = ChaCha8Rng::seed_from_u64(name.len() as u64);
        let values = (0..2560).flat_map(|step| {
            let [x, y, z]: [f32; 3] = std::array::from_fn(|_| rng.random_range(-20.0..20.0));
            let mut values: [f32; 9] = std::array::from_fn(|at| {
                let (row, column) = ((at / 3) as f32, (at % 3) as f32);
                x + y * row / 2.0 + z * column / 2.0 + rng.random_range(-1.0..1.0)
            });
            change(step, rng.random_range(-1.0..1.0), &mut values[MIDDLE]);
            values.map(|value| gain * value)
        });
        Track::new(name, 9, values.collect())
    }

    fn unchanged(_: usize, _: f32, _: &mut f32) {}

    fn people(tracks: Vec<Track>) -> (People, Vec<String>) {
        let mut messages = Messages::default();
        let people = People::new(tracks, &LABELS.map(str::to_owned), None, &mut messages);
        (people.unwrap(), messages.0)
    }

    /// Returns the root mean square of all values of tracks.
    fn rms(tracks: &[Track]) -> f64 {
        let values = tracks.iter().flat_map(|track| &track.values);
        let sum: f64 = values.clone().map(|uv| f64::from(*uv).powi(2)).sum();
        (sum / values.count() as f64).sqrt()
    }

    #[test]
    fn one_person_stays_as_recorded_bit_for_bit() {
        let recorded = ["S1R1.edf", "S1R02.edf"].map(|name| track(name, 0.3, unchanged));
        let (people, messages) = people(recorded.to_vec());
        let scaled = people.at_equal_power(&mut Messages::default());
        for tracks in [&scaled, &people.tracks] {
            for (track, recorded) in tracks.iter().zip(&recorded) {
                assert_eq!(track.values, recorded.values);
            }
        }
        assert_eq!(messages, [""; 0]);
        assert_eq!(people.card(), []);
    }

    #[test]
    fn every_person_has_the_power_of_the_median_one_over_all_own_recordings() {
        let named = [("b-1", 3.0), ("a-1", 1.0), ("b-22", 5.0), ("c-1", 0.25)];
        let recorded = named.map(|(name, gain)| track(name, gain, unchanged));
        let (people, _) = people(recorded.to_vec());
        let typical = rms(&recorded[1..2]);
        let mut messages = Messages::default();
        let scaled = people.at_equal_power(&mut messages);
        for person in [&[0, 2][..], &[1], &[3]] {
            let of = |tracks: &[Track]| -> Vec<Track> {
                person.iter().map(|&index| tracks[index].clone()).collect()
            };
            assert!((rms(&of(&scaled)) / typical - 1.0).abs() < 1e-6, "{person:?}");
            let factor = typical / rms(&of(&recorded));
            for (scaled, recorded) in of(&scaled).iter().zip(of(&recorded)) {
                for (scaled, recorded) in scaled.values.iter().zip(recorded.values) {
                    let expected = f64::from(recorded) * factor;
                    assert!((f64::from(*scaled) - expected).abs() < 1e-5, "{person:?}");
                }
            }
        }
        assert!(
            messages.0[0].contains("scaled to the median"),
            "{messages:?}",
            messages = messages.0
        );
        let names: Vec<String> = people.card().into_iter().map(|p| p.subject).collect();
        assert_eq!(names, ["a", "b", "c"]);
    }

    #[test]
    fn electrodes_that_are_bad_most_of_the_time_are_interpolated_and_named() {
        type Change = fn(usize, f32, &mut f32);
        let noise: Change = |_, noise, value| *value += 100.0 * noise;
        let pops: Change = |step, noise, value| {
            if step % 1280 < 128 {
                *value += 100.0 * noise;
            }
        };
        let muscle: Change = |_, noise, value| *value += 10.0 * noise;
        let flat: Change = |_, _, value| *value = 0.01;
        for (change, is_bad) in [(noise, true), (flat, true), (pops, false), (muscle, false)] {
            let recorded = track("S1R01", 1.0, change);
            let good = track("S1R02", 1.0, unchanged);
            let (people, messages) = people(vec![recorded.clone(), good.clone()]);
            let names: &[&str] = if is_bad { &["Cz"] } else { &[] };
            let bad: Vec<String> = people.card().into_iter().flat_map(|p| p.bad).collect();
            assert_eq!(bad, names);
            assert_eq!(messages.len(), names.len(), "{messages:?}");
            assert_eq!(people.tracks[1].values, good.values);
            if !is_bad {
                assert_eq!(people.tracks[0].values, recorded.values);
                continue;
            }
            let words = "S1: electrode Cz is bad in 1 of 2 recordings";
            assert!(messages[0].contains(words), "{messages:?}");
            let clean = track("S1R01", 1.0, unchanged);
            let filled = people.tracks[0].values.chunks_exact(9);
            let [mut error, mut energy] = [0.0, 0.0];
            for ((filled, recorded), clean) in
                filled.zip(recorded.values.chunks_exact(9)).zip(clean.values.chunks_exact(9))
            {
                assert_eq!(filled[..MIDDLE], recorded[..MIDDLE]);
                assert_eq!(filled[MIDDLE + 1..], recorded[MIDDLE + 1..]);
                error += (filled[MIDDLE] - clean[MIDDLE]).powi(2);
                energy += clean[MIDDLE].powi(2);
            }
            // The four neighbours surround Cz, so their mean has the sources of Cz and less noise.
            assert!(error < 0.01 * energy, "{error} {energy}");
        }
    }

    #[test]
    fn a_lacking_or_loud_electrode_is_not_bad_and_a_silent_recording_is_refused() {
        let mut lacking = track("S1R01", 1.0, |_, noise, value| *value += 100.0 * noise);
        lacking.interpolated = vec!["Cz".to_owned()];
        assert_eq!(people(vec![lacking]).0.card(), []);
        let loud = track("S1R01", 1.0, |_, _, value| *value *= 100.0);
        assert_eq!(people(vec![loud]).0.card(), []);
        let mut silent = track("S1R02", 1.0, unchanged);
        silent.values.fill(0.0);
        let tracks = vec![track("S1R01", 1.0, unchanged), silent];
        let electrodes = LABELS.map(str::to_owned);
        let error = People::new(tracks, &electrodes, None, &mut Messages::default());
        let error = error.unwrap_err().to_string();
        assert!(error.contains("S1R02 has no signal at any electrode"), "{error}");
    }
}

//! Error of a model for each person, with the substitution of bad electrodes on and off.

use crate::dataset::Dataset;
use crate::electrode_error::{ElectrodeError, ElectrodeSums};
use crate::error::TrainerError;
use crate::evaluate::{ReconstructionError, evaluate_blocks};
use crate::people::People;
use crate::substitution::filled;
use artifact::{Artifact, Person};
use packed_fit::Track;
use serde_json::{Value as Json, json};
use std::fmt;

/// Error for one person with integer codes, with and without the substitution of bad electrodes. If
/// the recordings have no bad electrodes, both errors are equal.
#[derive(Clone, Debug)]
pub(crate) struct PersonError {
    pub(crate) person: Person,
    /// Error with substitution: bad electrodes are filled from the others before the encoder, and
    /// the decoded signal is compared with the filled signal.
    pub(crate) on: IntegerError,
    /// Error without substitution, on the recordings before interpolation.
    pub(crate) off: IntegerError,
}

/// Error of a model's integer codes.
#[derive(Clone, Debug)]
pub(crate) struct IntegerError {
    /// Error over all electrodes.
    pub(crate) all: ReconstructionError,
    /// Error of each electrode, in the order of the montage.
    pub(crate) electrodes: Vec<ElectrodeError>,
    sd_uv: f64,
}

impl PersonError {
    /// Returns whether [`PersonError::of_each`] can measure a model: whether it has a network and a
    /// table of substitutions.
    pub(crate) fn is_measured(model: &Artifact) -> bool {
        model.substitution.is_some() && model.description.mode.has_network()
    }

    /// Measures the error for each person; `recorded` are the recordings of `people` before
    /// interpolation. Returns an empty list unless [`PersonError::is_measured`].
    ///
    /// # Errors
    /// If the model cannot be turned into integers, or its codes cannot be decoded.
    pub(crate) fn of_each(
        model: &Artifact,
        people: &People,
        recorded: &[Track],
    ) -> Result<Vec<Self>, TrainerError> {
        let Some(table) = &model.substitution else {
            return Ok(Vec::new());
        };
        if !Self::is_measured(model) {
            return Ok(Vec::new());
        }
        let pairs = people.each().zip(people.each_of(recorded));
        let errors = pairs.map(|((person, own), (_, recorded))| {
            let substituted: Vec<Track> = own.iter().map(|track| filled(track, table)).collect();
            let on = IntegerError::new(model, &substituted)?;
            let off = if person.bad.is_empty() {
                on.clone()
            } else {
                IntegerError::new(model, &recorded)?
            };
            let person = person.clone();
            Ok(Self { person, on, off })
        });
        errors.collect()
    }

    /// Returns the mean squared error over the electrodes that are good in all recordings, uV^2,
    /// with substitution on and off.
    pub(crate) fn of_good(&self) -> [f64; 2] {
        [&self.on, &self.off].map(|error| {
            let electrodes = error.electrodes.iter();
            let good = electrodes.filter(|electrode| !self.person.bad.contains(&electrode.label));
            let good: Vec<f64> = good.map(|electrode| error.mse_uv2(electrode)).collect();
            good.iter().sum::<f64>() / good.len() as f64
        })
    }

    /// Returns the error of each electrode with substitution on and off, uV^2.
    pub(crate) fn of_electrodes(&self) -> impl Iterator<Item = (&str, [f64; 2])> {
        let pairs = self.on.electrodes.iter().zip(&self.off.electrodes);
        pairs.map(|(on, off)| (&*on.label, [self.on.mse_uv2(on), self.off.mse_uv2(off)]))
    }

    pub(crate) fn to_json(&self) -> Json {
        let [good_on, good_off] = self.of_good();
        let electrodes = self.of_electrodes().map(
            |(label, [on, off])| json!({"electrode": label, "mse_uv2_on": on, "mse_uv2_off": off}),
        );
        json!({
            "subject": self.person.subject,
            "bad": self.person.bad,
            "prd_percent_on": self.on.all.prd_percent,
            "prd_percent_off": self.off.all.prd_percent,
            "good_mse_uv2_on": good_on,
            "good_mse_uv2_off": good_off,
            "by_electrode": electrodes.collect::<Vec<_>>(),
        })
    }
}

impl IntegerError {
    fn new(model: &Artifact, tracks: &[Track]) -> Result<Self, TrainerError> {
        let description = &model.description;
        let sd_uv = description.input.sd_uv;
        let mut dataset = Dataset::from_tracks(tracks, description.dimensions())?;
        dataset.scale(1.0 / sd_uv);
        let mut sums = ElectrodeSums::new(description.montage.electrodes.len());
        let all = evaluate_blocks(model, &dataset, |block| sums.add(block))?.integer;
        let is_recorded = |label: &String| {
            let mut tracks = tracks.iter();
            !tracks.any(|track| track.interpolated.contains(label))
        };
        Ok(Self { all, electrodes: sums.errors(description, is_recorded), sd_uv })
    }

    fn mse_uv2(&self, electrode: &ElectrodeError) -> f64 {
        electrode.mse_int8 * self.sd_uv.powi(2)
    }
}

/// The table of each person's error that `trainer evaluate` prints.
#[derive(Clone, Debug)]
pub(crate) struct Table<'a>(pub &'a [PersonError]);

impl fmt::Display for Table<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:<14}{:>14}{:>12}{:>26}{:>12}  bad electrodes",
            "integer codes", "PRD %, filled", "as it is", "MSE uV^2 of good, filled", "as it is"
        )?;
        for error in self.0 {
            let [good_on, good_off] = error.of_good();
            writeln!(
                f,
                "{:<14}{:>14.2}{:>12.2}{good_on:>26.2}{good_off:>12.2}  {}",
                error.person.subject,
                error.on.all.prd_percent,
                error.off.all.prd_percent,
                error.person.bad.join(", ")
            )?;
        }
        Ok(())
    }
}

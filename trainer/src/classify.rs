//! The command `trainer classify`: spatial filters for the device, and a decision about their band
//! powers for the host.
//!
//! ```text
//! recordings --> tracks --> trials --> covariances --> CSP --> filters in int8
//!                  |                                              |
//!                  +--> levels, as a device computes them <-------+
//!                                  |
//!                                  v
//!                        ln(mean energy) --> linear discriminant --> classifier.toml
//! ```

mod coding_loss;
mod figures;
mod fit;
mod options;
mod sessions;
mod validation;

use crate::error::TrainerError;
use crate::people::People;
use crate::progress::ProgressObserver;
use artifact::classifier::Classifier;
use artifact::{Artifact, Description, ScalpGrid};
use fit::Plan;
use new_file::{Existing, NewFile};
use serde_json::{Value as Json, json};
use sessions::{Session, Start};
use std::fmt;
use std::io::Write as _;
use std::path::PathBuf;

pub(crate) use coding_loss::{ClassifierLossOptions, ClassifierLossTable, CodingLoss};
pub(crate) use figures::{chance, percent};
pub(crate) use options::ClassifyOptions;
pub(crate) use validation::Course;

/// A trained classifier, with further results for a report.
pub(crate) struct Trained {
    pub(crate) classifier: Classifier,
    /// File to which the classifier was written.
    path: PathBuf,
    /// For each class, the mean probability of that class around its event, from classifiers that
    /// were not trained on these trials.
    pub(crate) courses: Vec<Course>,
    /// Label of each electrode, and its cell of the scalp grid.
    pub(crate) electrodes: Vec<(String, [usize; 2])>,
}

/// Trains a classifier, writes it to a file, and returns it.
///
/// # Errors
/// If the recordings cannot be used or lack the events, there are too few trials, no device could
/// run the classifier, or its file cannot be written.
pub(crate) fn train(
    options: &ClassifyOptions,
    observer: &mut impl ProgressObserver,
) -> Result<Trained, TrainerError> {
    let folder = &options.artifact;
    let artifact = Artifact::read(folder).map_err(TrainerError::no_model(folder))?;
    let description = &artifact.description;
    let (filters, window_s) = (options.filters, options.window);
    let plan = Plan::new(&options.events, &options.task, filters, window_s, description)?;
    let selected = options.files.find()?;
    let inputs = [&selected.train[..], &selected.test].concat();
    let existing = Existing::from_force(options.force);
    let mut file = NewFile::create(&options.out, existing, &inputs)?;

    let mut read = |files, option| read(files, option, options, description, &plan, observer);
    let train = read(&selected.train, "--train")?;
    let test = read(&selected.test, "--test")?;
    plan.check_trials(&train)?;
    let folds = validation::folds(&train);
    let (cross_validation, courses) = validation::cross_validate(&plan, &train, &folds)?;
    let every_trial = train.iter().flat_map(Session::with_trials);
    let fitted = fit::fit(&plan, &every_trial.collect::<Vec<_>>())?;
    let mut classifier = fitted.classifier.clone();
    let training = &mut classifier.training;
    [training.train_files, _] = selected.names();
    training.trial_s = options.task.trial;
    training.trials = plan.counts(&train);
    training.cross_validation = Some(cross_validation);
    if plan.counts(&test).iter().any(|&trials| trials > 0) {
        let decided = validation::decide_sessions(&fitted, &test);
        training.test = Some(figures::figures(&decided, plan.classes().len()));
    }
    let mut write = || {
        file.write_all(classifier.to_toml()?.as_bytes()).map_err(TrainerError::file(&options.out))
    };
    write()?;
    file.finish()?;
    let (out, id) = (options.out.display(), classifier.id());
    observer.message(&format!("classifier {id:08x} written to {out}"));
    let grid = ScalpGrid::new(description);
    let columns = description.dimensions().columns;
    let cells = grid.cell_of_electrode().iter();
    let cells = cells.map(|cell| [cell / columns, cell % columns]);
    Ok(Trained {
        classifier,
        path: options.out.clone(),
        courses,
        electrodes: description.montage.electrodes.iter().cloned().zip(cells).collect(),
    })
}

/// Reads recordings with their trials, and interpolates bad electrodes.
fn read(
    files: &[PathBuf],
    option: &'static str,
    options: &ClassifyOptions,
    description: &Description,
    plan: &Plan,
    observer: &mut impl ProgressObserver,
) -> Result<Vec<Session>, TrainerError> {
    if files.is_empty() {
        return Ok(Vec::new());
    }
    let tracks = People::read(files, &options.files, description, observer)?.tracks;
    let start = Start::new(description, options.files.mains_hz, plan)?;
    sessions::read(files, &tracks, start, plan, option, observer)
}

impl Trained {
    pub(crate) fn to_json(&self) -> Json {
        let Classifier { decision, band, training, .. } = &self.classifier;
        json!({
            "id": format!("{:08x}", self.classifier.id()),
            "file": self.path,
            "classes": decision.classes,
            "band_hz": band.hz,
            "filters": self.classifier.filters.len(),
            "window_hops": decision.window_hops,
            "training": training,
        })
    }
}

impl fmt::Display for Trained {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Classifier { decision, training, .. } = &self.classifier;
        let classes = decision.classes.iter().zip(&training.trials);
        let classes = classes.map(|(class, trials)| format!("{trials} of {}", class.event));
        let classes = classes.collect::<Vec<_>>().join(", ");
        writeln!(f, "trials: {classes}")?;
        let labels: Vec<&str> = decision.classes.iter().map(|class| class.event.as_str()).collect();
        let cross_validation = training.cross_validation.iter();
        let cross_validation = cross_validation.map(|figures| ("each left out in turn", figures));
        for (title, part) in cross_validation.chain(training.test.iter().map(|f| ("test", f))) {
            figures::write(f, title, &labels, part)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;

//! The subcommand `calibrate`: fits a packed model to a person, and on request also a linear code.
//! The signal comes from a device or from recordings.
//!
//! ```text
//! device ──filtered steps──► Listening ─┐
//! recordings ──► Track ─────────────────┴► GoodSignal ──► PersonalModel, PersonalCode ──► folder
//!                                                                                  │
//! device ◄────────────────────────────── upload ───────────────────────────────────┘
//! ```

mod display;
mod listening;

use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use artifact::{Artifact, ModelId, Person, TrainingCard};
use bridge_core::{Announcement, Core, Device, Effects, Model, Settings, Upload};
use indicatif::ProgressBar;
use jiff::Timestamp;
use link::Streams;
use neuro_ros::NeuroFrame;
use packed_fit::{FitError, GoodSignal, PersonalCode, PersonalModel, Track, error_at};
use tokio::sync::oneshot::{self, Receiver, error::TryRecvError};
use tokio::time::Instant;

use crate::app::calibrate::display::Display;
use crate::app::calibrate::listening::Listening;
use crate::app::command_line::{CalibrateOptions, PortOptions};
use crate::app::driver::{Driver, PortEffects};
use crate::app::shutdown::Shutdown;
use crate::error::BridgeError;
use crate::subject_models::{NewModel, SubjectModels};
use crate::wire::connection::Connection;

/// Time limit for an upload and the device's answer. An upload takes up to 3 s at 921,600 baud, and
/// lost frames are sent again after 0.5 s.
const UPLOAD_TIMEOUT: Duration = Duration::from_secs(30);
/// Number of codes or packed blocks (5 s of them). A device that has sent this many, but no
/// filtered steps, is taken to refuse filtered steps.
const HOPS_WITHOUT_STEPS: u64 = 80;
/// Interval at which the user is shown the quality of the signal.
const SHOW_INTERVAL: Duration = Duration::from_secs(1);
/// Rates of the packed code that the summary shows.
const RATES: [usize; 7] = [0, 2, 3, 4, 5, 6, 8];

/// A person's model in its folder. Its display form is the report for the user.
#[derive(Debug)]
pub(super) struct Calibrated {
    personal: PersonalModel,
    /// Errors (PRD, percent root-mean-square difference) on the last quarter of the signal: of the
    /// person's linear code, and of the base model's code. `None` if no linear code was fitted.
    code_errors: Option<[f64; 2]>,
    id: ModelId,
    other: ModelId,
    folder: PathBuf,
    /// Command-line options that make the bridge use the model.
    usage: String,
}

/// Fits a model to the person whom `options` name, and writes it to a folder. Also uploads it to
/// the device, unless recordings were used.
///
/// # Errors
///
/// [`BridgeError`] if there is too little good signal, the device or a file cannot be used, or the
/// user interrupts. The model is then not written, unless only its upload has failed.
pub(super) async fn calibrate(options: CalibrateOptions) -> Result<Calibrated, BridgeError> {
    let mut shutdown = Shutdown::new()?;
    let base = Model::artifact(options.model.as_deref()).map_err(BridgeError::Model)?;
    let Some(other) = base.packed.clone() else {
        return Err(BridgeError::NothingToCalibrate(base.id));
    };
    if options.numbers && !base.description.mode.has_shortcut() {
        return Err(BridgeError::NoLinearMap(base.id));
    }
    let subject = &options.subject;
    let (folder, usage) = if let Some(folder) = &options.output {
        let usage = format!("--upload-model {}", folder.display());
        (folder.clone(), usage)
    } else {
        let models = SubjectModels::of_user(|name| std::env::var_os(name))?;
        let folder = models.new_folder(subject, Timestamp::now());
        (folder, format!("--subject {subject}"))
    };
    let new_model = NewModel::new(folder)?;
    let labels = &base.description.montage.electrodes;
    let wanted = usize::try_from(options.seconds).expect("at most an hour");
    let (mut signal, sources) = if options.recording.is_empty() {
        let signal = listen(&options, &base, wanted, &mut shutdown).await?;
        let date = Timestamp::now().strftime("%Y-%m-%d %H:%M UTC");
        (signal, vec![format!("the device's signal, {date}")])
    } else {
        let (options, base) = (options.clone(), base.clone());
        let reading = move || read(&options, &base);
        working("reading the recordings", reading, &mut shutdown).await?
    };
    if signal.seconds() < wanted {
        return Err(BridgeError::TooLittleSignal {
            good: signal.seconds(),
            judged: signal.judged,
            wanted,
            bad: bad_words(&signal, labels),
        });
    }
    signal.truncate(wanted);
    warn_about_bad(&signal, labels);
    let person = person(subject, &signal, labels);
    let network_card = network_card(&signal, &sources, &person, options.mains);
    let (id, numbers, weight) = (base.id, options.numbers, options.weight);
    let fitting = move || {
        let mut report = |text: &str| tracing::debug!("{text}");
        let personal = PersonalModel::new(&signal, &base.description, &other, weight, &mut report)?;
        let code = numbers.then(|| PersonalCode::new(&signal, &base)).transpose()?;
        Ok((base, personal, code))
    };
    let (base, mut personal, code) = working("fitting the model", fitting, &mut shutdown).await?;
    let card = &mut personal.model.description.training;
    card.train_files = sources;
    card.people = vec![person];
    let code_errors = code.as_ref().map(|code| [code.own_prd, code.other_prd]);
    let network = code.map_or(base, |mut code| {
        code.model.description.training = network_card;
        code.model
    });
    let artifact = network.with_packed(Some(personal.model.clone()));
    let artifact = artifact.map_err(BridgeError::Model)?;
    let folder = new_model.write(&artifact)?;
    let calibrated =
        Calibrated { personal, code_errors, id: artifact.id, other: id, folder, usage };
    calibrated.warn_if_worse();
    if options.recording.is_empty()
        && let Err(error) = give(&options.at, &artifact, &mut shutdown).await
    {
        new_file::print(&calibrated)?;
        return Err(error);
    }
    Ok(calibrated)
}

/// Runs `work` in another thread and shows a spinner meanwhile. If the user interrupts, returns an
/// error without waiting for the result.
async fn working<T: Send + 'static>(
    what: &'static str,
    work: impl FnOnce() -> Result<T, BridgeError> + Send + 'static,
    shutdown: &mut Shutdown,
) -> Result<T, BridgeError> {
    let spinner = ProgressBar::new_spinner().with_message(what);
    spinner.enable_steady_tick(Core::TICK);
    tracing::info!("{what}");
    let done = tokio::select! {
        done = tokio::task::spawn_blocking(work) => match done {
            Ok(done) => done,
            // A join error means that the work has panicked, because the work is never cancelled.
            Err(error) => std::panic::resume_unwind(error.into_panic()),
        },
        _ = shutdown.requested() => return Err(BridgeError::Interrupted),
    };
    spinner.finish_and_clear();
    done
}

/// Reads the recordings; returns their good signal and their names.
///
/// # Errors
///
/// [`BridgeError`] if a recording cannot be read, or lacks more than a quarter of the electrodes.
fn read(
    options: &CalibrateOptions,
    base: &Artifact,
) -> Result<(GoodSignal, Vec<String>), BridgeError> {
    let mains_hz = options.mains.unwrap_or_default().into();
    let tracks = options.recording.iter().map(|file| {
        let (track, warnings) = Track::read(file, &base.description, mains_hz)?;
        tracing::info!("{track}");
        for warning in warnings {
            tracing::warn!("{}: {warning}", track.name);
        }
        Ok(track)
    });
    let tracks: Vec<Track> = tracks.collect::<Result<_, FitError>>()?;
    let electrodes = base.description.montage.electrodes.len();
    let lacks_many = |track: &&Track| 4 * track.interpolated.len() > electrodes;
    if let Some(track) = tracks.iter().find(lacks_many) {
        return Err(BridgeError::OtherElectrodes {
            name: track.name.clone(),
            lacking: track.interpolated.len(),
            electrodes,
        });
    }
    for track in tracks.iter().filter(|track| !track.interpolated.is_empty()) {
        tracing::warn!(
            "{} lacks {}: the model is fitted to their interpolation, and has a larger error on a device that \
             measures them",
            track.name,
            track.interpolated.join(" ")
        );
    }
    let names = tracks.iter().map(|track| track.name.clone()).collect();
    let labels = &base.description.montage.electrodes;
    Ok((GoodSignal::select(&tracks, labels), names))
}

/// Listens to the device until it has sent `wanted` seconds of good signal, then stops it.
async fn listen(
    options: &CalibrateOptions,
    base: &Artifact,
    wanted: usize,
    shutdown: &mut Shutdown,
) -> Result<GoodSignal, BridgeError> {
    let settings = Settings {
        streams: Streams::PACKED | Streams::FILTERED,
        mains_hz: options.mains.unwrap_or(0),
        ..Settings::default()
    };
    let model = Model::new(base).map_err(BridgeError::Model)?;
    let connection = Connection::new(options.at.port.clone(), options.at.baud);
    let mut driver = Driver::new(Core::new(settings, None), connection);
    driver.core.require_slot(options.numbers);
    let mut port = Port::default();
    let labels = &base.description.montage.electrodes;
    let mut display = Display::new(&base.description, wanted);
    let mut shown = Instant::now();
    let mut signal = GoodSignal::default();
    // Judge the signal in another thread: the port must be read meanwhile, and judging takes longer
    // as the signal grows.
    let mut judging: Option<Receiver<GoodSignal>> = None;
    let mut judged = 0;
    let ended = run(&mut driver, &mut port, shutdown, |core, port| {
        if let Some(device) = &port.device {
            let board = device.board.clone();
            if !model.fits(device) {
                return Err(BridgeError::OtherMontage(board));
            }
            if core.lacks_slot() {
                return Err(if options.numbers {
                    BridgeError::NoNumbers(board)
                } else {
                    BridgeError::NoSlot(board)
                });
            }
        }
        let (summary, steps) = (core.summary(), port.listening.steps);
        let hops = summary.received + summary.packed.received;
        if steps == 0 && hops >= HOPS_WITHOUT_STEPS {
            return Err(BridgeError::NoFilteredSteps);
        }
        if let Some(receiver) = &mut judging {
            match receiver.try_recv() {
                Ok(new) => {
                    signal = new;
                    judging = None;
                }
                Err(TryRecvError::Empty) => {}
                Err(TryRecvError::Closed) => panic!("judging the signal has panicked"),
            }
        }
        let seconds = port.listening.seconds();
        if judging.is_none() && seconds != judged {
            judged = seconds;
            let (sender, receiver) = oneshot::channel();
            let (stretches, labels) = (port.listening.stretches.clone(), labels.clone());
            tokio::task::spawn_blocking(move || {
                let _ = sender.send(GoodSignal::select(&stretches, &labels));
            });
            judging = Some(receiver);
        }
        if shown.elapsed() >= SHOW_INTERVAL {
            shown = Instant::now();
            let faults = core.electrode_faults();
            display.show(&signal, &port.listening, faults.as_deref());
        }
        Ok(signal.seconds() >= wanted)
    });
    let ended = ended.await;
    display.finish();
    let good = signal.seconds();
    let bad = bad_words(&signal, labels) + &port.listening.unusable_words();
    tracing::info!("{good} of {wanted} s of good signal{bad}");
    tracing::info!("{}", driver.core.summary());
    ended.map(|()| signal)
}

/// Uploads the model to the device, which uses the model until the device restarts.
async fn give(
    at: &PortOptions,
    artifact: &Artifact,
    shutdown: &mut Shutdown,
) -> Result<(), BridgeError> {
    let model = Arc::new(Model::new(artifact).map_err(BridgeError::Model)?);
    let bytes = model_gen::upload(artifact).map_err(BridgeError::Upload)?;
    let bytes = bytes.ok_or(BridgeError::NothingToCalibrate(artifact.id))?;
    let settings = Settings { streams: Streams::PACKED, ..Settings::default() };
    let mut core = Core::new(settings, Some(model));
    core.set_upload(Upload::new(artifact.id.0, bytes.into()));
    let mut driver = Driver::new(core, Connection::new(at.port.clone(), at.baud));
    let mut port = Port::default();
    let end = Instant::now() + UPLOAD_TIMEOUT;
    let given = run(&mut driver, &mut port, shutdown, |_, port| {
        Ok(port.device.is_some() || Instant::now() >= end)
    });
    given.await.map_err(|error| match error {
        BridgeError::Interrupted => BridgeError::InterruptedUpload,
        error => error,
    })?;
    let device = port.device.filter(|device| device.model_id == artifact.id.0);
    device.map(|_| ()).ok_or(BridgeError::NotGiven)
}

/// Drives the core until `is_done` returns true, then stops the device. Calls `is_done` every
/// [`Core::TICK`].
///
/// # Errors
///
/// [`BridgeError::Interrupted`], the error of `is_done`, or an error of the port.
async fn run(
    driver: &mut Driver<Connection>,
    port: &mut Port,
    shutdown: &mut Shutdown,
    mut is_done: impl FnMut(&mut Core, &Port) -> Result<bool, BridgeError>,
) -> Result<(), BridgeError> {
    let mut outcome = Ok(());
    loop {
        let ending = tokio::select! {
            event = driver.next(port, false) => match event? {
                None if !driver.is_ending() => is_done(&mut driver.core, port),
                _ => Ok(false),
            },
            _ = shutdown.requested(), if !driver.is_ending() => Err(BridgeError::Interrupted),
        };
        if !matches!(ending, Ok(false)) {
            outcome = ending.map(|_| ());
            driver.end(port);
        }
        if driver.has_ended() {
            return outcome;
        }
    }
}

/// Handles the effects of the core that this subcommand needs: bytes for the device, and filtered
/// steps.
#[derive(Default)]
struct Port {
    outgoing: Vec<u8>,
    device: Option<Arc<Device>>,
    listening: Listening,
}

impl PortEffects for Port {
    fn outgoing(&mut self) -> &mut Vec<u8> {
        &mut self.outgoing
    }
}

impl Effects for Port {
    fn send(&mut self, frame: &[u8]) {
        self.outgoing.extend_from_slice(frame);
    }

    fn announce(&mut self, announcement: &Announcement) {
        self.device = Some(Arc::clone(&announcement.device));
    }

    fn publish_filtered(&mut self, frame: &NeuroFrame) {
        self.listening.receive(frame);
    }
}

/// Returns the entries about the person for the model's training card.
fn person(subject: &str, signal: &GoodSignal, labels: &[String]) -> Person {
    let values = signal.tracks.iter().flat_map(|track| &track.values);
    let energy: f64 = values.clone().map(|uv| f64::from(*uv).powi(2)).sum();
    let count = u32::try_from(values.count().max(1)).unwrap_or(u32::MAX);
    let bad = signal.always_bad().map(|at| labels[at].clone());
    Person {
        subject: subject.to_owned(),
        sd_uv: (energy / f64::from(count)).sqrt(),
        bad: bad.collect(),
    }
}

/// Returns the training card of a linear code that was fitted to a person.
fn network_card(
    signal: &GoodSignal,
    sources: &[String],
    person: &Person,
    mains_hz: Option<u8>,
) -> TrainingCard {
    let mut interpolated: Vec<String> = Vec::new();
    for label in signal.tracks.iter().flat_map(|track| &track.interpolated) {
        if !interpolated.contains(label) {
            interpolated.push(label.clone());
        }
    }
    TrainingCard {
        real_electrodes: signal.bad_seconds.len() - interpolated.len(),
        interpolated_electrodes: interpolated.len(),
        interpolated,
        note: format!(
            "fitted to {} s of good signal by corticode-bridge calibrate",
            signal.seconds()
        ),
        train_files: sources.to_vec(),
        mains_hz: mains_hz.unwrap_or_default().into(),
        people: vec![person.clone()],
        ..TrainingCard::default()
    }
}

/// Returns the part of an error message that lists the bad electrodes; empty if none was bad.
fn bad_words(signal: &GoodSignal, labels: &[String]) -> String {
    let bad = signal.bad_seconds.iter().zip(labels);
    let bad = bad.filter(|(seconds, _)| **seconds > 0);
    let bad = bad.map(|(seconds, label)| format!("{label} {seconds} s"));
    let silent = (signal.silent > 0).then(|| format!("all electrodes {} s", signal.silent));
    let bad: Vec<String> = silent.into_iter().chain(bad).collect();
    if bad.is_empty() {
        return String::new();
    }
    format!("; bad were {}", bad.join(", "))
}

fn warn_about_bad(signal: &GoodSignal, labels: &[String]) {
    for at in signal.always_bad() {
        tracing::warn!(
            "electrode {} is bad in {} of {} s and is interpolated in the fit; check its contact, and calibrate \
             again once it is good",
            labels[at],
            signal.bad_seconds[at],
            signal.judged
        );
    }
}

impl Calibrated {
    /// Warns if the person's model has a larger error than the base model. Does not compare the
    /// packed errors of a weighted model: the weights raise its unweighted error on purpose.
    fn warn_if_worse(&self) {
        let is_weighted = self.personal.model.description.weight.is_some();
        let rate = usize::from(self.personal.model.description.rate);
        let is_packed_worse = self.personal.own.get(rate).is_some_and(|own| {
            !is_weighted
                && error_at(&self.personal.other, own.bits).is_some_and(|other| other < own.mse)
        });
        if is_packed_worse || self.code_errors.is_some_and(|[own, other]| other < own) {
            tracing::warn!(
                "on the last quarter of the signal, the model of the rest has a larger error than model {}: calibrate \
                 with more --seconds, or stream without it",
                self.other
            );
        }
    }
}

impl fmt::Display for Calibrated {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let PersonalModel { own, other, power, .. } = &self.personal;
        let prd = |mse: f64| format!("{:.1} %", 100.0 * (mse / power).sqrt());
        writeln!(
            f,
            "error (PRD) on the last quarter, of a model of the first three quarters, beside model {} at equal bits",
            self.other
        )?;
        writeln!(f, "rate   bits of a block      own    model {}", self.other)?;
        for figures in RATES.iter().filter_map(|rate| own.get(*rate)) {
            let other = error_at(other, figures.bits).map_or("-".to_owned(), prd);
            let (rate, bits, own) = (figures.rate, figures.bits, prd(figures.mse));
            writeln!(f, "{rate:>4} {bits:>17.1} {own:>8} {other:>25}")?;
        }
        let mut streams = " --streams packed";
        if let Some([own, other]) =
            self.code_errors.map(|errors| errors.map(|prd| format!("{prd:.1} %")))
        {
            writeln!(f, "numbers of /encoded {own:>11} {other:>25}")?;
            streams = "";
        }
        let folder = self.folder.display();
        writeln!(f, "model {} is in {folder}", self.id)?;
        writeln!(f, "to stream with it: corticode-bridge {}{streams}", self.usage)
    }
}

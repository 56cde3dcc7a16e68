//! The subcommand `impedance`: shows the impedance of the electrodes while the device measures it.

use std::io::{IsTerminal as _, Write as _};
use std::path::PathBuf;

use bridge_core::{Contact, Core, Effects, ImpedanceReport, Settings};
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use new_file::{Existing, NewFile};
use picture::scalp_map::{Place, ScalpMap, on_map};
use recordings::Position;

use crate::app::command_line::PortOptions;
use crate::app::driver::{Driver, PortEffects};
use crate::app::shutdown::Shutdown;
use crate::error::BridgeError;
use crate::wire::connection::Connection;

/// Show the impedance of every electrode in kilohms, measured once a second.
///
/// For use before a session: stops the streams of the device and lets a current of 6 nA flow
/// through every electrode. The table shows values below 5 kOhm in green, below 20 in yellow and
/// others in red, and `open` for an electrode that is disconnected. Ctrl-C ends the program; the
/// last table stays on the screen. To measure while codes stream, at 500 Hz or more, use the
/// bridge's option --impedance.
///
/// Exit status: 0 done, 2 an existing picture, 4 the device cannot measure.
#[derive(Args, Clone, Debug)]
pub(crate) struct ImpedanceOptions {
    #[command(flatten)]
    pub(crate) at: PortOptions,
    /// Resistance on the board in series with each electrode, ohms, which is subtracted
    #[arg(long, env = "CORTICODE_SERIES_OHMS", value_name = "OHMS", default_value_t = 0)]
    series_ohms: u32,
    /// End after this many measurements
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..))]
    measurements: Option<u32>,
    /// Print each measurement as a line of JSON instead of the table
    #[arg(long)]
    json: bool,
    /// Draw the last measurement as a map of the head, an SVG file that must not exist
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    /// Replace the picture if it exists
    #[arg(long, requires = "picture")]
    force: bool,
}

/// Shows impedances until the user interrupts or the number of `--measurements` is reached.
///
/// # Errors
///
/// [`BridgeError`] if the port or an output cannot be used, or the device cannot measure
/// impedances.
pub(super) async fn show(options: ImpedanceOptions) -> Result<(), BridgeError> {
    let mut shutdown = Shutdown::new()?;
    let existing = Existing::from_force(options.force);
    let create = |path: &PathBuf| NewFile::create(path, existing, &[]);
    let picture = options.picture.as_ref().map(create).transpose()?;
    let mut core = Core::new(Settings::default(), None);
    core.measure_impedance_alone(options.series_ohms);
    let connection = Connection::new(options.at.port.clone(), options.at.baud);
    let mut driver = Driver::new(core, connection);
    let mut view = View::new(options.json);
    let mut outcome = Ok(());
    while !driver.has_ended() {
        let ends = tokio::select! {
            event = driver.next(&mut view, false) => {
                event?;
                let is_enough = options.measurements.is_some_and(|wanted| view.measurements >= wanted);
                is_enough || view.failure.is_some()
            }
            _ = shutdown.requested(), if !driver.is_ending() => true,
        };
        if let Some(refusal) = driver.core.impedance_refusal() {
            outcome = Err(BridgeError::NoImpedance(refusal));
        }
        if (ends || outcome.is_err()) && !driver.is_ending() {
            driver.end(&mut view);
        }
    }
    view.table.finish_and_clear();
    if let Some(error) = view.failure {
        return Err(error);
    }
    outcome?;
    let Some(report) = &view.newest else {
        return Ok(());
    };
    if !options.json {
        new_file::print(format_args!("{}\n", painted(report)))?;
    }
    if let Some(picture) = picture {
        draw(report, picture)?;
    }
    Ok(())
}

/// Handles the effects of the core that this subcommand needs: bytes for the device, and
/// measurements for the user.
struct View {
    outgoing: Vec<u8>,
    json: bool,
    /// Shows the newest table in a terminal.
    table: ProgressBar,
    newest: Option<ImpedanceReport>,
    measurements: u32,
    /// Why a line of JSON could not be printed.
    failure: Option<BridgeError>,
}

impl View {
    fn new(json: bool) -> Self {
        let table = if json { ProgressBar::hidden() } else { ProgressBar::new_spinner() };
        table.set_style(ProgressStyle::with_template("{msg}").expect("the template is correct"));
        table.set_message("waiting for the first measurement");
        table.enable_steady_tick(Core::TICK);
        Self { outgoing: Vec::new(), json, table, newest: None, measurements: 0, failure: None }
    }
}

impl PortEffects for View {
    fn outgoing(&mut self) -> &mut Vec<u8> {
        &mut self.outgoing
    }
}

impl Effects for View {
    fn send(&mut self, frame: &[u8]) {
        self.outgoing.extend_from_slice(frame);
    }

    fn publish_impedance(&mut self, report: &ImpedanceReport) {
        self.measurements += 1;
        if self.json {
            self.failure = self.failure.take().or(print_line(report).err());
        } else {
            self.table.set_message(painted(report));
        }
        self.newest = Some(report.clone());
    }
}

fn print_line(report: &ImpedanceReport) -> Result<(), BridgeError> {
    let line = serde_json::to_string(report).map_err(std::io::Error::from)?;
    Ok(new_file::print(format_args!("{line}\n"))?)
}

/// Returns the table of impedances, in colours if stdout is a terminal.
fn painted(report: &ImpedanceReport) -> String {
    if !std::io::stdout().is_terminal() {
        return report.to_string();
    }
    report.table(|contact, cell| {
        let color = match contact {
            Contact::Good => 32,
            Contact::Fair => 33,
            Contact::Bad | Contact::Open | Contact::Implausible => 31,
        };
        format!("\x1b[{color}m{cell}\x1b[0m")
    })
}

/// Largest impedance that the picture distinguishes, in kilohms. Larger impedances and open
/// electrodes have the colour of this value.
const PICTURE_KOHM: f64 = 50.0;

/// Draws the electrodes whose labels have a position in the 10-20 system.
fn draw(report: &ImpedanceReport, mut file: NewFile) -> Result<(), BridgeError> {
    let places = report.electrodes.iter().filter_map(|one| {
        let Position { x, y, z } = Position::from_label(&one.electrode)?;
        let kohm = one.ohms.map(|ohms| f64::from(ohms) / 1000.0);
        Some(Place {
            label: format!("{} {}", one.electrode, one.kohm()),
            at: on_map([x, y, z]),
            value: kohm.unwrap_or(PICTURE_KOHM).min(PICTURE_KOHM),
            is_measured: true,
        })
    });
    let map = ScalpMap {
        places: places.collect(),
        title: "Impedance of each electrode".to_owned(),
        subtitle: format!(
            "kilohms; from {PICTURE_KOHM} on, and for open electrodes, the darkest colour"
        ),
        unit: "kOhm".to_owned(),
    };
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("impedance.svg");
    map.draw(&path)?;
    file.write_all(&std::fs::read(&path)?)?;
    Ok(file.finish()?)
}

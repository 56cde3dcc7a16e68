//! `cargo xtask qemu`: the application on an emulated microcontroller; in virtual time against
//! host-sim, or live for a bridge.

mod damage;
mod failures;
mod figures;
mod frames;
mod heard;
mod host;
mod input;
mod live;
mod pipes;
mod report;
mod restart;
mod script;
mod stages;
mod stall;
mod storm;
mod streams;
mod triggers;

use std::fs;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use clap::Args;

use self::damage::Damage;
use self::failures::Recovery;
use self::figures::MachineFigures;
use self::heard::Heard;
use self::input::Input;
use self::report::Report;
use self::restart::Restart;
use self::stall::Stall;
use self::storm::Storm;
use self::streams::AllStreams;
use crate::benchmark::emulator::{self, Image, MACHINES, Machine};
use crate::benchmark::{cannot_write, make_folder};
use crate::failure::Failure;

/// The package of the image, and the image.
const IMAGE: &str = "board-qemu";

/// One instruction lasts 2^4 ns of the machine's time: 62.5 million a second. At 168 MHz that is 2.7
/// cycles for each, where docs/real-time.md computes 1.6 for a code's. An idle machine skips to the
/// next interrupt.
const VIRTUAL_TIME: &str = "shift=4,sleep=off";
/// The same as a number, nanoseconds.
const INSTRUCTION_NS: u32 = 1 << 4;

/// Starting and ending QEMU on a loaded machine.
const PATIENCE: Duration = Duration::from_mins(1);

/// What the verb can be told.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct QemuOptions {
    /// Codes that each machine makes and that are compared.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(500..=100_000))]
    codes: u32,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
    /// Run in real time behind a TCP port, for a bridge, until Ctrl-C.
    #[arg(long, conflicts_with_all = ["codes", "json"])]
    live: bool,
    /// The TCP port of --live on 127.0.0.1.
    #[arg(long, default_value_t = 5555, requires = "live")]
    port: u16,
}

impl QemuOptions {
    /// In virtual time, as a table.
    pub(crate) const VIRTUAL: Self = Self {
        codes: 1000,
        json: false,
        live: false,
        port: 0,
    };
}

/// Runs the image on both machines and compares, or runs it live on the first.
///
/// # Errors
/// QEMU or the target is missing, the image does not build, run or end, or what it sends is not what
/// it should be; or the port is taken.
pub(crate) fn qemu(options: QemuOptions) -> Result<(), Failure> {
    if options.live {
        return live::run(options.port);
    }
    let input = Input::make(options.codes as usize)?;
    let expected = Heard::boots(&host::sent(&input.samples)?).swap_remove(0);
    let streams = streams::Expected::of(&input)?;
    let mut figures = Vec::new();
    for machine in MACHINES {
        let runs = run(machine, &input, &expected, &streams)?;
        figures.push(MachineFigures::new(machine, runs, &input, &expected));
    }
    let report = Report::new(&input, figures);
    if options.json {
        println!("{}", report.json());
    } else {
        print!("{report}");
    }
    for skipped in &report.skipped {
        eprintln!("SKIPPED: {skipped}");
    }
    report.judge()
}

/// What a machine did.
struct Runs {
    /// Two runs at once: what a loaded PC does to one must not show in the other.
    undisturbed: [Run; 2],
    /// Behind a port that is stuck for a while.
    stalled: Stall,
    /// With tasks that fail.
    failures: Vec<Recovery>,
    /// With a damaged model.
    damage: Damage,
    /// With everything that there is to send, and a trigger.
    streams: AllStreams,
    /// With a host that gives commands all the time.
    storm: Storm,
    /// With a host that changes its mind.
    restart: Restart,
}

/// A run in virtual time.
struct Run {
    /// What the UART sent.
    sent: Vec<u8>,
    /// What the image said at its end.
    said: Vec<String>,
    /// How long it took here.
    wall: Duration,
}

fn run(
    machine: Machine,
    input: &Input,
    expected: &Heard,
    streams: &streams::Expected,
) -> Result<Runs, Failure> {
    let image = Image::build(IMAGE, IMAGE, machine.features)?;
    let folder = image.target_folder().join("qemu").join(machine.name);
    make_folder(&folder)?;
    let samples = folder.join(input::FILE);
    fs::write(&samples, input.bytes()).map_err(|error| cannot_write(&samples, &error))?;
    let [first, second] = thread::scope(|scope| {
        ["first.uart", "second.uart"]
            .map(|uart| scope.spawn(|| run_once(&image, machine, &folder, uart, input)))
            .map(|run| {
                run.join()
                    .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            })
    });
    let undisturbed = [first?, second?];
    let wall = undisturbed[0].wall;
    let (streams, storm) = thread::scope(|scope| {
        let streams = scope.spawn(|| AllStreams::of(&image, machine, &folder, streams));
        let storm = Storm::of(&image, machine, &folder, input, expected);
        let streams = streams.join();
        let streams = streams.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        (streams, storm)
    });
    Ok(Runs {
        streams: streams?,
        storm: storm?,
        restart: Restart::of(&image, machine, &folder, input)?,
        stalled: Stall::of(&image, machine, &folder, input, expected, wall)?,
        failures: Recovery::of_every_failure(&image, machine, &folder, input, expected)?,
        damage: Damage::of(&image, machine, &folder, input)?,
        undisturbed,
    })
}

fn run_once(
    image: &Image,
    machine: Machine,
    folder: &Path,
    uart: &str,
    input: &Input,
) -> Result<Run, Failure> {
    // `start`: codes without a host, and the emulation ends with the file.
    let mut command = image.command(machine, folder, &[IMAGE, "start"]);
    command.args(["-icount", VIRTUAL_TIME]);
    command.args(["-serial", &format!("file:{uart}")]);
    let begin = Instant::now();
    // It says nothing before its end, and takes a tenth of the time that it emulates.
    let said = emulator::run_to_end(&mut command, PATIENCE + input.duration(), |_| ())?;
    let sent = folder.join(uart);
    Ok(Run {
        sent: fs::read(&sent).map_err(|error| cannot_write(&sent, &error))?,
        said,
        wall: begin.elapsed(),
    })
}

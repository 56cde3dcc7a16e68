//! The emulated boards, and runs of the firmware's application on them.

use std::fs;
use std::path::PathBuf;
use std::thread;
use std::time::{Duration, Instant};

use emulator::{EmulatorError, Image, MACHINES, Machine, Qemu, Uart, figures, installed};
use model::ADC_RATE_HZ;
use pipeline::Sample;
use serde::Serialize;

use crate::frames::Boot;
use crate::input;

/// Name of the application's package, and of the program in that package.
pub const APPLICATION: &str = "board-qemu";

/// Duration of an instruction in virtual time, as a power of two: 2^4 ns. This is 62.5 million
/// instructions per second, or 2.7 cycles per instruction at 168 MHz. A real board is faster:
/// docs/real-time.md computes 1.6 cycles per instruction for the encoding of a code.
pub const INSTRUCTION_SHIFT: u8 = 4;

/// An emulated board with the application's image, and the folder of one scenario.
#[derive(Debug)]
pub struct Board {
    /// The board that QEMU emulates, with its processor.
    pub machine: Machine,
    /// Image of the application that the board runs.
    pub image: Image,
    /// QEMU's working folder; the image reads and writes its files there.
    pub folder: PathBuf,
    /// Time limit for the image to print its next line: the duration of the samples, and a minute
    /// to start and end QEMU on a loaded machine. The image prints only at its end, and runs faster
    /// than real time.
    pub silence: Duration,
}

/// Returns both emulated machines. If QEMU or the compiler's target is missing, returns none and
/// reports the test named `test` as skipped.
///
/// # Panics
/// When QEMU or the target is missing and `CORTICODE_REQUIRE_ROS=1`.
pub fn machines(test: &str) -> impl Iterator<Item = Machine> + use<> {
    let count = if installed::available(test) { MACHINES.len() } else { 0 };
    MACHINES.into_iter().take(count).inspect(|machine| {
        println!("{}, {} (emulated)", machine.name, machine.core);
    })
}

/// Returns a board for each of the [`machines`], with a folder for `scenario` that contains
/// `samples` as a file.
///
/// The iterator builds a board's image when it returns the board. A scenario runs on one board
/// after the other, because the load of the PC affects the timing of the emulated UART.
///
/// # Panics
/// When the image does not build or the folder cannot be written, and when [`machines`] panics.
pub fn boards(scenario: &str, samples: &[Sample]) -> impl Iterator<Item = Board> {
    machines(&format!("{scenario} of the emulated application")).map(move |machine| {
        let image = or_panic(Image::build(APPLICATION, APPLICATION, machine.features));
        let folder = PathBuf::from("emulated").join(machine.name).join(scenario);
        let seconds = samples.len() / usize::from(ADC_RATE_HZ);
        let board = Board {
            machine,
            folder: or_panic(image.create_folder(folder)),
            image,
            silence: Duration::from_secs(60 + seconds as u64),
        };
        board.write(input::FILE, &input::to_bytes(samples));
        board
    })
}

/// Returns the value of a result, or panics with the error's message, which says what to do.
///
/// # Panics
/// When the result is an error.
pub fn or_panic<T>(result: Result<T, EmulatorError>) -> T {
    result.unwrap_or_else(|error| panic!("{error}"))
}

impl Board {
    /// Records measured figures under the name of this machine.
    ///
    /// # Panics
    /// When [`figures::record`] panics.
    pub fn record(&self, figures: &impl Serialize) {
        figures::record(Some(self.machine.name), figures);
    }

    /// Writes a file into the board's folder, in place of any file of the same name.
    ///
    /// # Panics
    /// When the file cannot be written.
    pub fn write(&self, name: &str, bytes: &[u8]) {
        let path = self.folder.join(name);
        // An earlier run may have left a named pipe at this path, and writing to the pipe would
        // block.
        let _ = fs::remove_file(&path);
        or_panic(fs::write(&path, bytes).map_err(EmulatorError::file(&path)));
    }

    /// Prepares QEMU to run the application with `arguments` in virtual time. The caller must
    /// connect the UART.
    pub fn qemu(&self, arguments: &[&str]) -> Qemu {
        let arguments = [&[APPLICATION], arguments].concat();
        let mut qemu = Qemu::new(&self.image, self.machine, &self.folder, &arguments);
        qemu.instruction_time(INSTRUCTION_SHIFT);
        qemu
    }

    /// Runs the image with `arguments` to its end. The UART's output goes to the folder's file
    /// `uart`.
    ///
    /// # Panics
    /// When QEMU fails.
    pub fn run(&self, arguments: &[&str], uart: &str) -> Run {
        let start = Instant::now();
        let mut qemu = self.qemu(arguments);
        let lines = or_panic(qemu.uart(Uart::File(uart)).run(self.silence, |_| ()));
        let path = self.folder.join(uart);
        Run {
            sent: or_panic(fs::read(&path).map_err(EmulatorError::file(&path))),
            lines,
            wall: start.elapsed(),
        }
    }

    /// Runs the image in two emulators at the same time, so that load of the PC interrupts the two
    /// runs at different instructions.
    ///
    /// # Panics
    /// When QEMU fails.
    pub fn run_twice(&self, arguments: &[&str]) -> [Run; 2] {
        thread::scope(|scope| {
            ["first.uart", "second.uart"]
                .map(|uart| scope.spawn(move || self.run(arguments, uart)))
                .map(|run| run.join().expect("QEMU runs to its end"))
        })
    }
}

/// What the image has sent and printed in one run.
#[derive(Debug)]
pub struct Run {
    /// All bytes that the UART has sent.
    pub sent: Vec<u8>,
    /// Lines that the image has printed through semihosting, in order.
    pub lines: Vec<String>,
    /// Duration of the run in real time.
    pub wall: Duration,
}

impl Run {
    /// Returns the number that the image printed at its end with the label `name`.
    ///
    /// # Panics
    /// When the image did not print it.
    pub fn printed(&self, name: &str) -> u64 {
        let words = self.lines.iter().find_map(|line| line.strip_prefix(name));
        let number = words.and_then(|words| words.trim().parse().ok());
        number.unwrap_or_else(|| panic!("the image printed no `{name}`: {:?}", self.lines))
    }

    /// Returns the number of overruns: the larger of the number that the image printed at its end
    /// and the number in the last `Stats`.
    pub fn overruns(&self, boot: &Boot) -> u64 {
        let reported = u64::from(boot.last_stats().overruns);
        self.printed("overruns").max(reported)
    }

    /// Checks that the board has acquired every sample, and that every frame arrived intact.
    ///
    /// # Panics
    /// When a sample was missed, or a frame was dropped, is missing or is damaged.
    pub fn assert_complete(&self, boot: &Boot, samples: usize) {
        assert_eq!(self.printed("samples"), samples as u64, "samples");
        assert_eq!(self.overruns(boot), 0, "overruns");
        assert_eq!(boot.last_stats().frames_dropped, 0, "frames dropped");
        assert_eq!(boot.missing, 0, "frames missing");
        assert_eq!(boot.damaged, [], "frames damaged");
    }
}

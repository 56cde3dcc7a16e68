//! Serves the port of a virtual board as a TCP port; `cargo xtask board h743 --live` starts this
//! program.
#![deny(unsafe_code)]

use std::io;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

use clap::Parser;
use virtual_board::{Cable, Converters, Image, Model, Setup, TcpPort, VirtualBoard, live};

/// Runs a firmware image on an emulated board and serves the board's port as a TCP port for a
/// bridge.
#[derive(Debug, Parser)]
#[command(version)]
struct Options {
    /// The board for which the image was built.
    board: Model,
    /// The image: the ELF file that `cargo flash` writes.
    #[arg(long)]
    image: PathBuf,
    /// The folder of the model with which the image was built; the model determines which
    /// converters the board has. The default is eight converters in a daisy chain at 512 Hz, as for
    /// the checked-in model.
    #[arg(long)]
    artifact: Option<PathBuf>,
    /// TCP port on 127.0.0.1 for the bridge (`--port tcp:127.0.0.1:5556`); 0 lets the system
    /// choose.
    #[arg(long, default_value_t = 5556)]
    port: u16,
    /// The cable to the host. The default is the cable that the board's default image uses: USB for
    /// the NUCLEO-H743ZI2, the UART for the others.
    #[arg(long)]
    cable: Option<Cable>,
    /// Seconds of virtual time to run; the default is to run until the program is stopped.
    #[arg(long)]
    seconds: Option<u64>,
}

/// Exit status after a wrong argument, for a missing image or for an occupied port.
const USAGE: u8 = 2;

fn main() -> ExitCode {
    let options = Options::parse();
    let model = options.board;
    let image = match Image::read(&options.image, model) {
        Ok(image) => image,
        Err(error) => return fail(USAGE, &error.to_string()),
    };
    let converters =
        options.artifact.map_or(Ok(Converters::EIGHT), |folder| Converters::of_model(&folder));
    let converters = match converters {
        Ok(converters) => converters,
        Err(error) => return fail(USAGE, &error.to_string()),
    };
    let mut tcp = match TcpPort::listen(options.port) {
        Ok(tcp) => tcp,
        Err(error) => {
            let port = options.port;
            let why = format!(
                "cannot listen at 127.0.0.1:{port}: {error}; another virtual board may use it: stop \
                 that board, or choose another port with `--port`"
            );
            return fail(USAGE, &why);
        }
    };
    let number = tcp.number().unwrap_or(options.port);
    println!("{model} with {} at tcp:127.0.0.1:{number}", image.path().display());
    println!("  corticode-bridge --port tcp:127.0.0.1:{number} --sink ndjson");
    let setup = Setup {
        converters,
        cable: options.cable.unwrap_or(model.facts().default_cable),
        ..Setup::default()
    };
    let mut board = VirtualBoard::power_on(model, &image, &setup);
    let never = AtomicBool::new(false);
    match live::run(&mut board, &mut tcp, options.seconds, &never, io::stderr()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => fail(1, &error.to_string()),
    }
}

fn fail(status: u8, why: &str) -> ExitCode {
    eprintln!("error: {why}");
    ExitCode::from(status)
}

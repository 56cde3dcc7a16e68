//! Serves the port of a virtual NUCLEO as a TCP port; `cargo xtask board h743 --live` starts this program.
#![deny(unsafe_code)]

use std::io;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

use clap::{Parser, ValueEnum};
use virtual_board::{Cable, Image, Model, Setup, TcpPort, VirtualBoard, live};

/// Runs a firmware image on an emulated board and serves the board's port as a TCP port for a bridge.
#[derive(Debug, Parser)]
#[command(version)]
struct Options {
    /// The board that the image is for.
    board: Board,
    /// The image: the ELF file that `cargo flash` writes.
    #[arg(long)]
    image: PathBuf,
    /// TCP port on 127.0.0.1 for the bridge (`--port tcp:127.0.0.1:5556`); 0 lets the system choose.
    #[arg(long, default_value_t = 5556)]
    port: u16,
    /// The cable to the host. The default is the cable that the board's default image uses: USB for the
    /// NUCLEO-H743ZI2, the UART for the NUCLEO-F446RE.
    #[arg(long)]
    cable: Option<CableOption>,
    /// Seconds of virtual time to run; the default is to run until the program is stopped.
    #[arg(long)]
    seconds: Option<u64>,
}

/// Values of the argument `board`.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Board {
    /// NUCLEO-H743ZI2.
    H743,
    /// NUCLEO-F446RE.
    F446,
}

/// Values of the option `--cable`.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum CableOption {
    /// The ST-LINK's cable, which carries the UART.
    Uart,
    /// A cable to the microcontroller's own USB port.
    Usb,
}

/// Exit status for a wrong argument, a missing image or an occupied port.
const USAGE: u8 = 2;

fn main() -> ExitCode {
    let options = Options::parse();
    let model = match options.board {
        Board::H743 => Model::H743,
        Board::F446 => Model::F446,
    };
    let image = match Image::read(&options.image, model) {
        Ok(image) => image,
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
    println!(
        "{model} with {} at tcp:127.0.0.1:{number}",
        image.path().display()
    );
    println!("  corticode-bridge --port tcp:127.0.0.1:{number} --sink ndjson");
    let cable = match options.cable {
        Some(CableOption::Uart) => Cable::Uart,
        Some(CableOption::Usb) => Cable::Usb,
        None => model.default_cable(),
    };
    let setup = Setup {
        cable,
        ..Setup::default()
    };
    let board = VirtualBoard::power_on(model, &image, &setup);
    let run = board.and_then(|mut board| {
        live::run(
            &mut board,
            &mut tcp,
            options.seconds,
            &AtomicBool::new(false),
            io::stderr(),
        )
    });
    match run {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => fail(1, &error.to_string()),
    }
}

fn fail(status: u8, why: &str) -> ExitCode {
    eprintln!("error: {why}");
    ExitCode::from(status)
}

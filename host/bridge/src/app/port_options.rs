//! Options that name the port.

use clap::Args;

use crate::wire::address::PortAddress;

/// Address and speed of the port; options of the bridge and of its subcommands.
#[derive(Clone, Debug, Args)]
pub(crate) struct PortOptions {
    /// Serial port, pseudoterminal, tcp:HOST:PORT, or auto: the only board on USB, or the one with a
    /// serial number, auto:SERIAL. The board is found again after it was unplugged; `ports` lists all
    #[arg(
        long,
        env = "CORTICODE_PORT",
        value_name = "PATH|tcp:HOST:PORT|auto",
        default_value = "auto"
    )]
    pub(crate) port: PortAddress,
    /// Baud rate of a serial port; USB and pseudoterminals ignore it
    #[arg(
        long,
        env = "CORTICODE_BAUD",
        default_value_t = 921_600,
        value_parser = clap::value_parser!(u32).range(1..)
    )]
    pub(crate) baud: u32,
}

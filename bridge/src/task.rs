//! What the command line asks for.

use std::ffi::OsString;

use clap::{CommandFactory, Error, FromArgMatches, Parser};
use link::ResetInto;

use crate::{Options, PortOptions};

/// What the command line asks for.
#[derive(Clone, Debug)]
pub enum Task {
    /// Without a subcommand: frames from the board.
    Bridge(Box<Options>),
    /// The device tests its converters.
    SelfTest(SelfTestOptions),
    /// The device starts anew.
    Reset(ResetOptions),
}

/// Let the device test its converters with their own signals, and print what it found.
///
/// Ends with 0 if everything is in order, 1 if not, 3 if nothing answers, 4 if the device refuses.
#[derive(Clone, Debug, Parser)]
#[command(name = "selftest")]
pub struct SelfTestOptions {
    /// Where the device is.
    #[command(flatten)]
    pub at: PortOptions,
    /// Print JSON in place of the table
    #[arg(long)]
    pub json: bool,
}

/// Let the device start anew, and say why it says that it did.
///
/// Ends with 0 when it is back (with --bootloader: when it has agreed), 3 if nothing answers, 4 if
/// the device refuses.
#[derive(Clone, Debug, Parser)]
#[command(name = "reset")]
pub struct ResetOptions {
    /// Where the device is.
    #[command(flatten)]
    pub at: PortOptions,
    /// Start the microcontroller's own loader, which takes new firmware over USB
    #[arg(long)]
    pub bootloader: bool,
}

impl ResetOptions {
    /// What the device shall start.
    pub fn starts(&self) -> ResetInto {
        if self.bootloader {
            ResetInto::Bootloader
        } else {
            ResetInto::Firmware
        }
    }
}

impl Task {
    /// What these arguments ask for; the first is the program's name.
    ///
    /// # Errors
    ///
    /// [`Error`], which prints itself: usage, or the help that was asked for.
    pub fn parse_from(arguments: impl IntoIterator<Item = OsString>) -> Result<Task, Error> {
        let mut command = Options::command()
            .args_conflicts_with_subcommands(true)
            .subcommand_negates_reqs(true)
            .subcommand(SelfTestOptions::command())
            .subcommand(ResetOptions::command());
        let matches = command.try_get_matches_from_mut(arguments)?;
        let task = match matches.subcommand() {
            Some(("selftest", of)) => SelfTestOptions::from_arg_matches(of).map(Task::SelfTest),
            Some((_, of)) => ResetOptions::from_arg_matches(of).map(Task::Reset),
            None => {
                Options::from_arg_matches(&matches).map(|options| Task::Bridge(Box::new(options)))
            }
        };
        task.map_err(|error| error.format(&mut command))
    }
}

//! The options that the command line and the environment set, before other sources add theirs.

use std::path::PathBuf;

use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Command, Error};

use crate::app::command_line::{CONFIG, SinkKind};

/// The options that the command line and the environment set, without the options from the
/// parameter server and the configuration file.
#[derive(Debug)]
pub(crate) struct GivenOptions {
    /// Parsed options of the subcommand, or of the bridge if there is no subcommand.
    matches: ArgMatches,
    /// Identifiers of all options that the subcommand, or the bridge without one, can have.
    known: Vec<String>,
    has_subcommand: bool,
}

impl GivenOptions {
    /// Parses the arguments of `command`; the first one is the program's name.
    ///
    /// # Errors
    ///
    /// [`Error`] for wrong usage or a request for help; [`Error::exit`] prints it.
    pub(crate) fn parse_from(
        mut command: Command,
        arguments: &[String],
    ) -> Result<GivenOptions, Error> {
        let matches = command.try_get_matches_from_mut(arguments)?;
        let ids = |command: &Command| -> Vec<String> {
            let ids = command.get_arguments().map(Arg::get_id);
            ids.map(ToString::to_string).collect()
        };
        Ok(match matches.subcommand() {
            Some((name, of)) => GivenOptions {
                known: command.find_subcommand(name).map_or(Vec::new(), ids),
                matches: of.clone(),
                has_subcommand: true,
            },
            None => GivenOptions { known: ids(&command), matches, has_subcommand: false },
        })
    }

    /// Returns whether the bridge shall stream to ROS: there is no subcommand, and ROS is an
    /// outlet.
    pub(crate) fn is_ros_bridge(&self) -> bool {
        let sinks = || self.matches.get_many::<SinkKind>("sink");
        let has_ros = || sinks().is_none_or(|mut sinks| sinks.any(|sink| *sink == SinkKind::Ros));
        !self.has_subcommand && has_ros()
    }

    /// Returns the address of the ROS master, if an option sets it.
    pub(crate) fn ros_master_uri(&self) -> Option<&String> {
        self.matches.get_one("ros_master_uri")
    }

    /// Returns the configuration file that an option or an environment variable names.
    pub(crate) fn config(&self) -> Option<&PathBuf> {
        self.matches.get_one(CONFIG)
    }

    /// Returns whether the subcommand, or the bridge without one, reads a configuration file.
    pub(crate) fn reads_config(&self) -> bool {
        self.knows(CONFIG)
    }

    /// Returns whether the subcommand, or the bridge without one, has the option `id`.
    pub(crate) fn knows(&self, id: &str) -> bool {
        self.known.iter().any(|known| known == id)
    }

    /// Returns whether the command line or the environment sets the option with identifier `id`.
    pub(crate) fn is_set(&self, id: &str) -> bool {
        let source = self.matches.value_source(id);
        matches!(source, Some(ValueSource::CommandLine | ValueSource::EnvVariable))
    }

    /// Returns `arguments` with the options `others` inserted after the names of the program and
    /// the subcommand. At the end, they could follow `--`, after which only file names are allowed.
    pub(crate) fn extend(
        &self,
        arguments: &[String],
        others: impl IntoIterator<Item = String>,
    ) -> Vec<String> {
        let names = if self.has_subcommand { 2 } else { 1 };
        let (names, rest) = arguments.split_at(names.min(arguments.len()));
        let names = names.iter().cloned();
        names.chain(others).chain(rest.iter().cloned()).collect()
    }
}

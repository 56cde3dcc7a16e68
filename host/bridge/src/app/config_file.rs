//! A TOML file with options, which all other sources of options override.

use std::any::TypeId;
use std::ffi::OsString;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

use clap::{Arg, Command, CommandFactory};
use thiserror::Error;
use toml::de::{DeTable, DeValue};

use crate::app::command_line::Options;
use crate::app::parameters::to_flag;
use crate::error::BridgeError;

/// Path of the configuration file relative to a configuration folder, such as `~/.config`.
const NAME: &str = "corticode/bridge.toml";

/// The options that a configuration file sets.
#[derive(Debug)]
pub(crate) struct ConfigFile {
    pub(crate) path: PathBuf,
    /// Pairs: identifier of an option, and the option as an argument `--name=value`.
    pub(crate) options: Vec<(String, String)>,
}

impl ConfigFile {
    /// Reads the file `named`; without a name, the first one that exists in the configuration
    /// folders, if any. `variable` returns the value of an environment variable.
    ///
    /// # Errors
    ///
    /// [`BridgeError::Config`] if the file cannot be read or contains anything but options.
    pub(crate) fn read(
        named: Option<&PathBuf>,
        variable: impl Fn(&str) -> Option<OsString>,
    ) -> Result<Option<ConfigFile>, BridgeError> {
        let in_folders = || places(variable).into_iter().find(|path| is_there(path));
        let Some(path) = named.cloned().or_else(in_folders) else {
            return Ok(None);
        };
        let text = std::fs::read_to_string(&path).map_err(ConfigError::Read);
        match text.and_then(|text| parse(&text)) {
            Ok(options) => Ok(Some(ConfigFile { path, options })),
            Err(source) => Err(BridgeError::Config(path, source)),
        }
    }
}

/// Returns whether a path exists. A path that this user may not look up counts as existing, because
/// reading it then fails with the reason.
fn is_there(path: &Path) -> bool {
    match path.try_exists() {
        Ok(exists) => exists,
        Err(error) => error.kind() != io::ErrorKind::NotADirectory,
    }
}

/// Returns the paths at which to look for a configuration file, the user's first, as the XDG Base
/// Directory Specification says.
fn places(variable: impl Fn(&str) -> Option<OsString>) -> Vec<PathBuf> {
    let absolute = |name: &str| {
        let path = variable(name).map(PathBuf::from);
        path.filter(|path| path.is_absolute())
    };
    let of_user =
        absolute("XDG_CONFIG_HOME").or_else(|| absolute("HOME").map(|home| home.join(".config")));
    let folders = of_user.into_iter().chain([PathBuf::from("/etc")]);
    folders.map(|folder| folder.join(NAME)).collect()
}

/// Returns the options that the text of a file sets, in the order of the text.
fn parse(text: &str) -> Result<Vec<(String, String)>, ConfigError> {
    let line_of = |span: Range<usize>| 1 + text[..span.start].matches('\n').count();
    let table = DeTable::parse(text).map_err(|error| ConfigError::Syntax {
        line: line_of(error.span().unwrap_or(0..0)),
        message: error.message().to_owned(),
    })?;
    let mut entries: Vec<_> = table.get_ref().iter().collect();
    entries.sort_by_key(|(key, _)| key.span().start);
    let command = Options::command();
    let mut options = Vec::new();
    for (key, value) in entries {
        let line = line_of(key.span());
        let key = key.get_ref().to_string();
        let mut known = command.get_arguments();
        let Some(option) = known.find(|option| option.get_id() == key.as_str()) else {
            let known = command.get_arguments();
            let known: Vec<&str> = known.map(|option| option.get_id().as_str()).collect();
            let known = known.join(", ");
            return Err(ConfigError::UnknownKey { line, key, known });
        };
        let Some(text) = to_text(option, value.get_ref()) else {
            let (expected, found) = (expected_type(option), value.get_ref().type_str());
            return Err(ConfigError::Type { line, key, expected, found });
        };
        let argument = to_flag(&key, &text);
        if let Err(message) = check(option, &argument) {
            return Err(ConfigError::Value { line, key, message });
        }
        options.push((key, argument));
    }
    Ok(options)
}

fn holds<T: 'static>(option: &Arg) -> bool {
    option.get_value_parser().type_id() == TypeId::of::<T>()
}

/// Returns an option's value as on the command line; `None` if the option needs another type.
fn to_text(option: &Arg, value: &DeValue<'_>) -> Option<String> {
    let is_number = holds::<u32>(option) || holds::<u8>(option);
    let is_list = option.get_value_delimiter().is_some();
    match value {
        DeValue::Integer(number) if is_number => {
            let number = i64::from_str_radix(number.as_str(), number.radix());
            Some(number.ok()?.to_string())
        }
        DeValue::Boolean(flag) if holds::<bool>(option) => Some(flag.to_string()),
        DeValue::String(text) if !is_number && !holds::<bool>(option) => Some(text.to_string()),
        DeValue::Array(items) if is_list => {
            let items = items.iter().map(|item| item.get_ref().as_str());
            Some(items.collect::<Option<Vec<&str>>>()?.join(","))
        }
        _ => None,
    }
}

/// Returns the type that an option's value must have, as an error message names it.
fn expected_type(option: &Arg) -> &'static str {
    if holds::<u32>(option) || holds::<u8>(option) {
        "an integer"
    } else if holds::<bool>(option) {
        "true or false"
    } else if option.get_value_delimiter().is_some() {
        "a string or an array of strings"
    } else {
        "a string"
    }
}

/// Checks that the option accepts the value in `argument`; the error says why it does not.
fn check(option: &Arg, argument: &str) -> Result<(), String> {
    let command = Command::new("config").arg(option.clone().required(false));
    let parsed = command.try_get_matches_from(["config", argument]);
    parsed.map(drop).map_err(|error| {
        let text = error.to_string();
        // Leave out the end of clap's message, a hint at `--help` that follows an empty line.
        let lines = text.lines().take_while(|line| !line.is_empty());
        let lines: Vec<&str> = lines.map(str::trim).collect();
        let message = lines.join(" ");
        message.trim_start_matches("error: ").to_owned()
    })
}

/// Reason why a configuration file cannot be used.
#[derive(Debug, Error)]
pub enum ConfigError {
    /// The operating system cannot read the file, or the file is not UTF-8.
    #[error("it cannot be read; check the path and the permissions")]
    Read(#[source] io::Error),
    /// The file is not TOML.
    #[error(
        "line {line}: {message}; write each option as in: port = \"/dev/ttyACM0\"; strings need \
         quotation marks"
    )]
    Syntax {
        /// Number of the line in the file, from 1.
        line: usize,
        /// Message of the TOML parser.
        message: String,
    },
    /// A key in the file is not the name of an option.
    #[error("line {line}: the key {key} is not known; known are {known}")]
    UnknownKey {
        /// Number of the line in the file, from 1.
        line: usize,
        /// Key that no option has.
        key: String,
        /// All keys that the file may have, separated by commas.
        known: String,
    },
    /// A value in the file has another type than its option.
    #[error("line {line}: {key} is of type {found}, and must be {expected}")]
    Type {
        /// Number of the line in the file, from 1.
        line: usize,
        /// Name of the option.
        key: String,
        /// Type of the value in the file, such as `string`.
        found: &'static str,
        /// Type that the option needs.
        expected: &'static str,
    },
    /// An option does not accept its value in the file.
    #[error("line {line}: {key}: {message}")]
    Value {
        /// Number of the line in the file, from 1.
        line: usize,
        /// Name of the option.
        key: String,
        /// Why the option refuses the value, and the values that it accepts.
        message: String,
    },
}

#[cfg(test)]
mod tests {
    use std::ffi::OsString;
    use std::path::Path;

    use super::{parse, places};

    #[test]
    fn values_of_every_type_become_arguments_in_the_order_of_the_file() {
        let text = "# of the left amplifier\nport = \"/dev/ttyACM0\"\nbaud = 115_200\n\
                low_latency = true\nstreams = [\"codes\", \"raw\"]\nmains = 0x32\n";
        let options = parse(text).unwrap();
        let arguments: Vec<&str> = options.iter().map(|(_, argument)| &**argument).collect();
        let expected = [
            "--port=/dev/ttyACM0",
            "--baud=115200",
            "--low-latency=true",
            "--streams=codes,raw",
            "--mains=50",
        ];
        assert_eq!(arguments, expected);
        assert_eq!(parse("").unwrap(), []);
    }

    #[test]
    fn an_error_names_line_key_and_remedy() {
        for (text, expected) in [
            ("\n\nport = ", "line 3: "),
            ("port = \"a\"\nport = \"b\"", "line 2: "),
            (
                "baud = 9600\n\nprot = \"x\"",
                "line 3: the key prot is not known; known are port, baud, ros_master_uri",
            ),
            ("[bridge]\nbaud = 9600", "line 1: the key bridge is not known"),
            ("baud = \"fast\"", "line 1: baud is of type string, and must be an integer"),
            ("port = 5", "line 1: port is of type integer, and must be a string"),
            ("streams = [1]", "must be a string or an array of strings"),
            ("low_latency = 1", "must be true or false"),
            ("mains = 55", "line 1: mains: invalid value '55'"),
            ("filler = \"most\"", "[possible values: last, zeros, off]"),
        ] {
            let error = parse(text).unwrap_err().to_string();
            assert!(error.contains(expected), "{text:?}: {error}");
        }
    }

    #[test]
    fn the_users_file_comes_before_that_of_the_machine() {
        let with = |variables: &[(&str, &str)]| {
            let find = |name: &str| {
                let found = variables.iter().find(|(known, _)| *known == name);
                found.map(|(_, value)| OsString::from(value))
            };
            places(find)
        };
        let machine = Path::new("/etc/corticode/bridge.toml");
        assert_eq!(with(&[]), [machine]);
        let home = ("HOME", "/home/ada");
        let in_home = Path::new("/home/ada/.config/corticode/bridge.toml");
        assert_eq!(with(&[home]), [in_home, machine]);
        // The XDG specification says that a relative path shall be ignored.
        let relative = ("XDG_CONFIG_HOME", "config");
        assert_eq!(with(&[home, relative]), [in_home, machine]);
        let folder = ("XDG_CONFIG_HOME", "/config");
        let in_folder = Path::new("/config/corticode/bridge.toml");
        assert_eq!(with(&[home, folder]), [in_folder, machine]);
    }
}

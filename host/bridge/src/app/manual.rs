//! The subcommands `man` and `completions`: manual pages and shell completion scripts.

use std::io;
use std::path::PathBuf;

use clap::{Args, Command, ValueHint};
use clap_complete::Shell;
use clap_mangen::Man;
use new_file::NewFileError;

use crate::error::BridgeError;

/// Print the manual page of the bridge, or write those of the bridge and all subcommands to a
/// folder.
///
/// To read the page: corticode-bridge man | man --local-file -
#[derive(Args, Clone, Debug)]
pub(crate) struct ManOptions {
    /// Folder to write corticode-bridge.1, corticode-bridge-record.1 and the others to; it is
    /// created if it does not exist, and pages in it are replaced
    #[arg(long, value_name = "FOLDER", value_hint = ValueHint::DirPath)]
    pub(crate) folder: Option<PathBuf>,
}

/// Writes the pages of a command line to the folder in `options`. Without a folder, returns the
/// page of the program itself.
///
/// # Errors
///
/// [`BridgeError::NewFile`] if the folder or a page cannot be written.
pub(crate) fn pages(options: &ManOptions, command: Command) -> Result<Vec<u8>, BridgeError> {
    let mut command = command.disable_help_subcommand(true);
    // Gives the subcommands' pages their full names, such as corticode-bridge-record.
    command.build();
    let Some(folder) = &options.folder else {
        let mut page = Vec::new();
        page_of(&command).render(&mut page)?;
        return Ok(page);
    };
    let written = || -> io::Result<()> {
        std::fs::create_dir_all(folder)?;
        for part in std::iter::once(&command).chain(command.get_subcommands()) {
            page_of(part).generate_to(folder)?;
        }
        Ok(())
    };
    written().map_err(|source| NewFileError::Create { path: folder.clone(), source })?;
    Ok(Vec::new())
}

fn page_of(command: &Command) -> Man {
    let program = concat!("corticode-bridge ", env!("CARGO_PKG_VERSION"));
    Man::new(command.clone()).source(program).manual("Corticode")
}

/// Print the script that completes options and subcommands in a shell.
///
/// In bash, for the current user: corticode-bridge completions bash >
/// ~/.local/share/bash-completion/completions/corticode-bridge
#[derive(Args, Clone, Debug)]
pub(crate) struct CompletionsOptions {
    /// Shell to print the script for
    #[arg(value_enum)]
    pub(crate) shell: Shell,
}

/// Returns the completion script of a command line for the shell in `options`.
pub(crate) fn script(options: &CompletionsOptions, mut command: Command) -> String {
    let name = command.get_name().to_owned();
    let mut script = Vec::new();
    clap_complete::generate(options.shell, &mut command, name, &mut script);
    let script = String::from_utf8_lossy(&script);
    // For a program whose name has a hyphen, clap_complete 4.6.11 makes a bash script that sets the
    // state `corticode__bridge__subcmd__record` and compares it with another spelling. Without this
    // replacement, subcommands would have no completion.
    script.replace("corticode__subcmd__bridge", "corticode__bridge")
}

//! The subcommand `completions`: prints a script that completes options in a shell.

use clap::{Command, Parser};
use clap_complete::Shell;

/// Print the script that completes options and subcommands in a shell.
///
/// In bash, for the current user: corticode-bridge completions bash >
/// ~/.local/share/bash-completion/completions/corticode-bridge
#[derive(Clone, Debug, Parser)]
#[command(name = "completions")]
pub(crate) struct CompletionsOptions {
    /// Shell to print the script for
    #[arg(value_enum)]
    pub(crate) shell: Shell,
}

/// Returns the script for a command line.
pub(crate) fn script(options: &CompletionsOptions, mut command: Command) -> String {
    let name = command.get_name().to_owned();
    let mut script = Vec::new();
    clap_complete::generate(options.shell, &mut command, name, &mut script);
    let script = String::from_utf8_lossy(&script);
    // For a program whose name has a hyphen, clap_complete 4.6.11 sets the state
    // `corticode__bridge__subcmd__record` in bash, and compares it with another spelling. Subcommands
    // would have no completion.
    script.replace("corticode__subcmd__bridge", "corticode__bridge")
}

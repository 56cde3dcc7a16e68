//! Python classes of ROS-Neuro's messages, generated as the build of a ROS workspace does.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::workspace;

/// Folder with genpy's code generators, as Debian installs them.
const GENERATORS: &str = "/usr/lib/genpy";

/// Generates the Python package `rosneuro_msgs` from the definitions in `ros/rosneuro_msgs/`, and
/// returns the folder for `PYTHONPATH`. The package needs this name, because rostopic and
/// rosservice look for a type only in the package that defines it.
///
/// # Panics
/// When genpy is missing or refuses a definition.
pub fn generate(folder: &Path) -> PathBuf {
    let python_path = folder.join("python");
    let package = python_path.join("rosneuro_msgs");
    let root = workspace::root().canonicalize().expect("a folder");
    let definitions = root.join("ros/rosneuro_msgs");
    for kind in ["msg", "srv"] {
        let output = package.join(kind);
        let mut files: Vec<PathBuf> = fs::read_dir(definitions.join(kind))
            .expect("the definitions")
            .map(|entry| entry.expect("an entry").path())
            .collect();
        files.sort();
        generator(kind, &output)
            .arg(format!("-Irosneuro_msgs:{}", definitions.join("msg").display()))
            .arg(format!("-Istd_msgs:{}", root.join("host/neuro-ros/foreign/std_msgs").display()))
            .args(files)
            .run();
        generator(kind, &output).arg("--initpy").run();
    }
    fs::write(package.join("__init__.py"), "").expect("the package folder is writable");
    python_path
}

/// Command line, under construction, for one of genpy's generators.
struct Generator(Command);

fn generator(kind: &str, output: &Path) -> Generator {
    let mut command = Command::new("/usr/bin/python3");
    command
        .arg(format!("{GENERATORS}/gen{kind}_py.py"))
        .args(["-p", "rosneuro_msgs", "-o"])
        .arg(output)
        .env_remove("PYTHONPATH");
    Generator(command)
}

impl Generator {
    fn arg(mut self, argument: impl AsRef<std::ffi::OsStr>) -> Self {
        self.0.arg(argument);
        self
    }

    fn args(mut self, arguments: Vec<PathBuf>) -> Self {
        self.0.args(arguments);
        self
    }

    fn run(mut self) {
        let output = self.0.output().expect("python3 starts");
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "genpy: {errors}");
    }
}

//! The systemd service has a valid unit file, and the unit confines the program.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use acceptance::{programs::programs, workspace};
use emulator::skip::skip_unless_required;

/// Largest exposure that `systemd-analyze security` may report, in tenths; 19 was measured, which
/// it rates "OK". Without the unit's lines after `DynamicUser`, it is 84.
const EXPOSURE_TENTHS: &str = "25";

#[test]
fn systemd_accepts_the_unit_and_finds_it_confined() {
    let analyze = Path::new("/usr/bin/systemd-analyze");
    if !analyze.exists() {
        skip_unless_required("systemd unit", "`apt-get install systemd`");
        return;
    }
    let unit = workspace::root().join("packaging/corticode-bridge.service");
    let unit = fs::read_to_string(unit).expect("the unit");
    // systemd-analyze checks that the program exists, so use the path of the built bridge.
    let installed = "ExecStart=/usr/bin/corticode-bridge\n";
    assert!(unit.contains(installed), "{unit}");
    let built = format!("ExecStart={}\n", programs().bridge.display());
    let unit = unit.replace(installed, &built);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("corticode-bridge.service");
    fs::write(&path, unit).expect("a file");

    let run = |words: &[&str]| -> Output {
        let mut command = Command::new(analyze);
        command.args(words).arg(&path).output().expect("it starts")
    };
    let verified = run(&["verify", "--man=no"]);
    let complaints = String::from_utf8_lossy(&verified.stderr).into_owned();
    let ours = complaints.contains("corticode");
    assert!(verified.status.success() && !ours, "{complaints}");
    let threshold = format!("--threshold={EXPOSURE_TENTHS}");
    let secured = run(&["security", "--offline=true", "--no-pager", &threshold]);
    let report = String::from_utf8_lossy(&secured.stdout).into_owned();
    assert!(secured.status.success(), "{report}");
    assert!(report.contains("Overall exposure level"), "{report}");
}

//! Installs the Debian package in a clean Debian 12, starts what it has installed, and removes it.

use std::env;
use std::fs;
use std::path::Path;
use std::process::Command;

use crate::command::{Failure, OrFail, run, succeeds};
use crate::deb::{folder, output};

const NEXT: &str = "read the output above; the root is in target/debian/root";
/// Log lines of a bridge that has neither board nor ROS master.
const EXPECTED: [&str; 3] = [
    "options from /etc/corticode/bridge.toml",
    "/dev/ttyACM0 does not open",
    "no ROS master answers",
];

/// Runs the check, or says why it is skipped. With `CORTICODE_REQUIRE_ROS=1` a skipped check is a failure.
pub(crate) fn check(package: &Path) -> Result<(), Failure> {
    let Err(why) = make_root() else {
        let checked = check_in(&folder().join("root"), package);
        if checked.is_ok() {
            let _ = fs::remove_dir_all(folder().join("root"));
        }
        return checked;
    };
    if env::var_os("CORTICODE_REQUIRE_ROS").is_some_and(|value| value == "1") {
        let next = "run it as root, with mmdebstrap and Debian's archive";
        return Err(Failure::missing("a clean Debian 12", why, next));
    }
    eprintln!("SKIPPED: the Debian package in a clean Debian 12: {why}");
    Ok(())
}

/// Unpacks a clean Debian 12 to `root`. It is fetched once and kept as an archive.
fn make_root() -> Result<(), String> {
    let id = Command::new("id").arg("-u").output();
    if !id.is_ok_and(|output| output.stdout == b"0\n") {
        return Err("chroot needs root".to_owned());
    }
    let archive = folder().join("bookworm.tar");
    if !archive.exists() {
        // mmdebstrap leaves a broken archive behind when it fails.
        let part = folder().join("part.tar");
        let mut fetch = Command::new("mmdebstrap");
        fetch
            .args(["--quiet", "--variant=minbase", "bookworm"])
            .arg(&part);
        let fetched = fetch.arg("http://deb.debian.org/debian").status();
        if !fetched.is_ok_and(|status| status.success()) {
            return Err("mmdebstrap is missing, or did not reach Debian's archive".to_owned());
        }
        fs::rename(part, &archive).map_err(|error| error.to_string())?;
    }
    let root = folder().join("root");
    let _ = fs::remove_dir_all(&root);
    fs::create_dir_all(&root).map_err(|error| error.to_string())?;
    let mut unpack = Command::new("tar");
    unpack
        .args(["--extract", "--file"])
        .arg(&archive)
        .arg("--directory")
        .arg(&root);
    if succeeds(&mut unpack) {
        Ok(())
    } else {
        Err("tar did not unpack bookworm.tar".to_owned())
    }
}

fn check_in(root: &Path, package: &Path) -> Result<(), Failure> {
    let chroot = |words: &str| {
        let mut command = Command::new("chroot");
        command.arg(root).args(["sh", "-ec", words]);
        command
    };
    let failed = |what: &str, why: String| Err(Failure::check(what, why, NEXT));
    fs::copy(package, root.join("package.deb"))
        .or_fail("copying the package", "is the disk full?")?;
    let list = "find / -xdev ! -path '/proc/*' ! -path '/sys/*' ! -path '/var/lib/dpkg/*' ! -path '/var/log/*' | sort";
    let before = output(&mut chroot(list))?;
    run(
        &mut chroot("dpkg --install /package.deb; dpkg --verify corticode-bridge"),
        NEXT,
    )?;
    let version = output(&mut chroot("corticode-bridge --version"))?;
    if !version.contains(env!("CARGO_PKG_VERSION")) {
        return failed("corticode-bridge --version", version);
    }

    // The command of the service, first with the configuration as installed, then with a port in it.
    let unit = fs::read_to_string(root.join("lib/systemd/system/corticode-bridge.service"))
        .or_fail("reading the unit", NEXT)?;
    let start = unit
        .lines()
        .find_map(|line| line.strip_prefix("ExecStart="));
    let start = start.unwrap_or("no ExecStart in the unit");
    let unset = chroot(&format!("{start} 2>&1"))
        .output()
        .or_fail("chroot", NEXT)?;
    let text = String::from_utf8_lossy(&unset.stdout).into_owned();
    if unset.status.code() != Some(2) || !text.contains("--port") {
        return failed("the service without a port", text);
    }
    // Ends the bridge by the signal of `systemctl stop`.
    let waiting = format!(
        "sed -i 's/^#port/port/' /etc/corticode/bridge.toml; timeout --preserve-status --signal=TERM 4 {start} 2>&1"
    );
    let text = output(&mut chroot(&waiting))?;
    if let Some(line) = EXPECTED.iter().find(|line| !text.contains(**line)) {
        return failed("the service with a port", format!("no {line:?} in {text}"));
    }

    run(
        &mut chroot("dpkg --remove corticode-bridge; test -f /etc/corticode/bridge.toml"),
        NEXT,
    )?;
    run(&mut chroot("dpkg --purge corticode-bridge"), NEXT)?;
    let after = output(&mut chroot(list))?;
    let left: Vec<&str> = after
        .lines()
        .filter(|file| !before.lines().any(|old| old == *file))
        .collect();
    let gone: Vec<&str> = before
        .lines()
        .filter(|file| !after.lines().any(|new| new == *file))
        .collect();
    if left.is_empty() && gone.is_empty() {
        eprintln!(
            "deb --check: installed, started and purged in a clean Debian 12 (chroot, no systemd)"
        );
        return Ok(());
    }
    failed(
        "dpkg --purge",
        format!("left: {left:?}; also removed: {gone:?}"),
    )
}

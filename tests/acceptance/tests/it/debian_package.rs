//! The Debian package installs in a clean Debian 12, its programs start there, and purging it
//! leaves no files; the service that it installs streams under systemd.
//!
//! The first test starts the service's command in a chroot. The second runs only in `cargo xtask
//! deb --check`, because it boots a container, which takes two minutes with the download.

use std::collections::BTreeSet;
use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Duration;

use acceptance::port::free_port;
use acceptance::printing::board_with;
use acceptance::process::Process;
use acceptance::programs::programs;
use emulator::skip::{skip_unless_required, skipped};

/// Environment variable with the path of the package to check. Without it, the test makes a package
/// of the bridge that the other tests start.
const PACKAGE: &str = "CORTICODE_DEB";
/// Lines that the bridge must log while it waits for a board and a ROS master.
const WAITING: [&str; 3] = [
    "options from /etc/corticode/bridge.toml",
    "no Corticode board is on USB",
    // The clean Debian has no /etc/hosts, so `localhost` does not resolve.
    "the host name localhost of ROS_MASTER_URI does not resolve",
];
/// Paths of files that the package must install.
const INSTALLED: [&str; 11] = [
    "/usr/bin/corticode-bridge",
    "/usr/bin/corticode-node",
    "/etc/security/limits.d/60-corticode.conf",
    "/lib/udev/rules.d/60-corticode.rules",
    "/lib/systemd/system/corticode-bridge.service",
    "/etc/corticode/bridge.toml",
    "/usr/share/corticode/ros2/ros2neuro_msgs/msg/NeuroFrame.msg",
    "/usr/share/corticode/ros2/corticode/launch/corticode.launch.py",
    "/usr/share/man/man1/corticode-bridge-record.1.gz",
    "/usr/share/bash-completion/completions/corticode-bridge",
    "/usr/share/doc/corticode-bridge/copyright",
];

/// Systemd unit in the container. It reports the state of the service after 8 s and again after a
/// start with an unknown option, and then ends the container.
const OBSERVER: &str = "[Unit]
After=corticode-bridge.service
[Service]
Type=oneshot
ExecStart=/bin/sh -c 'sleep 8; exec > /result 2>&1; journalctl -u corticode-bridge; \\
  pid=$$(systemctl show --value -p MainPID corticode-bridge); stat -c user=%%u /proc/$$pid; \\
  grep Groups /proc/$$pid/status; echo prot=1 > /etc/corticode/bridge.toml; systemctl restart corticode-bridge; \\
  sleep 7; systemctl show -p NRestarts,ExecMainStatus,Result corticode-bridge'
ExecStopPost=systemctl poweroff
[Install]
WantedBy=multi-user.target
";
/// Lines that [`OBSERVER`] must report: the service streams, its group is dialout, which has number
/// 20 in every Debian, and systemd does not restart it after exit status 2.
const OBSERVED: [&str; 5] = [
    "streaming codes",
    "registered with the ROS master",
    "Groups:\t20 ",
    "ExecMainStatus=2",
    "NRestarts=0",
];

#[test]
fn the_package_starts_in_a_clean_debian_and_purge_leaves_nothing() {
    let package = env::var_os(PACKAGE).map_or_else(pack, PathBuf::from);
    let folder = package.parent().expect("the folder of the package");
    let debian = match CleanDebian::unpack(folder, "bookworm", "dpkg") {
        Ok(Some(debian)) => debian,
        Ok(None) => return,
        Err(why) => {
            skip_unless_required("Debian package in a clean Debian", why);
            return;
        }
    };
    fs::copy(&package, debian.root.join("package.deb")).expect("space on the disk");
    let before = debian.files();
    debian.succeed("dpkg --install --force-unsafe-io /package.deb");
    assert_eq!(debian.succeed("dpkg --verify corticode-bridge"), "");
    for file in INSTALLED {
        debian.succeed(&format!("test -s {file}"));
    }
    let version = debian.succeed("corticode-bridge --version");
    assert!(version.starts_with("corticode-bridge "), "{version}");
    let version = debian.succeed("corticode-node --version");
    assert!(version.starts_with("corticode-node "), "{version}");

    let unit = debian.succeed("cat /lib/systemd/system/corticode-bridge.service");
    let start = unit.lines().find_map(|line| line.strip_prefix("ExecStart="));
    let start = start.expect("a command in the unit");
    debian.succeed("sed -i 's/^#mains/mains/' /etc/corticode/bridge.toml");
    let stopped = format!("timeout --preserve-status --signal=TERM 8 {start} 2>&1");
    let log = debian.succeed(&stopped);
    for line in WAITING {
        assert!(log.contains(line), "no {line:?} in {log}");
    }
    // An unknown option gives exit status 2, after which systemd does not restart the service.
    debian.succeed("echo 'prot = 1' >> /etc/corticode/bridge.toml");
    let refused = debian.run(start);
    let errors = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(2), "{errors}");
    assert!(errors.contains("prot"), "{errors}");

    debian.succeed("dpkg --remove corticode-bridge");
    debian.succeed("test -f /etc/corticode/bridge.toml");
    debian.succeed("dpkg --purge corticode-bridge");
    let after = debian.files();
    let left: Vec<_> = after.difference(&before).collect();
    let gone: Vec<_> = before.difference(&after).collect();
    assert!(left.is_empty() && gone.is_empty(), "left {left:?}, also removed {gone:?}");
}

#[test]
fn the_service_streams_under_systemd_and_stays_failed_after_wrong_usage() {
    let test = "systemd service in a container";
    let Some(package) = env::var_os(PACKAGE).map(PathBuf::from) else {
        skipped(test, "`cargo xtask deb --check` runs it");
        return;
    };
    let folder = package.parent().expect("the folder of the package");
    let systemd = "systemd,systemd-sysv,dbus";
    let debian = match CleanDebian::unpack(folder, "bookworm-systemd", systemd) {
        Ok(Some(debian)) => debian,
        Ok(None) => return,
        Err(why) => return skip_unless_required(test, why),
    };
    let container = |mode: &str| {
        let mut nspawn = Command::new("systemd-nspawn");
        nspawn.args(["--register=no", "--keep-unit", mode, "-D"]);
        nspawn.arg(&debian.root);
        nspawn
    };
    let probe = container("--pipe").arg("/bin/true").output();
    if !probe.is_ok_and(|probe| probe.status.success()) {
        let why = "no containers here; `apt-get install systemd-container`, as root";
        return skip_unless_required(test, why);
    }
    let logs = tempfile::tempdir().expect("a folder");
    let [board, master] = [0; 2].map(|_| free_port().expect("a free port"));
    let output = format!("tcp:127.0.0.1:{board}");
    let _board = board_with(logs.path(), &output, &["--realtime"]);
    let mut core = Command::new(&programs().bridge);
    core.args(["master", &format!("--bind=127.0.0.1:{master}")]);
    let _master = Process::start("master", &mut core, logs.path()).expect("the master starts");

    fs::copy(&package, debian.root.join("package.deb")).expect("space on the disk");
    debian.succeed("dpkg --install --force-unsafe-io /package.deb");
    let options = format!(
        "port = \"tcp:127.0.0.1:{board}\"\nros_master_uri = \"http://127.0.0.1:{master}/\"\n"
    );
    let write = |path: &str, text: &str| fs::write(debian.root.join(path), text);
    write("etc/corticode/bridge.toml", &options).expect("a file");
    write("etc/systemd/system/observer.service", OBSERVER).expect("a file");
    debian.succeed("systemctl enable observer corticode-bridge");
    let mut boot = container("--boot");
    let mut machine = Process::start("boot", boot.arg("--console=pipe"), logs.path())
        .expect("systemd-nspawn starts");
    machine.wait(Duration::from_mins(2));
    let result = fs::read_to_string(debian.root.join("result")).unwrap_or_default();
    for line in OBSERVED {
        assert!(result.contains(line), "no {line:?} in {result}\n{}", machine.log());
    }
    let user = result.lines().find_map(|line| line.strip_prefix("user="));
    let user: u32 = user.and_then(|user| user.parse().ok()).expect(&result);
    // Range of the user ids that systemd assigns for DynamicUser (systemd.exec(5)).
    assert!((61_184..=65_519).contains(&user), "{result}");
}

/// Makes a Debian package of the bridge that the tests start, and returns the package's path.
fn pack() -> PathBuf {
    let mut xtask = Command::new(&programs().xtask);
    xtask.args(["deb", "--program"]).arg(&programs().bridge);
    let packed = xtask.output().expect("xtask starts");
    let errors = String::from_utf8_lossy(&packed.stderr);
    assert!(packed.status.success(), "{errors}");
    let lines = String::from_utf8_lossy(&packed.stdout).into_owned();
    lines.lines().next_back().expect("the package's path").into()
}

/// An unpacked Debian 12 with the essential packages and those that a test asks for.
struct CleanDebian {
    root: PathBuf,
    _folder: tempfile::TempDir,
}

impl CleanDebian {
    /// Unpacks a clean Debian with `packages` from an archive in `folder`, which the first call
    /// downloads. If Debian's servers do not answer, reports the test as skipped and returns
    /// `None`. An error says why this machine cannot have a clean Debian.
    fn unpack(folder: &Path, name: &str, packages: &str) -> Result<Option<Self>, String> {
        let id = Command::new("id").arg("-u").output();
        if !id.is_ok_and(|output| output.stdout == b"0\n") {
            return Err("chroot needs root".to_owned());
        }
        let archive = folder.join(name).with_extension("tar");
        if !archive.exists() {
            // Download under a temporary name: mmdebstrap leaves a broken archive when it fails.
            let part = folder.join(format!("{name}.part.tar"));
            let mut fetch = Command::new("mmdebstrap");
            fetch.args(["--quiet", "--variant=essential", "--include", packages]);
            fetch.arg("bookworm");
            let fetched = fetch.arg(&part).output();
            let fetched = fetched.map_err(|_| "`apt-get install mmdebstrap`")?;
            if !fetched.status.success() {
                let errors = String::from_utf8_lossy(&fetched.stderr);
                skipped("Debian package in a clean Debian", format!("mmdebstrap: {errors}"));
                return Ok(None);
            }
            fs::rename(part, &archive).expect("a writable folder");
        }
        let folder = tempfile::tempdir_in(folder).expect("a folder");
        let root = folder.path().to_owned();
        let mut tar = Command::new("tar");
        tar.arg("--extract").arg("--file").arg(archive);
        let unpacked = tar.arg("--directory").arg(&root).output().expect("tar starts");
        let errors = String::from_utf8_lossy(&unpacked.stderr);
        assert!(unpacked.status.success(), "{errors}");
        Ok(Some(Self { root, _folder: folder }))
    }

    fn run(&self, words: &str) -> Output {
        let mut chroot = Command::new("chroot");
        chroot.arg(&self.root).args(["/bin/sh", "-ec", words]);
        chroot.env_clear().env("PATH", "/usr/sbin:/usr/bin:/sbin:/bin");
        chroot.output().expect("chroot starts")
    }

    /// Runs a command in the unpacked Debian that must succeed, and returns its standard output.
    fn succeed(&self, words: &str) -> String {
        let done = self.run(words);
        let errors = String::from_utf8_lossy(&done.stderr);
        assert!(done.status.success(), "{words}: {errors}");
        String::from_utf8_lossy(&done.stdout).into_owned()
    }

    /// Returns the paths of all files in the unpacked Debian except logs and dpkg's own records.
    fn files(&self) -> BTreeSet<String> {
        let all = self.succeed("find / -xdev ! -path '/var/lib/dpkg/*' ! -path '/var/log/*'");
        all.lines().map(str::to_owned).collect()
    }
}

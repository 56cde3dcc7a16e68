//! Checks who may open a port, and which programs have it open.

use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::{fs, io};

use rustix::fs::{Access, access};
use serde::Serialize;

use crate::ports::system_root::{SystemRoot, entries};

/// Whether this user can open a port. Found without opening it, as opening resets some devices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum PortAccess {
    /// The port can be opened.
    Free,
    /// Other programs have the port open.
    InUse(Vec<Program>),
    /// The permissions of the port exclude this user.
    Denied(Membership),
    /// The port cannot be opened for another reason, for example because it does not exist.
    Broken(io::ErrorKind),
}

/// Whether this user belongs to the group, if any, that may open the port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Membership {
    /// No group may open the port, only root.
    RootOnly,
    /// This user is not a member of the group that may open the port.
    Outsider { group: String },
    /// This user joined the group after logging in, which has no effect until the next login.
    FromNextLogin { group: String },
}

impl PortAccess {
    /// Returns what is wrong and the command that helps; `None` if the port can be opened.
    pub(crate) fn objection(&self, port: &Path) -> Option<(String, String)> {
        let port = port.display();
        Some(match self {
            PortAccess::Free => return None,
            PortAccess::InUse(programs) => {
                let remedies: Vec<String> = programs.iter().map(remedy).collect();
                let programs = names(programs);
                (format!("in use by {programs}"), remedies.join("; "))
            }
            PortAccess::Denied(Membership::RootOnly) => (
                "only root may open the port".to_owned(),
                format!(
                    "sudo chown $USER {port} (until it is plugged in again or the machine restarts; a udev rule \
                     lasts, and corticode-bridge ports --udev-rule prints that of a board on USB)"
                ),
            ),
            PortAccess::Denied(Membership::Outsider { group }) => (
                format!("this user is not in the group {group}"),
                format!("sudo usermod -aG {group} $USER, then log in again"),
            ),
            PortAccess::Denied(Membership::FromNextLogin { group }) => (
                format!("this session began before this user was in the group {group}"),
                format!("log out and in again, or: newgrp {group}"),
            ),
            PortAccess::Broken(kind) => (
                format!("cannot be opened: {kind}"),
                format!("plug the device in again, then: ls -l {port}"),
            ),
        })
    }
}

/// Returns the command that ends a program. `kill` does not end a service, because the service
/// manager starts the program again.
fn remedy(program: &Program) -> String {
    match program.name.as_str() {
        "ModemManager" => "sudo systemctl stop ModemManager".to_owned(),
        // Linux keeps only the first 15 characters of a program's name.
        "corticode-bridg" | "corticode-bridge" => format!(
            "sudo systemctl stop corticode-bridge, or outside the service: kill {}",
            program.pid
        ),
        _ => format!("kill {}", program.pid),
    }
}

fn names(programs: &[Program]) -> String {
    let name = |program: &Program| format!("{} (pid {})", program.name, program.pid);
    let names: Vec<String> = programs.iter().map(name).collect();
    names.join(", ")
}

impl SystemRoot {
    /// Returns whether this user can open the port. Does not open it.
    pub(crate) fn port_access(&self, port: &Path) -> PortAccess {
        match access(port, Access::READ_OK | Access::WRITE_OK) {
            Ok(()) => match self.holders(port) {
                holders if holders.is_empty() => PortAccess::Free,
                holders => PortAccess::InUse(holders),
            },
            Err(error) => match io::Error::from(error).kind() {
                io::ErrorKind::PermissionDenied => PortAccess::Denied(self.membership(port)),
                kind => PortAccess::Broken(kind),
            },
        }
    }

    /// Returns the group that may open the port, and whether this user is listed as a member.
    fn membership(&self, port: &Path) -> Membership {
        let Ok(metadata) = std::fs::metadata(port) else {
            return Membership::RootOnly;
        };
        let users = self.text("etc/passwd").unwrap_or_default();
        let groups = self.text("etc/group").unwrap_or_default();
        let user = user_name(&users, rustix::process::getuid().as_raw());
        membership(&groups, metadata.gid(), metadata.mode(), user)
    }
}

/// Returns the name of the user `uid`, from the text of `/etc/passwd`.
fn user_name(users: &str, uid: u32) -> Option<&str> {
    let mut lines = users.lines().map(|line| line.split(':'));
    lines.find_map(|mut fields| {
        let name = fields.next()?;
        (fields.nth(1)?.parse() == Ok(uid)).then_some(name)
    })
}

/// Returns whether a user who may not open the port belongs to the port's group. `groups` is the
/// text of `/etc/group`; `gid` and `mode` are the port's.
fn membership(groups: &str, gid: u32, mode: u32, user: Option<&str>) -> Membership {
    const GROUP_READ_WRITE: u32 = 0o060;
    let mut lines = groups.lines().map(|line| line.split(':'));
    let line = lines.find_map(|fields| {
        let fields: Vec<&str> = fields.collect();
        let is_wanted = fields.get(2)?.parse() == Ok(gid);
        is_wanted.then_some(fields)
    });
    let Some([group, _, _, members]) = line.as_deref() else {
        return Membership::RootOnly;
    };
    if gid == 0 || mode & GROUP_READ_WRITE != GROUP_READ_WRITE {
        return Membership::RootOnly;
    }
    let group = (*group).to_owned();
    if user.is_some_and(|user| members.split(',').any(|member| member == user)) {
        Membership::FromNextLogin { group }
    } else {
        Membership::Outsider { group }
    }
}

/// A program that is running.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub(crate) struct Program {
    pub(crate) pid: u32,
    pub(crate) name: String,
}

impl SystemRoot {
    /// Returns all running programs, including those of other users.
    pub(crate) fn programs(&self) -> Vec<Program> {
        let folders = entries(&self.path("proc"));
        let pids = folders.iter().filter_map(|folder| pid_of(folder));
        pids.map(|pid| self.program(pid)).collect()
    }

    /// Returns the other programs that have the port open. Programs of other users are visible only
    /// to root, unless they have locked the port, as the bridge does. On a pseudoterminal only
    /// programs with a lock count, because the program that created it may hold both ends open.
    pub(crate) fn holders(&self, port: &Path) -> Vec<Program> {
        let Ok(target) = fs::canonicalize(port) else {
            return Vec::new();
        };
        let is_pseudoterminal = target.starts_with(self.path("dev/pts"));
        let folders = entries(&self.path("proc"));
        let holders = folders.iter().filter_map(|folder| {
            let pid = pid_of(folder).filter(|_| !is_pseudoterminal)?;
            let mut files = entries(&folder.join("fd")).into_iter();
            let holds = files.any(|file| fs::read_link(file).is_ok_and(|file| file == target));
            holds.then_some(pid)
        });
        let mut pids: Vec<u32> = holders.chain(self.lockers(&target)).collect();
        pids.sort_unstable();
        pids.dedup();
        pids.retain(|pid| *pid != std::process::id());
        pids.into_iter().map(|pid| self.program(pid)).collect()
    }

    /// Returns the ids of the processes that hold a lock on the file, from `proc/locks`. In a line
    /// such as `1: FLOCK  ADVISORY  WRITE 1234 00:19:56 0 EOF`, 1234 is the process and 00:19:56
    /// the device and inode of the file.
    fn lockers(&self, file: &Path) -> Vec<u32> {
        let Ok(metadata) = fs::metadata(file) else {
            return Vec::new();
        };
        let locks = self.text("proc/locks").unwrap_or_default();
        let (device, inode) = (metadata.dev(), metadata.ino());
        let (major, minor) = (rustix::fs::major(device), rustix::fs::minor(device));
        let id = format!("{major:02x}:{minor:02x}:{inode}");
        let of_file = locks.lines().filter_map(|line| {
            let words: Vec<&str> = line.split_whitespace().collect();
            let place = words.iter().position(|word| *word == id)?;
            words.get(place.checked_sub(1)?)?.parse().ok()
        });
        of_file.collect()
    }

    fn program(&self, pid: u32) -> Program {
        let name = self.text(format!("proc/{pid}/comm")).unwrap_or_default();
        // The kernel cuts the name after 15 bytes; the command line has it in full.
        let command = self.text(format!("proc/{pid}/cmdline")).unwrap_or_default();
        let path = command.split('\0').next().unwrap_or_default();
        let full = path.rsplit('/').next().unwrap_or_default();
        let name = if full.starts_with(&name) { full } else { &name };
        Program { pid, name: if name.is_empty() { "unknown" } else { name }.to_owned() }
    }
}

fn pid_of(folder: &Path) -> Option<u32> {
    folder.file_name()?.to_str()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use super::{Membership, PortAccess, Program, SystemRoot, membership, names, user_name};

    const GROUPS: &str = "root:x:0:\ndialout:x:20:eve,ada\n";
    const USERS: &str = "root:x:0:0:root:/root:/bin/sh\nada:x:1000:1000::/home/ada:/bin/sh\n";

    fn remedy(access: &PortAccess) -> String {
        let (what, remedy) = access.objection(Path::new("/dev/ttyACM0")).unwrap();
        format!("{what}: {remedy}")
    }

    #[test]
    fn each_reason_for_a_denied_port_has_its_own_remedy() {
        assert_eq!(user_name(USERS, 1000), Some("ada"));
        assert_eq!(user_name(USERS, 1), None);
        let add = "not in the group dialout: sudo usermod -aG dialout $USER, then log in again";
        for (gid, mode, user, expected) in [
            (20, 0o20_660, Some("bob"), add),
            (20, 0o20_660, None, add),
            (20, 0o20_660, Some("ada"), "newgrp dialout"),
            (20, 0o20_600, Some("bob"), "sudo chown $USER /dev/ttyACM0"),
            (0, 0o20_660, Some("bob"), "sudo chown $USER /dev/ttyACM0"),
            (77, 0o20_660, Some("bob"), "sudo chown $USER /dev/ttyACM0"),
        ] {
            let denied = PortAccess::Denied(membership(GROUPS, gid, mode, user));
            assert!(remedy(&denied).contains(expected), "{}", remedy(&denied));
        }
        let member = membership(GROUPS, 20, 0o20_660, Some("ada"));
        let group = "dialout".to_owned();
        assert_eq!(member, Membership::FromNextLogin { group });
    }

    #[test]
    fn the_program_that_uses_a_port_is_named_with_the_command_that_ends_it() {
        let program = |pid, name: &str| Program { pid, name: name.to_owned() };
        let used = PortAccess::InUse(vec![program(7, "minicom"), program(9, "screen")]);
        let expected = "in use by minicom (pid 7), screen (pid 9): kill 7; kill 9";
        assert_eq!(remedy(&used), expected);
        for (name, expected) in [
            ("ModemManager", "sudo systemctl stop ModemManager"),
            ("corticode-bridge", "sudo systemctl stop corticode-bridge, or"),
        ] {
            let remedy = remedy(&PortAccess::InUse(vec![program(7, name)]));
            assert!(remedy.contains(expected), "{remedy}");
        }
        assert_eq!(PortAccess::Free.objection(Path::new("/dev/ttyACM0")), None);
    }

    #[test]
    fn a_program_that_has_the_port_open_or_locked_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let root = SystemRoot::new(folder.path());
        let port = root.path("ttyACM0");
        fs::write(&port, "").unwrap();
        let port = fs::canonicalize(&port).unwrap();
        for (pid, name) in [(41, "minicom\n"), (42, "bash\n")] {
            fs::create_dir_all(root.path(format!("proc/{pid}/fd"))).unwrap();
            fs::write(root.path(format!("proc/{pid}/comm")), name).unwrap();
        }
        std::os::unix::fs::symlink("/dev/null", root.path("proc/42/fd/0")).unwrap();
        assert!(root.holders(&port).is_empty());
        std::os::unix::fs::symlink(&port, root.path("proc/41/fd/3")).unwrap();
        let holders = || names(&root.holders(&port));
        assert_eq!(holders(), "minicom (pid 41)");
        fs::write(root.path("proc/41/cmdline"), "/usr/bin/minicom-2\0-D\0").unwrap();
        assert_eq!(holders(), "minicom-2 (pid 41)");
        fs::write(root.path("proc/41/cmdline"), "python3\0x.py\0").unwrap();
        // Use the line that /proc/locks has for a lock of this file, but with process 42 as the
        // holder.
        let file = fs::File::open(&port).unwrap();
        rustix::fs::flock(&file, rustix::fs::FlockOperation::LockExclusive).unwrap();
        let locked = SystemRoot::machine().text("proc/locks").unwrap_or_default();
        let own = std::process::id().to_string();
        assert!(locked.contains(&format!(" {own} ")), "{locked}");
        let locks = locked.replace(&format!(" {own} "), " 42 ");
        fs::write(root.path("proc/locks"), locks).unwrap();
        assert_eq!(holders(), "minicom (pid 41), bash (pid 42)");
    }
}

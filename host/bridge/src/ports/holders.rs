//! Programs that have a port open.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use serde::Serialize;

use crate::ports::system_root::{SystemRoot, entries};

/// A running program.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub(crate) struct Program {
    pub(crate) pid: u32,
    pub(crate) name: String,
}

impl SystemRoot {
    /// Returns the running programs.
    pub(crate) fn programs(&self) -> Vec<Program> {
        let folders = entries(&self.path("proc"));
        let pids = folders.iter().filter_map(|folder| pid_of(folder));
        pids.map(|pid| self.program(pid)).collect()
    }

    /// Returns the other programs that have the port open. Programs of other users are visible only
    /// to root, except those that have locked the port, as the bridge does. Of a pseudoterminal only
    /// these count, because the program that made a pseudoterminal may hold both ends open.
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

    /// Returns the processes that have locked the file, from lines of `proc/locks` such as
    /// `1: FLOCK  ADVISORY  WRITE 1234 00:19:56 0 EOF`: process, device, inode.
    fn lockers(&self, file: &Path) -> Vec<u32> {
        let Ok(inode) = fs::metadata(file).map(|metadata| metadata.ino()) else {
            return Vec::new();
        };
        let locks = self.text("proc/locks").unwrap_or_default();
        let device = fs::metadata(file)
            .map(|metadata| metadata.dev())
            .unwrap_or_default();
        let id = format!(
            "{:02x}:{:02x}:{inode}",
            rustix::fs::major(device),
            rustix::fs::minor(device)
        );
        let of_file = locks.lines().filter_map(|line| {
            let words: Vec<&str> = line.split_whitespace().collect();
            let place = words.iter().position(|word| *word == id)?;
            words.get(place.checked_sub(1)?)?.parse().ok()
        });
        of_file.collect()
    }

    fn program(&self, pid: u32) -> Program {
        let name = self.text(format!("proc/{pid}/comm")).unwrap_or_default();
        // The kernel cuts the name after 15 bytes; the command line has the rest.
        let command = self.text(format!("proc/{pid}/cmdline")).unwrap_or_default();
        let path = command.split('\0').next().unwrap_or_default();
        let full = path.rsplit('/').next().unwrap_or_default();
        let name = if full.starts_with(&name) { full } else { &name };
        Program {
            pid,
            name: if name.is_empty() { "unknown" } else { name }.to_owned(),
        }
    }
}

fn pid_of(folder: &Path) -> Option<u32> {
    folder.file_name()?.to_str()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::SystemRoot;

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
        let names = || {
            let holders = root.holders(&port);
            holders
                .into_iter()
                .map(|program| (program.pid, program.name))
                .collect::<Vec<_>>()
        };
        assert_eq!(names(), [(41, "minicom".to_owned())]);
        fs::write(root.path("proc/41/cmdline"), "/usr/bin/minicom-2\0-D\0").unwrap();
        assert_eq!(names(), [(41, "minicom-2".to_owned())]);
        fs::write(root.path("proc/41/cmdline"), "python3\0x.py\0").unwrap();
        // The kernel's own list of locks, with a lock of this file by process 42.
        let file = fs::File::open(&port).unwrap();
        rustix::fs::flock(&file, rustix::fs::FlockOperation::LockExclusive).unwrap();
        let locked = SystemRoot::machine().text("proc/locks").unwrap_or_default();
        let own = std::process::id().to_string();
        assert!(locked.contains(&format!(" {own} ")), "{locked}");
        let locks: Vec<String> = locked
            .lines()
            .map(|line| line.replace(&format!(" {own} "), " 42 "))
            .collect();
        fs::write(root.path("proc/locks"), locks.join("\n")).unwrap();
        assert_eq!(
            names(),
            [(41, "minicom".to_owned()), (42, "bash".to_owned())]
        );
    }
}

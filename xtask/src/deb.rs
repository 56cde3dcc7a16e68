//! `cargo xtask deb`: builds the Debian package of the bridge from the files in `packaging/`.

use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::command::{
    AFTER_A_BUILD, AFTER_A_TEST, Failure, OrFail, cargo, print, root, run, target_folder, typed,
};

/// Programs that the package installs.
const PROGRAMS: [&str; 2] = ["corticode-bridge", "corticode-node"];

const NEXT: &str = "`apt-get install dpkg-dev binutils gzip`; then free space on the disk";
/// Files in `packaging/`, each with its path in the package.
#[rustfmt::skip]
const FILES: [(&str, &str); 11] = [
    ("60-corticode.rules", "lib/udev/rules.d/60-corticode.rules"),
    ("60-corticode.conf", "etc/security/limits.d/60-corticode.conf"),
    ("corticode-bridge.service", "lib/systemd/system/corticode-bridge.service"),
    ("bridge.toml", "etc/corticode/bridge.toml"),
    ("corticode-bridge.default", "etc/default/corticode-bridge"),
    ("debian/copyright", "usr/share/doc/corticode-bridge/copyright"),
    ("debian/changelog", "usr/share/doc/corticode-bridge/changelog"),
    ("debian/conffiles", "DEBIAN/conffiles"),
    ("debian/postinst", "DEBIAN/postinst"),
    ("debian/prerm", "DEBIAN/prerm"),
    ("debian/postrm", "DEBIAN/postrm"),
];
/// Each shell, and the path of its completion script in the package.
const COMPLETIONS: [(&str, &str); 3] = [
    ("bash", "bash-completion/completions/corticode-bridge"),
    ("zsh", "zsh/vendor-completions/_corticode-bridge"),
    ("fish", "fish/vendor_completions.d/corticode-bridge.fish"),
];

/// Builds the package and prints its path. It contains the bridge `program`, and `corticode-node`
/// from the same folder; without `program`, both are built in release first. With `check`, also
/// tests the installation of the package.
pub(crate) fn deb(program: Option<PathBuf>, check: bool) -> Result<(), Failure> {
    let program = if let Some(program) = program {
        program
    } else {
        let build = "build --release --locked --package bridge --package node --bins";
        run(&mut cargo(build), AFTER_A_BUILD)?;
        target_folder().join("release/corticode-bridge")
    };
    refuse_missing(&program)?;
    let package = package(&program)?;
    if check {
        let mut test = cargo("test --package acceptance debian_package:: -- --nocapture");
        run(test.env("CORTICODE_DEB", &package), AFTER_A_TEST)?;
    }
    print(format_args!("{}\n", package.display()))
}

/// Returns an error if the bridge's folder lacks a program of the package.
fn refuse_missing(program: &Path) -> Result<(), Failure> {
    let paths = PROGRAMS.map(|name| program.with_file_name(name));
    let Some(missing) = paths.iter().find(|path| !path.is_file()) else {
        return Ok(());
    };
    Err(Failure::missing(
        missing.display(),
        format!("the package contains {}, from one folder", PROGRAMS.join(" and ")),
        "`cargo build --release --locked --package bridge --package node --bins`, and --program \
         target/release/corticode-bridge; or leave out --program",
    ))
}

fn package(program: &Path) -> Result<PathBuf, Failure> {
    let folder = target_folder().join("debian");
    let tree = folder.join("corticode-bridge");
    if tree.exists() {
        fs::remove_dir_all(&tree).or_fail(tree.display(), NEXT)?;
    }
    let version = env!("CARGO_PKG_VERSION");
    let architecture = output(Command::new("dpkg").arg("--print-architecture"))?;
    let write = |path: &str, text: &str| {
        let path = tree.join(path);
        let parent = path.parent().unwrap_or(&tree);
        let written = fs::create_dir_all(parent).and_then(|()| fs::write(&path, text));
        written.or_fail(path.display(), NEXT)
    };
    let read = |name: &str| {
        let text = fs::read_to_string(root().join("packaging").join(name));
        let text = text.or_fail(name, "`git restore packaging`")?;
        Ok::<_, Failure>(text.replace("@VERSION@", version))
    };
    for (name, path) in FILES {
        write(path, &read(name)?)?;
    }
    for script in ["postinst", "prerm", "postrm"] {
        let path = tree.join("DEBIAN").join(script);
        fs::set_permissions(&path, Permissions::from_mode(0o755)).or_fail(script, NEXT)?;
    }
    let installed = PROGRAMS.map(|name| tree.join("usr/bin").join(name));
    for (name, installed) in PROGRAMS.iter().zip(&installed) {
        write(&format!("usr/bin/{name}"), "")?;
        let built = program.with_file_name(name);
        let mut strip = Command::new("strip");
        run(strip.arg("-o").arg(installed).arg(built), NEXT)?;
    }
    for (shell, path) in COMPLETIONS {
        let script = output(Command::new(program).args(["completions", shell]))?;
        write(&format!("usr/share/{path}"), &script)?;
    }
    // Copy the packages for ROS 2, from which a user builds a workspace.
    let share = tree.join("usr/share/corticode");
    fs::create_dir_all(&share).or_fail(share.display(), NEXT)?;
    let mut copy = Command::new("cp");
    run(copy.arg("-R").arg(root().join("ros/ros2")).arg(&share), NEXT)?;
    let pages = tree.join("usr/share/man/man1");
    run(Command::new(program).args(["man", "--folder"]).arg(&pages), NEXT)?;
    let changelog = tree.join("usr/share/doc/corticode-bridge/changelog");
    let mut gzip = Command::new("gzip");
    run(gzip.args(["-9nr"]).args([&pages, &changelog]), NEXT)?;

    // dpkg-shlibdeps reads a source package's control file, but only these fields of it.
    let source = "Source: corticode-bridge\n\nPackage: corticode-bridge\nArchitecture: any\n";
    write("debian/control", source)?;
    let mut libraries = Command::new("dpkg-shlibdeps");
    let libraries = libraries.arg("-O").args(&installed).current_dir(&tree);
    let depends = output(libraries)?;
    fs::remove_dir_all(tree.join("debian")).or_fail("debian/", NEXT)?;
    let list = ["lib", "usr", "-type", "f"];
    let files = output(Command::new("find").args(list).current_dir(&tree))?;
    let mut sums = Command::new("md5sum");
    let sums = output(sums.args(files.lines()).current_dir(&tree))?;
    write("DEBIAN/md5sums", &sums)?;
    let sizes = files.lines().filter_map(|file| fs::metadata(tree.join(file)).ok());
    let bytes: u64 = sizes.map(|file| file.len()).sum();
    let control = read("debian/control")?
        .replace("@ARCHITECTURE@", architecture.trim())
        .replace("@SIZE@", &bytes.div_ceil(1024).to_string())
        .replace("@DEPENDS@", depends.trim().trim_start_matches("shlibs:Depends="));
    write("DEBIAN/control", &control)?;
    let name = format!("corticode-bridge_{version}_{}.deb", architecture.trim());
    let package = folder.join(name);
    // Set the permissions explicitly: those of new files depend on the user's umask.
    run(Command::new("chmod").args(["-R", "u=rwX,go=rX"]).arg(&tree), NEXT)?;
    let mut build = Command::new("dpkg-deb");
    // This low level takes a quarter of the default's time; the package is a tenth larger.
    let build = build.args(["-Zxz", "-z1", "--root-owner-group", "--build"]).arg(&tree);
    output(build.arg(&package))?;
    Ok(package)
}

/// Returns the standard output of a command that must succeed.
fn output(command: &mut Command) -> Result<String, Failure> {
    let done = command.output().or_fail(typed(command), NEXT)?;
    if done.status.success() {
        return Ok(String::from_utf8_lossy(&done.stdout).into_owned());
    }
    let errors = String::from_utf8_lossy(&done.stderr);
    Err(Failure::check(typed(command), errors, NEXT))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_without_one_of_the_programs_is_refused_with_the_command_that_builds_both() {
        let folder = std::env::temp_dir().join(format!("xtask-deb-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder");
        let bridge = folder.join("corticode-bridge");
        fs::write(&bridge, "").expect("a file");
        let refused = deb(Some(bridge.clone()), false).expect_err("the other is missing");
        fs::write(folder.join("corticode-node"), "").expect("a file");
        let complete = refuse_missing(&bridge);
        fs::remove_dir_all(&folder).expect("the folder");
        assert_eq!(refused.status, 2);
        for part in ["corticode-node is missing", "--package node"] {
            assert!(refused.message.contains(part), "{}", refused.message);
        }
        assert!(complete.is_ok());
    }
}

//! `cargo xtask deb`: the Debian package of the bridge, from the files in `packaging/`.

use std::fs::{self, Permissions};
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::command::{AFTER_A_BUILD, Failure, OrFail, cargo, root, run, target_folder, typed};
use crate::deb_check;

const NEXT: &str = "`apt-get install dpkg-dev binutils gzip` on Debian or Ubuntu";
/// Files in `packaging/`, and their paths in the package.
const FILES: [(&str, &str); 5] = [
    ("60-corticode.rules", "lib/udev/rules.d/60-corticode.rules"),
    (
        "corticode-bridge.service",
        "lib/systemd/system/corticode-bridge.service",
    ),
    ("bridge.toml", "etc/corticode/bridge.toml"),
    ("corticode-bridge.default", "etc/default/corticode-bridge"),
    (
        "debian/copyright",
        "usr/share/doc/corticode-bridge/copyright",
    ),
];
/// Shells, and the paths of their completions in the package.
const COMPLETIONS: [(&str, &str); 3] = [
    (
        "bash",
        "usr/share/bash-completion/completions/corticode-bridge",
    ),
    ("zsh", "usr/share/zsh/vendor-completions/_corticode-bridge"),
    (
        "fish",
        "usr/share/fish/vendor_completions.d/corticode-bridge.fish",
    ),
];

/// Builds the bridge in release and its package; with `check`, also installs the package in a clean Debian.
pub(crate) fn deb(check: bool) -> Result<(), Failure> {
    let build = "build --release --locked --package bridge --bin corticode-bridge";
    run(&mut cargo(build), AFTER_A_BUILD)?;
    let package = package(&target_folder().join("release/corticode-bridge"))?;
    if check {
        deb_check::check(&package)?;
    }
    println!("{}", package.display());
    Ok(())
}

/// Packs and checks the program that the stage `tests` has built.
pub(crate) fn test() -> Result<(), Failure> {
    deb_check::check(&package(&target_folder().join("debug/corticode-bridge"))?)
}

/// Returns the folder for packages and for what checks them.
pub(crate) fn folder() -> PathBuf {
    target_folder().join("debian")
}

fn package(program: &Path) -> Result<PathBuf, Failure> {
    let tree = folder().join("corticode-bridge");
    // Of an earlier run.
    let _ = fs::remove_dir_all(&tree);
    let sources = root().join("packaging");
    let write = |path: &str, contents: &[u8]| {
        let path = tree.join(path);
        path.parent()
            .map_or(Ok(()), fs::create_dir_all)
            .and_then(|()| fs::write(&path, contents))
            .or_fail(path.display(), "is the disk full?")
    };
    let read = |name: &str| fs::read(sources.join(name)).or_fail(name, "restore packaging/");
    for (name, path) in FILES {
        write(path, &read(name)?)?;
    }
    let installed = tree.join("usr/bin/corticode-bridge");
    write("usr/bin/corticode-bridge", &[])?;
    let mut strip = Command::new("strip");
    run(strip.arg("-o").arg(&installed).arg(program), NEXT)?;
    for (shell, path) in COMPLETIONS {
        let script = output(Command::new(program).args(["completions", shell]))?;
        write(path, script.as_bytes())?;
    }
    let pages = tree.join("usr/share/man/man1");
    output(Command::new(program).args(["man", "--folder"]).arg(&pages))?;

    let version = env!("CARGO_PKG_VERSION");
    let architecture = output(Command::new("dpkg").arg("--print-architecture"))?;
    // dpkg-shlibdeps reads debian/control of a source package, of which it needs no more than these lines.
    let control = "Source: corticode-bridge\n\nPackage: corticode-bridge\nArchitecture: any\n";
    let scratch = folder().join("shlibdeps/debian");
    fs::create_dir_all(&scratch)
        .and_then(|()| fs::write(scratch.join("control"), control))
        .or_fail(scratch.display(), "is the disk full?")?;
    let mut libraries = Command::new("dpkg-shlibdeps");
    libraries.arg("-O").arg(&installed);
    let depends = output(libraries.current_dir(folder().join("shlibdeps")))?;
    let depends = depends.trim().trim_start_matches("shlibs:Depends=");
    let fill = |name: &str| -> Result<String, Failure> {
        let text = String::from_utf8(read(name)?).or_fail(name, "restore packaging/")?;
        let text = text.replace("@VERSION@", version);
        let text = text.replace("@ARCHITECTURE@", architecture.trim());
        Ok(text.replace("@DEPENDS@", depends))
    };
    let changelog = "usr/share/doc/corticode-bridge/changelog";
    write(changelog, fill("debian/changelog")?.as_bytes())?;
    let mut gzip = Command::new("gzip");
    run(
        gzip.args(["-9nr"]).arg(&pages).arg(tree.join(changelog)),
        NEXT,
    )?;

    let files = output(
        Command::new("find")
            .args(["etc", "lib", "usr", "-type", "f"])
            .current_dir(&tree),
    )?;
    let sums = output(
        Command::new("md5sum")
            .args(files.lines())
            .current_dir(&tree),
    )?;
    let sizes = files.lines().map(|file| fs::metadata(tree.join(file)));
    let bytes: u64 = sizes.map(|size| size.map_or(0, |size| size.len())).sum();
    let size = bytes.div_ceil(1024).to_string();
    write("DEBIAN/md5sums", sums.as_bytes())?;
    write(
        "DEBIAN/control",
        fill("debian/control")?.replace("@SIZE@", &size).as_bytes(),
    )?;
    write("DEBIAN/conffiles", &read("debian/conffiles")?)?;
    for script in ["postinst", "prerm", "postrm"] {
        let path = format!("DEBIAN/{script}");
        write(&path, &read(&format!("debian/{script}"))?)?;
        fs::set_permissions(tree.join(&path), Permissions::from_mode(0o755))
            .or_fail(path, "is the disk full?")?;
    }
    let name = format!("corticode-bridge_{version}_{}.deb", architecture.trim());
    let package = folder().join(name);
    let mut build = Command::new("dpkg-deb");
    build
        .args(["--root-owner-group", "--build"])
        .args([&tree, &package]);
    run(&mut build, NEXT)?;
    Ok(package)
}

/// Returns the standard output of a command that must succeed.
pub(crate) fn output(command: &mut Command) -> Result<String, Failure> {
    let done = command.output().or_fail(typed(command), NEXT)?;
    let text = String::from_utf8_lossy(&done.stdout).into_owned();
    if done.status.success() {
        return Ok(text);
    }
    let errors = String::from_utf8_lossy(&done.stderr);
    let why = io::Error::other(format!("{}: {text}{errors}", done.status));
    Err(Failure::check(typed(command), why, NEXT))
}

//! Runs the commands of docs/your-own-cap.md that need no board: they turn recordings of a cap with
//! eight electrodes into a model and decoded EEG.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

use acceptance::files::{Table, noise, write_gdf};
use acceptance::port::free_port;
use acceptance::programs::{programs, trainer};
use acceptance::{other_model, workspace};
use artifact::Artifact;

/// Beginnings of those commands in docs/your-own-cap.md that the test leaves out, because they take
/// minutes or need a board. Other tests cover model costs (`bench`) and boards (`cargo xtask
/// board`).
const ELSEWHERE: [&str; 3] =
    ["cargo build --release --package trainer", "cargo xtask", "cargo flash"];

/// Address of the simulator in the commands of docs/your-own-cap.md.
const PORT: &str = "127.0.0.1:5555";

/// Labels of the channels in the synthetic recordings: the cap's electrodes, and some others.
const LABELS: [&str; 11] = ["Fz", "Fp1", "Fp2", "C3", "Cz", "C4", "P7", "P8", "O1", "O2", "ECG"];
/// Duration of each synthetic recording in seconds.
const SECONDS: u32 = 20;
/// Sampling rate of the synthetic recordings, Hz.
const RATE_HZ: u32 = 160;

#[test]
fn the_commands_of_the_page_decode_the_codes_of_a_cap_with_eight_electrodes() {
    let Some(trainer) = trainer("the commands of docs/your-own-cap.md") else {
        return;
    };
    let commands = commands();
    assert!(commands.len() >= 10, "{commands:#?}");
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let root = workspace::root().canonicalize().expect("the root");
    symlink(root.join("files"), folder.join("files")).expect("a link");
    let release = folder.join("target/release");
    fs::create_dir_all(&release).expect("a folder");
    let built = other_model::programs().join("debug/host-sim");
    for (program, path) in
        [("trainer", &trainer), ("host-sim", &built), ("corticode-bridge", &programs().bridge)]
    {
        symlink(path, release.join(program)).expect("a link");
    }
    let recordings = folder.join("recordings");
    fs::create_dir(&recordings).expect("a folder");
    for number in 1..=12 {
        write_recording(&recordings.join(format!("S001R{number:02}.edf")), number);
    }

    let mut script = "set -e\n".to_owned();
    for command in &commands {
        if !ELSEWHERE.iter().any(|start| command.contains(start)) {
            script += &as_tested(command, &root);
            script += "\n";
        }
    }
    script += "wait\n";
    // Replace the TCP port in the commands by a free one, because another test may use it.
    let port = free_port().expect("a free port");
    let free = format!("127.0.0.1:{port}");
    assert!(script.contains(PORT), "{script}");
    let script = script.replace(PORT, &free);
    println!("{script}");
    // Keep other tests from building, because that would replace the host-sim used here.
    let _builds = other_model::lock_builds();
    let output = Command::new("sh")
        .args(["-c", &script])
        .current_dir(folder)
        .envs(other_model::environment())
        .output()
        .expect("a shell");
    let printed = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{printed}\n{errors}");
    check(folder, &printed);
}

/// Checks what the commands of docs/your-own-cap.md have printed and written.
fn check(folder: &Path, printed: &str) {
    let artifact = Artifact::read(&folder.join("my-model")).expect("a model");
    let description = &artifact.description;
    assert_eq!(description.dimensions().electrodes, 8);
    for words in ["8 electrodes, no mistake", "recorded: 8 ", "int8"] {
        assert!(printed.contains(words), "{words}: {printed}");
    }
    let table = |stream: &str| {
        let Table { names, rows } = Table::read(&folder.join(format!("session.{stream}.csv")));
        (names, rows)
    };
    let (names, codes) = table("codes");
    let numbers = names.iter().filter(|name| name.starts_with('z')).count();
    assert_eq!(numbers, description.code.numbers);
    // Ten seconds give about 160 codes, but on a busy machine the recording misses many at its
    // start and end.
    assert!(codes.len() > 48, "{} codes", codes.len());
    let (names, steps) = table("reconstructed");
    let electrodes = &description.montage.electrodes;
    assert!(names.ends_with(electrodes), "{names:?}");
    assert_eq!(steps.len(), codes.len() * description.window.hop);
    // The decoded signal must be as large as the synthetic sources, tens of microvolts.
    let last = steps[steps.len() / 2..].iter().filter_map(|row| row.last());
    let largest = last.map(|value| value.parse::<f64>().expect("a number").abs());
    let largest = largest.fold(0.0, f64::max);
    assert!((5.0..1_000.0).contains(&largest), "{largest} uV");
    assert!(artifact.packed.is_some());
    assert!(printed.contains("bits of a block"), "{printed}");
    assert!(folder.join("r11.decoded.gdf").exists());
}

/// Returns a command of docs/your-own-cap.md, changed to the tests' profile and target folders.
fn as_tested(command: &str, root: &Path) -> String {
    let options: Vec<String> = other_model::options().collect();
    let build = format!(
        "cargo build --quiet --workspace --manifest-path '{}' {} --test=streaming_equals_batch",
        root.join("Cargo.toml").display(),
        options.join(" ")
    );
    // Leave out the build of the bridge, which does not depend on the model and is built already.
    command.replace("cargo build --release", &build).replace(" --bin corticode-bridge", "")
}

/// Returns the commands in those code blocks of docs/your-own-cap.md that start with "```sh".
fn commands() -> Vec<String> {
    let path = workspace::root().join("docs/your-own-cap.md");
    let page = fs::read_to_string(path).expect("the page");
    let blocks = page.split("\n```sh").skip(1);
    let lines = blocks.flat_map(|block| {
        let (_, block) = block.split_once('\n').expect("a line after the fence");
        let (block, _) = block.split_once("\n```").expect("the end of the block");
        let block = block.replace("\\\n", " ");
        block.lines().map(str::to_owned).collect::<Vec<_>>()
    });
    let bridges = |line: &String| line.contains("corticode-bridge --port");
    // Leave out the command that starts a bridge for a real board, because it runs until it is
    // interrupted.
    lines.filter(|line| !bridges(line)).collect()
}

/// Writes a recording of low-pass-filtered sources, which every recording mixes with the same
/// weights. It is a GDF file whatever its name: readers recognise formats by the content.
fn write_recording(path: &Path, seed: u32) {
    let mut noise = noise(seed);
    let mut sources = [0.0_f32; 3];
    let mut values = Vec::new();
    for _ in 0..SECONDS * RATE_HZ {
        for source in &mut sources {
            *source = 0.95 * *source + 20.0 * noise();
        }
        let [a, b, c] = sources;
        let mixed = [a + b, b - c, c + a, a - b].into_iter().cycle();
        let signals = mixed.take(LABELS.len());
        values.extend(signals.map(|value| value + 0.5 * noise()));
    }
    write_gdf(path, &LABELS, RATE_HZ, values.into_iter(), &[]);
}

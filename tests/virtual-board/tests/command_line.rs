//! Error messages and exit status of the `virtual-board` program.

use std::net::TcpListener;
use std::path::Path;
use std::process::{Command, Output};
use std::{fs, io};

/// Builds an ELF file whose segment at address `flash` holds a vector table (stack pointer, entry
/// point) and then `code`.
fn program(machine: u16, flash: u32, code: &[u16]) -> Vec<u8> {
    let table = [0x2000_1000, flash + 9].map(u32::to_le_bytes).concat();
    let code = code.iter().flat_map(|half| half.to_le_bytes());
    virtual_board::elf(
        machine,
        flash,
        &table.into_iter().chain(code).collect::<Vec<_>>(),
    )
}

const ARM: u16 = 40;
const FLASH: u32 = 0x0800_0000;
/// Thumb code that loops on `wfi`.
const SLEEP: [u16; 2] = [0xBF30, 0xE7FD];
/// Thumb code that requests a reset: `ldr r0, =AIRCR; ldr r1, =VECTKEY | SYSRESETREQ; str r1, [r0];
/// b .`, then the two literals.
const RESET: [u16; 8] = [
    0x4801, 0x4902, 0x6001, 0xE7FE, 0xED0C, 0xE000, 0x0004, 0x05FA,
];

fn write_file(name: &str, bytes: &[u8]) -> io::Result<std::path::PathBuf> {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::write(&path, bytes)?;
    Ok(path)
}

fn run(arguments: &[&str]) -> (Option<i32>, String) {
    let mut program = Command::new(env!("CARGO_BIN_EXE_virtual-board"));
    let Output { status, stderr, .. } = program
        .args(arguments)
        .output()
        .expect("the program starts");
    (status.code(), String::from_utf8_lossy(&stderr).into_owned())
}

/// Runs an image on the NUCLEO-H743ZI2, at a TCP port that the operating system chooses.
fn run_image(path: &Path) -> (Option<i32>, String) {
    run(&["h743", "--port", "0", "--image", &path.to_string_lossy()])
}

#[test]
fn a_missing_image_is_named_with_the_command_that_builds_it() {
    let (status, error) = run_image(Path::new("/nowhere/board-h743"));
    assert_eq!(status, Some(2));
    assert!(error.contains("/nowhere/board-h743"), "{error}");
    assert!(
        error.contains("cargo build --package board-h743 --profile firmware"),
        "{error}"
    );
}

#[test]
fn a_file_that_is_no_arm_program_is_refused() {
    for bytes in [&b"plain text"[..], &program(62, FLASH, &SLEEP)] {
        let path = write_file("no-image.elf", bytes).expect("a file");
        let (status, error) = run_image(&path);
        assert_eq!(status, Some(2));
        assert!(error.contains("no 32-bit ELF file for ARM"), "{error}");
    }
}

#[test]
fn an_image_for_another_chip_is_refused_with_the_invalid_address() {
    let path = write_file("other-chip.elf", &program(ARM, 0x0010_0000, &SLEEP)).expect("a file");
    let (status, error) = run_image(&path);
    assert_eq!(status, Some(2));
    assert!(
        error.contains("not for the NUCLEO-H743ZI2") && error.contains("0x00100000"),
        "{error}"
    );
}

#[test]
fn an_image_older_than_its_sources_is_refused() {
    let source = write_file("source.rs", b"").expect("a file");
    let path = write_file("stale.elf", &program(ARM, FLASH, &SLEEP)).expect("a file");
    let depends = format!("{}: {}\n", path.display(), source.display());
    write_file("stale.d", depends.as_bytes()).expect("a file");
    let later = fs::metadata(&path)
        .expect("an existing file")
        .modified()
        .expect("a modification time");
    let later = later + std::time::Duration::from_secs(60);
    let file = fs::File::options()
        .write(true)
        .open(&source)
        .expect("a file");
    file.set_modified(later).expect("a modification time");
    let (status, error) = run_image(&path);
    assert_eq!(status, Some(2));
    assert!(
        error.contains("older than") && error.contains("source.rs"),
        "{error}"
    );
}

#[test]
fn an_occupied_port_is_named_with_the_remedy() {
    let path = write_file("sleep.elf", &program(ARM, FLASH, &SLEEP)).expect("a file");
    let taken = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let port = taken.local_addr().expect("a number").port().to_string();
    let (status, error) = run(&["f446", "--port", &port, "--image", &path.to_string_lossy()]);
    assert_eq!(status, Some(2));
    assert!(error.contains(&port) && error.contains("--port"), "{error}");
}

#[test]
fn a_board_without_progress_ends_with_its_program_counter() {
    let path = write_file("nothing.elf", &program(ARM, FLASH, &SLEEP)).expect("a file");
    let (status, error) = run_image(&path);
    assert_eq!(status, Some(1));
    assert!(error.contains("no progress for 10 s"), "{error}");
    assert!(
        error.contains("program counters") && error.contains("0x0800000"),
        "{error}"
    );
}

#[test]
fn a_board_that_resets_in_a_loop_ends_with_the_causes() {
    let path = write_file("restarts.elf", &program(ARM, FLASH, &RESET)).expect("a file");
    let (status, error) = run_image(&path);
    assert_eq!(status, Some(1));
    assert!(
        error.contains("resets") && error.contains("Core"),
        "{error}"
    );
}

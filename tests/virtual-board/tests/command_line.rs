//! Tests the error messages and the exit status of the program `virtual-board`.

use std::net::TcpListener;
use std::path::Path;
use std::process::{Command, Output};
use std::{fs, io};

/// Returns an ELF file whose segment at the address `flash` holds a vector table (stack pointer,
/// entry point) and then `code`.
fn program(machine: u16, flash: u32, code: &[u16]) -> Vec<u8> {
    let table = [0x2000_1000, flash + 9].map(u32::to_le_bytes).concat();
    let code = code.iter().flat_map(|half| half.to_le_bytes());
    virtual_board::elf(machine, flash, &table.into_iter().chain(code).collect::<Vec<_>>())
}

const ARM: u16 = 40;
const FLASH: u32 = 0x0800_0000;
/// Thumb code of an endless loop around the instruction `wfi`.
const SLEEP: [u16; 2] = [0xBF30, 0xE7FD];
/// Thumb code that resets the chip: `ldr r0, =AIRCR; ldr r1, =VECTKEY | SYSRESETREQ; str r1, [r0];
/// b .`, then the two constants that it loads.
const RESET: [u16; 8] = [0x4801, 0x4902, 0x6001, 0xE7FE, 0xED0C, 0xE000, 0x0004, 0x05FA];

fn write_file(name: &str, bytes: &[u8]) -> io::Result<std::path::PathBuf> {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::write(&path, bytes)?;
    Ok(path)
}

fn run(arguments: &[&str]) -> (Option<i32>, String) {
    let mut program = Command::new(env!("CARGO_BIN_EXE_virtual-board"));
    let Output { status, stderr, .. } =
        program.args(arguments).output().expect("the program starts");
    (status.code(), String::from_utf8_lossy(&stderr).into_owned())
}

/// Runs an image on the NUCLEO-H743ZI2 with a TCP port that the operating system chooses. Returns
/// exit status and messages.
fn run_image(path: &Path) -> (Option<i32>, String) {
    run(&["h743", "--port", "0", "--image", &path.to_string_lossy()])
}

#[test]
fn an_image_that_cannot_run_on_the_board_is_refused_with_the_reason() {
    let (missing, build) =
        ("/nowhere/board-h743", "cargo build --package board-h743 --profile firmware");
    let other_machine = program(62, FLASH, &SLEEP);
    let other_chip = program(ARM, 0x0010_0000, &SLEEP);
    let file = |name, bytes: &[u8]| write_file(name, bytes).expect("a file");
    for (path, parts) in [
        (missing.into(), [missing, build]),
        (file("text", b"plain text"), ["no 32-bit ELF file for ARM", build]),
        (file("other-machine.elf", &other_machine), ["no 32-bit ELF file for ARM", build]),
        (file("other-chip.elf", &other_chip), ["not for the NUCLEO-H743ZI2", "0x00100000"]),
    ] {
        let (status, error) = run_image(&path);
        assert_eq!(status, Some(2), "{error}");
        assert!(parts.iter().all(|part| error.contains(part)), "{error}");
    }
}

#[test]
fn an_image_older_than_its_sources_is_refused() {
    let source = write_file("source.rs", b"").expect("a file");
    let path = write_file("stale.elf", &program(ARM, FLASH, &SLEEP)).expect("a file");
    let depends = format!("{}: {}\n", path.display(), source.display());
    write_file("stale.d", depends.as_bytes()).expect("a file");
    let later = std::time::SystemTime::now() + std::time::Duration::from_secs(60);
    let file = fs::File::options().write(true).open(&source);
    let touched = file.expect("a file").set_modified(later);
    touched.expect("a modification time");
    let (status, error) = run_image(&path);
    assert_eq!(status, Some(2));
    assert!(error.contains("older than") && error.contains("source.rs"), "{error}");
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
fn a_board_that_stops_or_resets_in_a_loop_ends_with_a_diagnosis() {
    for (name, code, parts) in [
        ("nothing.elf", &SLEEP[..], ["no progress for 10 s", "program counters", "0x0800000"]),
        ("restarts.elf", &RESET, ["again and again", "resets", "Core"]),
    ] {
        let path = write_file(name, &program(ARM, FLASH, code)).expect("a file");
        let (status, error) = run_image(&path);
        assert_eq!(status, Some(1), "{error}");
        assert!(parts.iter().all(|part| error.contains(part)), "{error}");
    }
}

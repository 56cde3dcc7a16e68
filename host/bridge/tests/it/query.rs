//! The subcommands `selftest`, `reset` and `update`.

use dfuse::Image;
use link::{AckResult, ChannelFault, ChannelTest, ChipTest, SelfTest, ToDevice};
use serde_json::Value;

use crate::board::Board;
use crate::device::Device;
use crate::process::{Bridge, free_address};

fn result(fault: ChannelFault) -> SelfTest {
    let chip = ChipTest { id: 0x3E, ..ChipTest::default() };
    let channel =
        ChannelTest { noise_uv: 0.14, shorted_noise_uv: 0.14, fault, ..ChannelTest::default() };
    SelfTest {
        drdy_millihertz: 512_000,
        expected_millihertz: 512_000,
        chips: [chip; 8].into_iter().collect(),
        channels: [channel; 64].into_iter().collect(),
        ..SelfTest::default()
    }
}

fn board(fault: ChannelFault) -> Board {
    Board { self_test: Some(result(fault)), ..Board::new() }
}

/// Runs the program with these arguments until it exits. Returns exit status, stdout and stderr.
fn run_query(arguments: &[&str]) -> (Option<i32>, String, String) {
    Bridge::start(arguments).output()
}

#[test]
fn a_device_in_order_is_status_0_and_stdout_has_only_the_table() {
    let device = Device::tcp(board(ChannelFault::None));
    let (code, text, log) = run_query(&["selftest", "--port", &device.port]);
    assert_eq!((code, &*log), (Some(0), ""), "{text}");
    assert!(text.starts_with("device  board, firmware test"), "{text}");
    assert!(text.ends_with("\nall in order: 8 chips, 64 channels\n"), "{text}");
    let stopped = [ToDevice::Identify, ToDevice::Stop, ToDevice::SelfTest];
    assert_eq!(device.received(), stopped);
}

#[test]
fn a_device_with_a_fault_is_status_1_and_json_names_the_fault() {
    let device = Device::tcp(board(ChannelFault::Noisy));
    let (code, text, _) = run_query(&["selftest", "--json", "--port", &device.port]);
    assert_eq!(code, Some(1));
    let report: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(report["passed"], false);
    assert_eq!(report["channels"][60]["verdict"], "too loud");
}

#[test]
fn an_absent_device_is_status_3_and_a_refusal_status_4() {
    let nobody = format!("tcp:{}", free_address());
    for port in [&*nobody, "/dev/ttyNOBODY"] {
        let (code, _, log) = run_query(&["selftest", "--port", port]);
        assert_eq!(code, Some(3), "{log}");
        assert!(log.contains("plug the device in"), "{log}");
    }
    let device = Device::tcp(Board::answering(AckResult::NotSupported));
    let (code, _, log) = run_query(&["selftest", "--port", &device.port]);
    assert_eq!(code, Some(4), "{log}");
    assert!(log.contains("no converters"), "{log}");
}

#[test]
fn a_reset_prints_the_bootloader_or_the_restarted_device() {
    let device = Device::tcp(Board::new());
    let (code, text, _) = run_query(&["reset", "--bootloader", "--port", &device.port]);
    assert_eq!(code, Some(0));
    assert!(text.contains("starts its bootloader"), "{text}");
    let device = Device::tcp(Board { restarts_on_reset: true, ..Board::new() });
    let (code, text, log) = run_query(&["reset", "--port", &device.port]);
    assert_eq!(code, Some(0), "{log}");
    assert!(text.contains("started by power on"), "{text}");
}

#[test]
fn an_update_reads_file_and_board_before_it_resets_anything() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("corticode-h743.dfu");
    let path = path.to_str().unwrap();
    let device = Device::tcp(Board::new());
    let update = |file: &[u8]| {
        std::fs::write(path, file).unwrap();
        let (code, text, log) = run_query(&["update", path, "--port", &device.port]);
        assert_eq!((code, &*text), (Some(2), ""), "{log}");
        log
    };
    let image = Image {
        board: "NUCLEO-H743ZI2".to_owned(),
        firmware: "0.1.0 5d4b736".to_owned(),
        model: "2acfeb29e96e2dab".to_owned(),
        address: 0x0800_0000,
        content: vec![1; 1000],
    };
    let file = image.to_dfu().unwrap();
    for (file, why) in [(&file[..500], "its end is missing"), (&b"\x7fELF"[..], "no DFU file")] {
        let log = update(file);
        assert!(log.contains(path) && log.contains(why), "{log}");
    }
    assert_eq!(device.received(), []);
    let log = update(&file);
    assert!(log.contains("the image is for a NUCLEO-H743ZI2, and the device is a board"), "{log}");
    assert_eq!(device.received(), [ToDevice::Identify]);
    let (code, _, log) = run_query(&["update", "/nowhere.dfu", "--port", &device.port]);
    assert_eq!(code, Some(2), "{log}");
    assert!(log.contains("cargo fw"), "{log}");
}

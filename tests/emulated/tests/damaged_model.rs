//! A board whose model has one wrong bit in flash reports the damage and refuses to start.
#![forbid(unsafe_code)]

use std::fs;

use emulated::board::{APPLICATION, Scenario, boards, or_panic};
use emulated::frames::Boot;
use emulated::input::Input;
use emulated::{host, script};
use emulator::{EmulatorError, Image, pipes};
use link::{AckResult, Start, Streams, ToDevice, VERSION};
use object::{Object, ObjectSection};
use serde_json::json;

const TEST: &str = "a damaged model";

/// Seconds of samples; the board receives `Start` early in them.
const SECONDS: usize = 10;

/// Fault that `Hello` reports for a damaged model.
const FAULT: &str = "the model in flash is damaged";

#[test]
fn a_board_with_one_wrong_bit_in_its_model_reports_it_and_does_not_start() {
    let input = Input::from_environment();
    for board in boards(TEST, APPLICATION) {
        let scenario = board.scenario("damaged-model", input.first_seconds(SECONDS));
        let elf = fs::read(board.image.path()).expect("the image was built");
        let path = scenario.folder.join("damaged.elf");
        or_panic(fs::write(&path, damaged(elf)).map_err(EmulatorError::file(&path)));
        let intact = run(&scenario);
        let damaged = run(&scenario.with_image(Image::at(path)));
        let codes = [&intact, &damaged].map(|boot| boot.timed_codes.len());
        let figures = json!({"said": faults(&damaged), "codes": codes});
        board.record(&json!({"damaged_model": figures}));
        check(&intact, &damaged);
    }
}

/// Runs the image with a host that sends `Start` through the UART.
fn run(scenario: &Scenario) -> Boot {
    let start = ToDevice::Start(Start {
        streams: Streams::CODES,
        mains_hz: 0,
    });
    let sent = or_panic(pipes::run(
        scenario.qemu(&[]),
        &scenario.folder,
        &script::frame(0, VERSION, &start),
        scenario.silence,
        || true,
    ));
    Boot::only(&sent)
}

fn check(intact: &Boot, damaged: &Boot) {
    let answers = |boot: &Boot| -> Vec<_> { boot.acks.iter().map(|ack| ack.result).collect() };
    assert_eq!(answers(intact), [AckResult::Done], "of an intact board");
    assert!(!intact.timed_codes.is_empty(), "no code of an intact board");
    assert_eq!(faults(intact), "", "reported by an intact board");
    assert_eq!(answers(damaged), [AckResult::NotSupported], "to Start");
    assert_eq!(damaged.timed_codes.len(), 0, "codes of a damaged board");
    let reported = faults(damaged);
    assert!(reported.contains(FAULT), "reported: {reported:?}");
}

fn faults(boot: &Boot) -> String {
    let faults = boot.hellos.iter().map(|hello| &hello.fault[..]);
    faults.collect::<Vec<_>>().join("; ")
}

/// The image with one bit of the network's bias inverted.
fn damaged(mut elf: Vec<u8>) -> Vec<u8> {
    let bias = model::NETWORK.fc_bias.map(i32::to_le_bytes);
    let bias = bias.as_flattened();
    let file = object::File::parse(&elf[..]).expect("an ELF file");
    let sections = file.sections().filter_map(|section| {
        let (start, _) = section.file_range()?;
        Some((usize::try_from(start).ok()?, section.data().ok()?))
    });
    let places: Vec<usize> = sections
        .flat_map(|(start, data)| places(data, bias).map(move |place| start + place))
        .collect();
    let [place] = places[..] else {
        panic!(
            "the bias is in the image {} times; look at the symbols of `model` in it with `nm`",
            places.len()
        );
    };
    elf[place + bias.len() / 2] ^= 0x10;
    elf
}

/// Offsets at which `data` contains `bytes`.
fn places(data: &[u8], bytes: &[u8]) -> impl Iterator<Item = usize> {
    let windows = data.windows(bytes.len()).enumerate();
    windows
        .filter(move |(_, window)| *window == bytes)
        .map(|(place, _)| place)
}

#[test]
fn a_damaged_board_that_starts_or_reports_nothing_is_refused() {
    let sent = host::sent(Streams::CODES, &Input::new(40).samples);
    let boot = |result, fault: &str| {
        let mut boot = Boot::only(&sent);
        boot.acks.push(link::Ack { of: 0, result });
        boot.hellos[0].fault = fault.to_owned();
        boot
    };
    let refuses = |words, intact: &Boot, damaged: &Boot| {
        emulated::refusal::assert_refused(words, || check(intact, damaged));
    };
    let intact = boot(AckResult::Done, "");
    let mut damaged = boot(AckResult::NotSupported, FAULT);
    refuses("codes of a damaged board\n  left: 40", &intact, &damaged);
    damaged.timed_codes.clear();
    check(&intact, &damaged);
    refuses("of an intact board", &damaged, &damaged);
    refuses("to Start\n  left: [Done]", &intact, &intact);
    damaged.hellos[0].fault.clear();
    refuses("reported: \"\"", &intact, &damaged);
}

#[test]
fn every_place_of_the_bias_is_found() {
    let data = [[7; 33].as_slice(), &[1, 2, 3], &[9; 5], &[1, 2, 3]].concat();
    assert!(places(&data, &[1, 2, 3]).eq([33, 41]));
    assert_eq!(places(&data, &[4]).count(), 0);
}

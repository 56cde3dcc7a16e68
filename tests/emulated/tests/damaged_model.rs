//! A board whose model has one wrong bit in flash reports the damage and refuses to start.
#![forbid(unsafe_code)]

use std::fs;

use emulated::board::{Board, boards, or_panic};
use emulated::frames::Boot;
use emulated::input::Input;
use emulated::script::{self, Script, start};
use emulator::{EmulatorError, Image};
use link::{AckResult, Streams};
use serde_json::json;

/// Duration of the samples in seconds; the board receives `Start` at device time 0.
const SECONDS: usize = 10;

/// Fault that `Hello` reports for a damaged model.
const FAULT: &str = "the model in flash is damaged";

#[test]
fn a_board_with_one_wrong_bit_in_its_model_reports_it_and_does_not_start() {
    let input = Input::from_environment();
    let mut script = Script::default();
    script.add_command(1, 0, &start(Streams::CODES, 0), AckResult::Done);
    for board in boards("damaged-model", input.first_seconds(SECONDS)) {
        board.write(script::FILE, &script.file);
        let intact = Boot::only(&board.run(&["commands"], "uart").sent);
        let elf =
            or_panic(fs::read(board.image.path()).map_err(EmulatorError::file(board.image.path())));
        let image = Image::at(board.folder.join("damaged.elf"));
        board.write("damaged.elf", &damaged(elf));
        let board = Board { image, ..board };
        let damaged = Boot::only(&board.run(&["commands"], "damaged.uart").sent);

        let codes = [&intact, &damaged].map(|boot| boot.timed_codes.len());
        let [intact_faults, faults] = [&intact, &damaged].map(faults);
        board.record(&json!({"damaged_model": {"said": faults, "codes": codes}}));
        assert_eq!(intact.acks, script.answers, "of an intact board");
        assert!(codes[0] > 0, "no code of an intact board");
        assert_eq!(intact_faults, "", "reported by an intact board");
        let results: Vec<_> = damaged.acks.iter().map(|ack| ack.result).collect();
        assert_eq!(results, [AckResult::NotSupported], "to Start");
        assert_eq!(codes[1], 0, "codes of a damaged board");
        assert!(faults.contains(FAULT), "reported: {faults:?}");
    }
}

fn faults(boot: &Boot) -> String {
    let faults = boot.hellos.iter().map(|(_, fault)| &fault[..]);
    faults.collect::<Vec<_>>().join("; ")
}

/// Inverts one bit of the bias of the fully connected layer, whose bytes must occur exactly once in the
/// image.
fn damaged(mut elf: Vec<u8>) -> Vec<u8> {
    let bias = model::NETWORK.fc_bias.map(i32::to_le_bytes);
    let bias = bias.as_flattened();
    let windows = elf.windows(bias.len()).enumerate();
    let places: Vec<usize> = windows
        .filter_map(|(place, window)| (window == bias).then_some(place))
        .collect();
    let [place] = places[..] else {
        panic!("the bias is in the image at {places:?}; look at the symbols of `model` with `nm`");
    };
    elf[place + bias.len() / 2] ^= 0x10;
    elf
}

//! Scenario with one wrong bit in the model in flash: the board reports it and refuses to run.

use std::fs;

use emulated::board::{Board, boards, or_panic};
use emulated::frames::Boot;
use emulated::input::Input;
use emulated::script::{self, Script, start};
use emulator::{EmulatorError, Image};
use link::{AckResult, Streams};
use serde_json::json;

/// Duration of the samples of the scenario, seconds; the board receives `Start` at device time 0.
const SECONDS: usize = 4;

/// Text of the fault that `Hello` must report for a damaged model.
const FAULT: &str = "the model in flash is damaged";

#[test]
fn a_board_with_one_wrong_bit_in_its_model_reports_it_and_does_not_start() {
    let input = Input::from_environment();
    let mut script = Script::default();
    script.add_command(1, 0, &start(Streams::CODES, 0), AckResult::Done);
    for board in boards("damaged-model", input.first_seconds(SECONDS)) {
        board.write(script::FILE, &script.file);
        let intact = Boot::only(&board.run(&["commands"], "uart").sent);
        assert_eq!(intact.acks, script.answers, "of an intact board");
        assert!(!intact.timed_codes.is_empty(), "no code of an intact board");
        assert_eq!(faults(&intact), "", "reported by an intact board");
        let elf =
            or_panic(fs::read(board.image.path()).map_err(EmulatorError::file(board.image.path())));
        let image = Image::at(board.folder.join("damaged.elf"));
        let board = Board { image, ..board };
        let packed = model::PACKED.expect("the built-in model has a packed model");
        for (part, values) in
            [("network", &model::NETWORK.fc_bias[..]), ("packed code", packed.analysis_factors)]
        {
            board.write("damaged.elf", &damaged(elf.clone(), values));
            let damaged = Boot::only(&board.run(&["commands"], "damaged.uart").sent);
            let codes = [&intact, &damaged].map(|boot| boot.timed_codes.len());
            let faults = faults(&damaged);
            board.record(&json!({"damaged_model": {"part": part, "said": faults, "codes": codes}}));
            let results: Vec<_> = damaged.acks.iter().map(|ack| ack.result).collect();
            assert_eq!(results, [AckResult::NotSupported], "to Start, {part}");
            assert_eq!(codes[1], 0, "codes of a board with a damaged {part}");
            assert!(faults.contains(FAULT), "reported: {faults:?}, {part}");
        }
    }
}

fn faults(boot: &Boot) -> String {
    let faults = boot.hellos.iter().map(|(_, fault)| &fault[..]);
    faults.collect::<Vec<_>>().join("; ")
}

/// Returns the image with one bit of `values` inverted; it must contain these bytes exactly once.
fn damaged(mut elf: Vec<u8>, values: &[i32]) -> Vec<u8> {
    let bytes: Vec<[u8; 4]> = values.iter().map(|value| value.to_le_bytes()).collect();
    let bytes = bytes.as_flattened();
    let windows = elf.windows(bytes.len()).enumerate();
    let places: Vec<usize> =
        windows.filter_map(|(place, window)| (window == bytes).then_some(place)).collect();
    let [place] = places[..] else {
        panic!(
            "the values are in the image at {places:?}; look at the symbols of `model` with `nm`"
        );
    };
    elf[place + bytes.len() / 2] ^= 0x10;
    elf
}

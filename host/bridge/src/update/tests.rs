//! Updates of simulated boards, in virtual time.

use dfuse::Image;
use indicatif::ProgressBar;

use crate::error::BridgeError;
use crate::update::programmer::{CLEAR_STATUS, DNLOAD, ERASE, ERASED, Loader as _};
use crate::update::simulated_board::{Runs, SimulatedBoard};
use crate::update::{UpdateError, update};

/// Name, flash layout as the chip's loader is said to describe it, and transfer size of each board.
const H743: (&str, &str, u16) = ("NUCLEO-H743ZI2", "@Internal Flash   /0x08000000/16*128Kg", 1024);
const F446: (&str, &str, u16) =
    ("NUCLEO-F446RE", "@Internal Flash  /0x08000000/04*016Kg,01*064Kg,03*128Kg", 2048);

/// Returns an image of `length` bytes for a board. The bytes depend on `version`.
fn image(board: &str, version: u8, length: u32) -> Image {
    let byte = |at: u32| ((at * 37) >> 3).to_le_bytes()[0].wrapping_add(version) & 0x7F;
    Image {
        board: board.to_owned(),
        firmware: format!("0.{version}.0 5d4b736"),
        model: "2acfeb29e96e2dab".to_owned(),
        address: 0x0800_0000,
        content: (0..length).map(byte).collect(),
    }
}

/// Returns a board that runs version 1, and an image of version 2 for it of `length` bytes.
fn board(
    (name, layout, transfer_size): (&str, &'static str, u16),
    length: u32,
) -> (SimulatedBoard, Image) {
    let board = SimulatedBoard::new(&image(name, 1, 60_000), layout, transfer_size);
    let new = image(name, 2, length);
    board.chip.borrow_mut().images.push(new.clone());
    (board, new)
}

fn run(board: &mut SimulatedBoard, image: &Image) -> Result<String, BridgeError> {
    let device = update(board, image, &ProgressBar::hidden())?;
    Ok(device.firmware)
}

/// Returns the error of an update with `image`, which must fail with exit status `status`.
fn failure(board: &mut SimulatedBoard, image: &Image, status: u8) -> UpdateError {
    match run(board, image) {
        Err(BridgeError::Update(error)) => {
            assert_eq!(error.exit_code(), status, "{error}");
            error
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn an_image_is_written_compared_and_started_on_both_boards() {
    // The H743 image fills two sectors of 128 KiB and one byte of a third. The F446 image fills one
    // sector of 16 KiB and part of a second, and its last transfer block is not full.
    for (kind, length, erased) in [(H743, 262_145, 393_216), (F446, 20_011, 32_768)] {
        let (mut board, new) = board(kind, length);
        let before = board.chip.borrow().flash.clone();
        board.chip.borrow_mut().leaves_silently = kind == H743;
        board.denials = 3;
        // The loader of another board is left alone.
        board.others.push(99);
        assert_eq!(run(&mut board, &new).unwrap(), "0.2.0 5d4b736");
        let expected = format!(
            "{}: from 0.1.0 5d4b736 (model 2acfeb29e96e2dab) to 0.2.0 5d4b736 (model 2acfeb29e96e2dab)",
            kind.0
        );
        assert_eq!(board.notes, [expected]);
        let flash = &board.chip.borrow().flash;
        let (written, rest) = flash.split_at(new.content.len());
        assert!(*written == *new.content);
        let (free, untouched) = rest.split_at(erased - written.len());
        assert!(free.iter().all(|byte| *byte == ERASED));
        assert!(*untouched == before[erased..]);
    }
}

#[test]
fn the_same_version_is_written_again_with_a_note() {
    let (mut board, new) = board(F446, 5_000);
    for note in [")", "), the same"] {
        run(&mut board, &new).unwrap();
        assert!(board.notes.pop().unwrap().ends_with(note));
    }
}

#[test]
fn an_update_that_loses_power_anywhere_starts_nothing_half_and_is_repeated() {
    let mut breaks = 0;
    for requests in (0..).step_by(7) {
        let (mut board, new) = board(F446, 20_011);
        // Start the loader here, before `requests_left` is set, because the update's own reset
        // would overwrite that number.
        board.reset_into_loader();
        board.chip.borrow_mut().requests_left = requests;
        match run(&mut board, &new) {
            Ok(_) => break,
            // After the loss of power, `started` panics if the flash starts a part of an image.
            Err(BridgeError::Update(UpdateError::Lost { .. })) => breaks += 1,
            other => panic!("{other:?}"),
        }
        let is_dead = board.chip.borrow().started().is_none();
        if is_dead {
            let error = failure(&mut board, &new, 3);
            assert!(error.to_string().contains("BOOT0"), "{error}");
            board.reset_into_loader();
        }
        assert_eq!(run(&mut board, &new).unwrap(), "0.2.0 5d4b736");
    }
    assert!(breaks > 20, "{breaks}");
}

#[test]
fn an_update_goes_on_with_a_loader_that_was_left_in_the_middle() {
    let (mut board, new) = board(H743, 20_011);
    board.chip.borrow_mut().refuses = Some((ERASE, 0x0B));
    let error = failure(&mut board, &new, 4).to_string();
    assert!(error.contains("protected") && error.contains("while erasing"), "{error}");
    let mut chip = board.chip.borrow_mut();
    assert_eq!((chip.runs, chip.refuses.take().is_some()), (Runs::Loader, true));
    drop(chip);
    // Leave the loader in the state in which a program leaves it that ends before it reads the
    // status of its last command.
    board.send(DNLOAD, 0, &[]).unwrap_err();
    board.send(CLEAR_STATUS, 0, &[]).unwrap();
    board.send(DNLOAD, 0, &[ERASE, 0, 0, 0, 8]).unwrap();
    assert_eq!(run(&mut board, &new).unwrap(), "0.2.0 5d4b736");
}

#[test]
fn a_byte_that_differs_is_named_and_nothing_is_started() {
    let (mut board, new) = board(H743, 20_011);
    board.chip.borrow_mut().defect = Some(0x0800_4321);
    let error = failure(&mut board, &new, 1).to_string();
    assert!(error.contains("0x08004321"), "{error}");
    assert!(board.chip.borrow().started().is_none());
}

#[test]
fn an_image_for_another_board_or_flash_erases_nothing() {
    let (mut board, new) = board(F446, 20_011);
    let before = board.chip.borrow().flash.clone();
    let h743 = image(H743.0, 2, 20_011);
    let mut elsewhere = new.clone();
    elsewhere.address += 0x4000;
    let too_long = image(F446.0, 2, 0x8_0001);
    let unknown = image("NUCLEO-G431KB", 2, 9);
    let texts = ["is for a NUCLEO-H743ZI2", "0x08004000", "to 0x08080001", "cannot update"];
    for (image, text) in [&h743, &elsewhere, &too_long, &unknown].into_iter().zip(texts) {
        let error = failure(&mut board, image, 2).to_string();
        assert!(error.contains(text), "{error}");
    }
    assert_eq!(board.resets, 0);
    board.reset_into_loader();
    let error = failure(&mut board, &h743, 2).to_string();
    assert!(error.contains("another chip (@Internal Flash"), "{error}");
    board.others.push(99);
    assert!(matches!(failure(&mut board, &new, 2), UpdateError::SeveralLoaders));
    assert!(board.chip.borrow().flash == before);
}

#[test]
fn a_loader_that_does_not_appear_or_open_is_status_3_with_the_remedy() {
    let (mut board, new) = board(F446, 20_011);
    board.has_cable = false;
    let error = failure(&mut board, &new, 3).to_string();
    assert!(error.contains("`USER`"), "{error}");
    (board.has_cable, board.denials) = (true, u32::MAX);
    let error = failure(&mut board, &new, 3).to_string();
    assert!(error.contains("--udev-rule"), "{error}");
}

#[test]
fn another_version_after_the_update_is_status_1() {
    let (mut board, new) = board(F446, 20_011);
    board.chip.borrow_mut().images[1].model = "0000000000000000".to_owned();
    let error = failure(&mut board, &new, 1).to_string();
    assert!(error.contains("reports 0.2.0 5d4b736 (model 0000"), "{error}");
}

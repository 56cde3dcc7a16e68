//! Scenario in which a virtual board's codes must equal host-sim's.

use std::time::Instant;

use link::Streams;
use virtual_board::{BoardError, Cable, Frame, Kind, Model, ReceivedCode, VirtualBoard};

use crate::images::Subject;
use crate::session::{assert_sound, in_time, pick, run_codes, running, worst_path};
use crate::simulation::{EXCLUDE, HOP, Repeatable, assert_substituted};

/// Returns the number of codes to compare: 128 (8 s) for a board's default image, 48 (3 s) for its
/// other image, which differs only in the port.
const fn codes(subject: Subject) -> usize {
    match (subject.model, subject.cable) {
        (Model::H743, Cable::Uart) | (Model::F446, Cable::Usb) => 48,
        _ => 128,
    }
}

/// Number of times that the scenario inspects the DMA streams.
const INSPECTIONS: usize = 50;

/// Scenario: the codes, with substituted electrodes, equal host-sim's bit for bit, their time
/// stamps are 62.5 ms apart, and nothing is late or lost. DMA1 can access all its buffers.
pub(crate) fn codes_equal_those_of_host_sim(subject: Subject) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    let run = Repeatable::start(&mut board, Streams::CODES, &[EXCLUDE])?;
    let (start_us, started) = (board.now_us(), Instant::now());
    run_codes(&mut board, 2)?;
    for _ in 0..INSPECTIONS {
        // The interval is no multiple of the sampling period, so that the DMA is inspected at
        // varying points of the period.
        board.run_for_us(1_237)?;
        assert_dma_reaches_its_buffers(&mut board, subject)?;
    }
    let missing = codes(subject) - board.inbox().codes().count();
    run_codes(&mut board, missing)?;

    let virtual_us = board.now_us() - start_us;
    #[expect(clippy::cast_precision_loss, reason = "seconds")]
    let real_time_factor = virtual_us as f64 * 1e-6 / started.elapsed().as_secs_f64();
    let (equal, _) = run.assert_equal(&board, HOP, received);
    assert_substituted(&received(board.inbox().frames()));
    let stamps: Vec<u64> = board.inbox().codes().map(|(frame, _)| frame.device_us).collect();
    // Stamps are rounded down to whole microseconds. An edge just before the next microsecond can
    // be stamped with the latter, because the interrupt reads the clock some cycles later.
    for (index, stamp) in (0..).zip(&stamps) {
        let error_us = (stamp - stamps[0]).abs_diff(index * 62_500);
        assert!(error_us <= 1, "code {index} is {error_us} us off");
    }

    let timing = in_time(&board);
    // The largest stack use can only grow, so the device's report, which is older than this value,
    // must not be larger.
    let used = board.stack_used()?;
    let [reported, size] = [timing.stack_used, timing.stack_size].map(u64::from);
    assert!(
        used >= reported && used < size * 3 / 4,
        "{used} of {size} bytes of stack, {reported} reported"
    );
    assert_sound(&mut board)?;
    subject.record("codes", equal);
    subject.record("equal_to_host", equal);
    let worst = worst_path(&timing);
    subject.record("worst_path_over_deadline", format!("{worst:.3}"));
    subject.record("real_time_factor", format!("{real_time_factor:.2}"));
    subject.record("stack_used", used);
    let per_second = board.instructions() * 1_000_000 / board.now_us();
    subject.record("instructions_per_virtual_second", per_second);
    Ok(())
}

pub(crate) fn received(frames: &[Frame]) -> Vec<ReceivedCode> {
    let code = |kind: &Kind| match kind {
        Kind::Code(code) => Some(code.clone()),
        _ => None,
    };
    pick(frames, code).collect()
}

/// Asserts that DMA1 can access the buffers of all its streams. On the chip it cannot access the
/// DTCM (RM0433, 2.1), but the emulator allows it.
fn assert_dma_reaches_its_buffers(
    board: &mut VirtualBoard,
    subject: Subject,
) -> Result<(), BoardError> {
    // The SPI uses two streams, and the UART, if the image uses it, two more.
    let streams = match subject.cable {
        Cable::Uart => 4,
        Cable::Usb => 2,
    };
    let memory = board.dma_memory()?;
    assert_eq!(memory.len(), streams, "{memory:x?}");
    for (address, left) in memory {
        for end in [address, address + left.max(1) - 1] {
            let reaches = subject.model.dma_reaches(end);
            assert!(reaches, "DMA1 cannot access {end:#010x}");
        }
    }
    Ok(())
}

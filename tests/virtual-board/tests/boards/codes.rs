//! Comparison of a board's codes with those of host-sim.

use std::time::Instant;

use link::Streams;
use virtual_board::{BoardError, Cable, Inbox, Model, ReceivedCode};

use crate::figures::record;
use crate::images::Subject;
use crate::session::{assert_sound, in_time, run_codes, running, start, worst_path};
use crate::simulation::{HOP, simulated};

/// Returns the number of codes to compare: 256 (16 s) for the default image of a board, 48 (3 s) for the
/// other image, which differs only in the port.
const fn codes(subject: Subject) -> usize {
    match (subject.model, subject.cable) {
        (Model::H743, Cable::Uart) | (Model::F446, Cable::Usb) => 48,
        _ => 256,
    }
}

/// The codes equal those of host-sim bit for bit, their timestamps are 62.5 ms apart, and nothing is late or lost.
pub(crate) fn codes_equal_those_of_host_sim(subject: Subject) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    let before = board.converters().samples_delivered();
    start(&mut board, Streams::CODES)?;
    let after = board.converters().samples_delivered();
    let (start_us, started) = (board.now_us(), Instant::now());
    run_codes(&mut board, codes(subject))?;

    let virtual_us = board.now_us() - start_us;
    #[expect(clippy::cast_precision_loss, reason = "seconds")]
    let real_time_factor = virtual_us as f64 * 1e-6 / started.elapsed().as_secs_f64();
    let codes: Vec<ReceivedCode> = received(board.inbox());
    // The test does not know at which sample the codes start, so it tries all samples between the `Start`
    // command and its acknowledgement.
    let first = (before.saturating_sub(1)..=after + 1).find(|&sample| {
        received(&simulated(Streams::CODES, &[], sample, 2 * HOP))[..1] == codes[..1]
    });
    let first = first.expect("the first code equals none of host-sim's");
    let simulated = simulated(Streams::CODES, &[], first, HOP * (codes.len() as u64 + 2));
    let simulated = received(&simulated);
    let equal = codes
        .iter()
        .zip(&simulated)
        .filter(|(image, host)| image == host);
    assert_eq!(equal.count(), codes.len());
    let stamps: Vec<u64> = board
        .inbox()
        .codes()
        .map(|(frame, _)| frame.device_us)
        .collect();
    for pair in stamps.windows(2) {
        assert_eq!(pair[1] - pair[0], 62_500);
    }

    let timing = in_time(&board);
    // The peak of the stack use only grows, and the device reported it before this read, so the report
    // cannot be larger.
    let used = board.stack_used()?;
    let [reported, size] = [timing.stack_used, timing.stack_size].map(u64::from);
    assert!(
        used >= reported && used < size * 3 / 4,
        "{used} of {size} bytes of stack, {reported} reported"
    );
    assert_sound(&mut board)?;
    record(subject, "codes", codes.len());
    record(subject, "equal_to_host", codes.len());
    record(
        subject,
        "worst_path_over_deadline",
        format!("{:.3}", worst_path(&timing)),
    );
    record(
        subject,
        "real_time_factor",
        format!("{real_time_factor:.2}"),
    );
    record(subject, "stack_used", used);
    record(
        subject,
        "instructions_per_virtual_second",
        board.instructions() * 1_000_000 / board.now_us(),
    );
    Ok(())
}

fn received(inbox: &Inbox) -> Vec<ReceivedCode> {
    inbox.codes().map(|(_, code)| code.clone()).collect()
}

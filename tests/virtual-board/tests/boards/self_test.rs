//! Self-test of the converters, on command of the host.

use link::ToDevice;
use virtual_board::{BoardError, Frame, Kind};

use crate::figures::record;
use crate::images::Subject;
use crate::session::{assert_sound, converters, running};

/// Longest time of a self-test, in us; a self-test takes 4.5 s (docs/hardware.md).
const LONGEST_US: u64 = 6_000_000;

/// The self-test passes for all eight chips and 64 channels, and the chain converts again afterwards.
pub(crate) fn self_test_passes(subject: Subject) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    board.send(&ToDevice::SelfTest);
    let is_result = |frame: &Frame| matches!(frame.kind, Kind::SelfTest(_));
    board.run_until("the result of a self-test", LONGEST_US, |frames| {
        frames.iter().any(is_result)
    })?;
    let results = board
        .inbox()
        .frames()
        .iter()
        .filter_map(|frame| match &frame.kind {
            Kind::SelfTest(result) => Some(result),
            _ => None,
        });
    let results: Vec<_> = results.collect();
    let result = results[0];
    assert_eq!(result.fault, "", "{result:?}");
    assert_eq!((result.chips.len(), result.channels.len()), (8, 64));
    assert_eq!((result.drdy_early, result.drdy_missed), (0, 0));
    let edges = board.converters().ready_edges();
    board.run_for_us(100_000)?;
    assert!(
        board.converters().ready_edges() > edges + 45,
        "the chain converts again"
    );
    assert_eq!(converters(board.inbox().frames()), Some(""));
    assert_sound(&mut board)?;
    record(subject, "selftest_ok", true);
    Ok(())
}

//! Scenario with edges at the pin of the trigger input.

use link::{EventKind, Streams};
use virtual_board::Kind;

use virtual_board::BoardError;

use crate::images::Subject;
use crate::session::{assert_sound, streaming};

/// Longest time from power-on until the device's clock starts to count, in us.
const STARTS_US: u64 = 20_000;

/// Number of edges that the scenario makes at the trigger input.
const EDGES: usize = 200;

/// Scenario: each edge becomes an event that has the device time of the edge, within 1 us.
pub(crate) fn trigger_edges_have_correct_times(subject: Subject) -> Result<(), BoardError> {
    let mut board = streaming(subject, Streams::CODES | Streams::EVENTS)?;
    board.run_for_us(100_000)?;
    let start = board.now_us();
    // The interval of 7,919 us makes the edges occur at varying points of the sampling period and
    // of the time driver's half periods.
    let edges: Vec<(u64, bool)> =
        (0..EDGES).map(|index| (start + 500 + index as u64 * 7_919, index % 2 == 0)).collect();
    board.plan_trigger(&edges);
    let end = edges[EDGES - 1].0 + 200_000;
    board.run_until_us(end)?;

    let events: Vec<_> = board
        .inbox()
        .frames()
        .iter()
        .filter_map(|frame| match &frame.kind {
            Kind::Event(event) => Some((frame.device_us, *event)),
            _ => None,
        })
        .collect();
    assert_eq!(events.len(), EDGES);
    // The device's clock starts to count only when its PLLs run, up to STARTS_US after power-on.
    // The offset would be far outside this range if the clock were half a period of the time driver
    // ahead or an event had the time of another edge.
    let offset = edges[0].0.wrapping_sub(events[0].0);
    assert!((1..STARTS_US).contains(&offset), "the clock starts {offset} us after power on");
    for ((at_us, event), (edge_us, is_high)) in events.iter().zip(&edges) {
        let kind = if *is_high { EventKind::TriggerRise } else { EventKind::TriggerFall };
        assert_eq!(event.kind, kind);
        let off = edge_us.wrapping_sub(offset).abs_diff(*at_us);
        assert!(off <= 1, "an edge at {edge_us} us is reported at {at_us}, {off} us off");
    }
    for (pair, number) in events.windows(2).zip(1..) {
        assert_eq!(pair[1].1.number, pair[0].1.number.wrapping_add(1), "event {number}");
    }
    assert_sound(&mut board)?;
    subject.record("trigger_edges", EDGES);
    Ok(())
}

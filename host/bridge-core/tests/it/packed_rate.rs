//! The command that sets the rate of the packed code.

use bridge_core::Settings;
use link::{AckResult, Streams, ToDevice};

use crate::board::at;
use crate::packed_device::{PACKED, Packed};
use crate::recorder::{Harness, commands};

#[test]
fn the_rate_is_set_before_the_start_and_while_blocks_arrive() {
    let asked = Settings {
        packed_rate: Some(7),
        ..PACKED
    };
    let mut device = Packed::new(asked);
    assert_eq!(
        commands(&device.harness),
        ["identify", "stop", "set rate", "start"]
    );
    assert_eq!(device.harness.board.rate, 7);
    device.send(false);
    device.harness.core.set_packed_rate(2);
    let now = at(device.harness.now_us);
    device.harness.core.tick(now, &mut device.harness.recorder);
    device.harness.exchange();
    assert_eq!(device.harness.board.rate, 2);
    assert_eq!(commands(&device.harness).last(), Some(&"set rate"));
    // Without packed blocks there is nothing to set.
    let codes = Settings {
        streams: Streams::CODES,
        ..asked
    };
    assert!(!commands(&Packed::new(codes).harness).contains(&"set rate"));
}

#[test]
fn a_device_that_cannot_set_the_rate_streams_all_the_same() {
    let asked = Settings {
        packed_rate: Some(7),
        ..PACKED
    };
    let mut harness = Harness::new(asked, crate::board::Board::new());
    harness.core.connected(at(1_000_000), &mut harness.recorder);
    for _ in 0..8 {
        let commands = std::mem::take(&mut harness.recorder.sent);
        let before = harness.board.received.len();
        let answers = harness.board.answer(&commands);
        let news = &harness.board.received[before..];
        let is_rate = matches!(news, [(_, ToDevice::SetRate { .. })]);
        if is_rate {
            let ack = link::ToHost::Ack(link::Ack {
                of: news[0].0,
                result: AckResult::UnknownCommand,
            });
            harness.send(0, &ack);
        } else {
            harness.receive(&answers);
        }
    }
    assert_eq!(
        commands(&harness),
        ["identify", "stop", "set rate", "start"]
    );
}

#[test]
fn a_rate_that_changes_before_the_device_has_answered_is_sent_too() {
    let mut device = Packed::new(PACKED);
    let harness = &mut device.harness;
    harness.core.set_packed_rate(5);
    harness.tick();
    let sent = std::mem::take(&mut harness.recorder.sent);
    let answers = harness.board.answer(&sent);
    assert_eq!(harness.board.rate, 5);
    harness.core.set_packed_rate(7);
    harness.receive(&answers);
    harness.exchange();
    assert_eq!(harness.board.rate, 7);
}

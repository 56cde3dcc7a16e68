//! Packed blocks after long gaps and reconnections.

use bridge::Settings;
use link::Flags;

use crate::packed_device::{PACKED, Packed};
use crate::recorder::commands;

#[test]
fn a_gap_longer_than_the_fillers_is_counted_and_ends_at_the_next_block() {
    let mut device = Packed::new(PACKED);
    device.send(false);
    let lost = 70_000_u32;
    device.next += lost;
    device.harness.now_us += i64::from(lost) * 62_500;
    device.send(false);
    let blocks = &device.harness.recorder.blocks;
    assert_eq!(blocks.len(), 1 + 65_536 + 1);
    let (first, newest) = (&blocks[1], &blocks[blocks.len() - 1]);
    assert!(first.block.is_none() && newest.block.is_some());
    assert_eq!(first.words.flags, Flags::FILLER.bits());
    assert_eq!(
        (first.words.window, newest.words.window),
        (lost - 65_536 + 1, lost + 1)
    );
    assert_eq!(newest.words.lost, u64::from(lost));
    let packed = device.harness.core.summary().packed;
    assert_eq!(
        (packed.received, packed.lost, packed.fillers),
        (2, u64::from(lost), 65_536)
    );
}

#[test]
fn the_rate_is_set_again_after_a_reconnection_and_after_a_restart() {
    let settings = Settings {
        packed_rate: Some(7),
        ..PACKED
    };
    let mut device = Packed::new(settings);
    let rates = |device: &Packed| {
        let commands = commands(&device.harness);
        commands.iter().filter(|name| **name == "set rate").count()
    };
    assert_eq!(rates(&device), 1);
    device.harness.core.disconnected();
    // The cable was at another host meanwhile.
    device.harness.board.rate = 3;
    device.harness.connect();
    assert_eq!((rates(&device), device.harness.board.rate), (2, 7));
    device.harness.board.reboot();
    device.harness.board.rate = 4;
    let hello = device.harness.board.hello();
    device.harness.receive(&hello);
    device.harness.exchange();
    assert_eq!((rates(&device), device.harness.board.rate), (3, 7));
}

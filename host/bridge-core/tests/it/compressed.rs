//! Compressed ADC samples must yield the same frames as samples sent plain.

use bridge_core::Settings;
use link::{BlockForm, CompressedRaw, Flags, Streams, ToHost};
use lossless::{Count, Encoder, EncoderState, Kind, MAX_SAMPLES};

use crate::recorder::{Harness, SETTINGS, fillers};
use crate::samples::{SAMPLES, counts, harness, send_samples, time};

const COMPRESSED: Settings = Settings { streams: Streams::from_bits(0b10_0111), ..SETTINGS };

/// A device that sends its ADC samples compressed.
struct Device {
    encoder: Encoder,
    state: EncoderState<64>,
}

impl Device {
    fn new() -> Device {
        Device { encoder: Encoder { key_blocks: 16 }, state: EncoderState::NEW }
    }

    /// Compresses eight samples, starting with sample `first`, and delivers their block to the
    /// bridge unless it is `lost`. Returns the form of the block.
    fn send(&mut self, harness: &mut Harness, first: u64, lost: bool) -> BlockForm {
        self.send_as(harness, first, first, lost)
    }

    /// Does the same as [`Self::send`], but with the values of the samples from `origin` on.
    fn send_as(&mut self, harness: &mut Harness, origin: u64, first: u64, lost: bool) -> BlockForm {
        let counts = counts(origin, 8, 64);
        let counts: Vec<Count> = counts.as_chunks().0.to_vec();
        let samples: Vec<[Count; 64]> = counts.as_chunks().0.to_vec();
        let mut room = [[[0; 3]; 64]; MAX_SAMPLES];
        let block = self.encoder.encode(&mut self.state, &samples, &mut room);
        let form = match block.kind {
            Kind::Verbatim => BlockForm::Verbatim,
            Kind::Key => BlockForm::Key,
            Kind::Continuing => BlockForm::Continuing,
        };
        let message = CompressedRaw {
            first_sample: first,
            channels: 64,
            flags: Flags::empty(),
            form,
            samples: 8,
            bytes: block.bytes,
        };
        let us = time(first + 7);
        harness.now_us = us.cast_signed();
        if !lost {
            harness.send(us, &ToHost::CompressedRaw(message));
        }
        form
    }
}

/// Checks that the status "loss" contains each key with its value.
#[track_caller]
fn assert_loss<const N: usize>(harness: &mut Harness, expected: [(&str, &str); N]) {
    for (key, value) in expected {
        assert_eq!(harness.figure("loss", key), value, "{key}");
    }
}

#[test]
fn compressed_samples_yield_the_frames_of_the_samples() {
    let (mut plain, mut compressed) = (harness(SAMPLES), harness(COMPRESSED));
    let mut device = Device::new();
    for block in 0..64 {
        send_samples(&mut plain, block * 8, Flags::empty());
        device.send(&mut compressed, block * 8, false);
    }
    assert_eq!(plain.recorder.raw.len(), 16);
    assert_eq!(compressed.recorder.raw, plain.recorder.raw);
}

#[test]
fn after_a_lost_block_fillers_replace_what_cannot_be_decoded_up_to_the_next_key_block() {
    let mut harness = harness(COMPRESSED);
    let mut device = Device::new();
    let mut key_blocks = Vec::new();
    for block in 0..64 {
        if device.send(&mut harness, block * 8, block == 20) == BlockForm::Key {
            key_blocks.push(block);
        }
    }
    assert_eq!(key_blocks, [0, 16, 32, 48]);
    assert_loss(
        &mut harness,
        [
            ("raw samples received", "416"),
            ("raw samples lost", "96"),
            ("raw samples undecodable", "88"),
        ],
    );
    // Fillers replace samples 160 to 255: the lost block, and the 11 blocks that continue from it.
    for (index, is_filler) in fillers(&harness.recorder.raw).into_iter().enumerate() {
        assert_eq!(is_filler, (160..256).contains(&index), "sample {index}");
    }
}

#[test]
fn damaged_blocks_and_unknown_forms_are_counted_and_the_next_key_block_is_decoded() {
    for (form, bytes) in [
        (BlockForm::Newer(9), &[0; 40][..]),
        (BlockForm::Key, &[0; 40]),
        (BlockForm::Verbatim, &[0; 40]),
    ] {
        let mut harness = harness(COMPRESSED);
        let message = CompressedRaw {
            first_sample: 0,
            channels: 64,
            flags: Flags::empty(),
            form,
            samples: 8,
            bytes,
        };
        harness.send(time(7), &ToHost::CompressedRaw(message));
        let mut device = Device::new();
        device.send(&mut harness, 8, false);
        device.send(&mut harness, 16, false);
        assert_loss(
            &mut harness,
            [
                ("raw samples messages malformed", "1"),
                ("raw samples received", "16"),
                ("raw samples lost", "8"),
            ],
        );
    }
}

#[test]
fn a_block_of_another_run_is_not_decoded_with_the_past_of_this_one() {
    let mut harness = harness(COMPRESSED);
    let mut device = Device::new();
    device.send(&mut harness, 0, false);
    // The first block after a restart is lost. By its index, the second one seems to continue from
    // the last block of the previous run.
    let mut restarted = Device::new();
    restarted.send(&mut harness, 1_600, true);
    let block = restarted.send_as(&mut harness, 1_608, 8, false);
    assert_eq!(block, BlockForm::Continuing);
    let expected = [("raw samples undecodable", "8"), ("raw samples received", "8")];
    assert_loss(&mut harness, expected);
}

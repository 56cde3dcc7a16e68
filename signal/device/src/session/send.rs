//! Messages without state of the session, each built and sent by one function.
//!
//! None of them is inlined, so that a task's stack frame does not hold several messages at once.

use link::{Ack, ClockReading, Event, ToHost};
use pipeline::{PackedCode, Quality};

use crate::audited_window::AuditedWindow;
use crate::compressed_chunk::CompressedChunk;
use crate::filtered_chunk::FilteredChunk;
use crate::marks::Marks;
use crate::message;
use crate::raw_chunk::RawChunk;
use crate::sender::{FrameQueue, Sender};

#[inline(never)]
pub(super) fn send_ack(ack: Ack, now_us: u64, sender: &mut Sender<impl FrameQueue>) {
    sender.send(now_us, &ToHost::Ack(ack));
}

#[inline(never)]
pub(super) fn send_clock_reading(
    reading: ClockReading,
    now_us: u64,
    sender: &mut Sender<impl FrameQueue>,
) {
    sender.send(now_us, &ToHost::ClockReading(reading));
}

#[inline(never)]
pub(super) fn send_packed_code(
    code: &PackedCode,
    marks: Marks,
    step_us: u64,
    sender: &mut Sender<impl FrameQueue>,
) {
    let message = message::packed_code(code, marks);
    sender.send(step_us, &ToHost::PackedCode(message));
}

#[inline(never)]
pub(super) fn send_quality(quality: &Quality, at_us: u64, sender: &mut Sender<impl FrameQueue>) {
    sender.send(at_us, &ToHost::Quality(message::quality(quality)));
}

#[inline(never)]
pub(super) fn send_audit(window: &AuditedWindow, at_us: u64, sender: &mut Sender<impl FrameQueue>) {
    let mut bytes = [0; pipeline::CodeValues::MAX_BYTES];
    sender.send(at_us, &ToHost::Audit(window.message(&mut bytes)));
}

#[inline(never)]
pub(super) fn send_raw(samples: &RawChunk, at_us: u64, sender: &mut Sender<impl FrameQueue>) {
    sender.send(at_us, &ToHost::Raw(samples.message()));
}

#[inline(never)]
pub(super) fn send_compressed(
    samples: &CompressedChunk,
    at_us: u64,
    sender: &mut Sender<impl FrameQueue>,
) {
    sender.send(at_us, &ToHost::CompressedRaw(samples.message()));
}

#[inline(never)]
pub(super) fn send_filtered(
    steps: &FilteredChunk,
    at_us: u64,
    sender: &mut Sender<impl FrameQueue>,
) {
    sender.send(at_us, &ToHost::Filtered(steps.message()));
}

#[inline(never)]
pub(super) fn send_event(event: Event, at_us: u64, sender: &mut Sender<impl FrameQueue>) {
    sender.send(at_us, &ToHost::Event(event));
}

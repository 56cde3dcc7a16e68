//! Queues between the tasks: the contents of their slots, and their sending and receiving ends.

use device::{
    AcquiredSample, AuditedWindow, CompressedChunk, FilteredChunk, Impedance, Marks, Output,
    Payload, RawChunk,
};
use embassy_sync::{
    blocking_mutex::raw::CriticalSectionRawMutex,
    zerocopy_channel::{Channel, Receiver, Sender},
};
use link::{Event, Exclusion};
use pipeline::{Code, Features, PackedCode, Quality};

/// Mutex that guards everything that tasks of different priorities share. Locking it disables
/// interrupts.
pub type RawMutex = CriticalSectionRawMutex;

/// What one slot of the queue from the acquisition to the encoder holds.
#[derive(Clone, Debug, Default)]
pub struct SampleSlot {
    /// The sample, with a step of the encoder if one is due.
    pub acquired: AcquiredSample,
    /// Time of the sample's DRDY edge, in ticks of the board's [`Clock`](crate::Clock).
    pub drdy_ticks: u32,
}

/// Sending end of the sample queue, which [`acquire`](fn@crate::acquire) holds.
pub type SampleSender = Sender<'static, RawMutex, SampleSlot>;
/// Receiving end of the sample queue, which [`encode`](fn@crate::encode) holds.
pub type SampleReceiver = Receiver<'static, RawMutex, SampleSlot>;

/// Slot of the queue from encoder to conversation: an output with small content. Large content is
/// in a [`BulkSlot`], which keeps the slots of codes small.
#[derive(Clone, Debug)]
pub struct OutputSlot {
    run: u32,
    at_us: u64,
    content: Content,
    /// Time at which the encoder queued the output, in ticks of the board's
    /// [`Clock`](crate::Clock).
    queued_ticks: u32,
}

#[derive(Clone, Debug)]
enum Content {
    /// The content is large: it is in the oldest slot of the bulk queue.
    Bulk,
    Code(Code, Marks),
    PackedCode(PackedCode, Marks),
    Features(Features, Marks),
    Event(Event),
    Exclusion(Exclusion),
}

/// Slot of the bulk queue: the content of a large output.
#[derive(Clone, Debug)]
#[allow(
    clippy::large_enum_variant,
    reason = "a slot has room for any variant; with few channels one is larger than the others"
)]
pub enum BulkSlot {
    /// Unfiltered samples, the content of [`Payload::Raw`].
    Raw(RawChunk),
    /// Unfiltered samples, compressed, the content of [`Payload::CompressedRaw`].
    CompressedRaw(CompressedChunk),
    /// Filtered steps, the content of [`Payload::Filtered`].
    Filtered(FilteredChunk),
    /// The planes of a window and its code, the content of [`Payload::Audit`].
    Audit(AuditedWindow),
    /// Signal quality of each electrode, the content of [`Payload::Quality`].
    Quality(Quality),
    /// Impedance of each electrode, the content of [`Payload::Impedance`].
    Impedance(Impedance),
}

impl OutputSlot {
    /// Slot that has not been used yet.
    pub const EMPTY: Self = Self { run: 0, at_us: 0, content: Content::Bulk, queued_ticks: 0 };
}

impl BulkSlot {
    /// Creates a slot that has not been used yet. A function, because a constant would store its
    /// zeros in flash.
    pub const fn empty() -> Self {
        Self::Raw(RawChunk::EMPTY)
    }

    const fn payload(&self) -> Payload<'_> {
        match self {
            Self::Raw(samples) => Payload::Raw(samples),
            Self::CompressedRaw(samples) => Payload::CompressedRaw(samples),
            Self::Filtered(steps) => Payload::Filtered(steps),
            Self::Audit(window) => Payload::Audit(window),
            Self::Quality(quality) => Payload::Quality(quality),
            Self::Impedance(impedance) => Payload::Impedance(impedance),
        }
    }
}

/// Sending end of the output queue, which [`encode`](fn@crate::encode) holds.
pub struct OutputSender {
    slots: Sender<'static, RawMutex, OutputSlot>,
    bulk: Sender<'static, RawMutex, BulkSlot>,
}

/// Receiving end of the output queue, which [`converse`](fn@crate::converse) holds.
pub struct OutputReceiver {
    slots: Receiver<'static, RawMutex, OutputSlot>,
    bulk: Receiver<'static, RawMutex, BulkSlot>,
    /// True if the output that was received last is in the bulk queue.
    is_bulk: bool,
}

/// Makes the two ends of the output queue from channels for its slots and its bulk slots.
pub fn output_queue(
    slots: &'static mut Channel<'static, RawMutex, OutputSlot>,
    bulk: &'static mut Channel<'static, RawMutex, BulkSlot>,
) -> (OutputSender, OutputReceiver) {
    let (slots_in, slots_out) = slots.split();
    let (bulk_in, bulk_out) = bulk.split();
    let sender = OutputSender { slots: slots_in, bulk: bulk_in };
    let receiver = OutputReceiver { slots: slots_out, bulk: bulk_out, is_bulk: false };
    (sender, receiver)
}

impl OutputSender {
    /// Queues a copy of an output; a large output takes a slot in both queues. Returns false if a
    /// queue is full.
    pub(crate) fn try_send(&mut self, output: &Output<'_>, queued_ticks: u32) -> bool {
        let Some(slot) = self.slots.try_send() else {
            return false;
        };
        let content = match output.payload {
            Payload::Code(code, marks) => Content::Code(*code, marks),
            Payload::PackedCode(code, marks) => Content::PackedCode(*code, marks),
            Payload::Features(features, marks) => Content::Features(*features, marks),
            Payload::Event(event) => Content::Event(event),
            Payload::Exclusion(exclusion) => Content::Exclusion(exclusion),
            payload => {
                // Queue the bulk content first, because the receiver of the slot needs it.
                let Some(bulk) = self.bulk.try_send() else {
                    return false;
                };
                match payload {
                    Payload::Raw(samples) => *bulk = BulkSlot::Raw(*samples),
                    Payload::CompressedRaw(samples) => *bulk = BulkSlot::CompressedRaw(*samples),
                    Payload::Filtered(steps) => *bulk = BulkSlot::Filtered(*steps),
                    Payload::Audit(window) => *bulk = BulkSlot::Audit(*window),
                    Payload::Quality(quality) => *bulk = BulkSlot::Quality(*quality),
                    Payload::Impedance(impedance) if cfg!(feature = "impedance") => {
                        *bulk = BulkSlot::Impedance(*impedance);
                    }
                    Payload::Code(..)
                    | Payload::PackedCode(..)
                    | Payload::Features(..)
                    | Payload::Event(_)
                    | Payload::Exclusion(_)
                    | Payload::Impedance(_) => {}
                }
                self.bulk.send_done();
                Content::Bulk
            }
        };
        *slot = OutputSlot { run: output.run, at_us: output.at_us, content, queued_ticks };
        self.slots.send_done();
        true
    }
}

impl OutputReceiver {
    /// Waits for the oldest output, and returns it with the time at which it was queued, in ticks
    /// of the board's [`Clock`](crate::Clock). The output stays queued until
    /// [`Self::receive_done`].
    pub async fn receive(&mut self) -> (Output<'_>, u32) {
        let slot = self.slots.receive().await;
        self.is_bulk = matches!(slot.content, Content::Bulk);
        let payload = match &slot.content {
            Content::Bulk => self.bulk.receive().await.payload(),
            Content::Code(code, marks) => Payload::Code(code, *marks),
            Content::PackedCode(code, marks) => Payload::PackedCode(code, *marks),
            Content::Features(features, marks) => Payload::Features(features, *marks),
            Content::Event(event) => Payload::Event(*event),
            Content::Exclusion(exclusion) => Payload::Exclusion(*exclusion),
        };
        let output = Output { run: slot.run, at_us: slot.at_us, payload };
        (output, slot.queued_ticks)
    }

    /// Removes the output that was received last.
    pub fn receive_done(&mut self) {
        if core::mem::take(&mut self.is_bulk) {
            self.bulk.receive_done();
        }
        self.slots.receive_done();
    }
}

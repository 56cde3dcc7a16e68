//! Encoder task, the least urgent task: produces codes and reports from the samples.

use core::sync::atomic::Ordering::Relaxed;

use device::{Encoders, Output, Producer, Slot};
use link::Stage;
use model::SUBSTITUTION;

use crate::{
    queues::{OutputSender, SampleReceiver},
    shared::{FILTERS, Shared},
};

/// Runs the encoder: produces, from the queued samples, every output that the host has requested.
pub async fn encode(
    shared: &Shared,
    (mut samples, mut outputs, producer): (
        SampleReceiver,
        OutputSender,
        &mut Producer<impl Encoders>,
    ),
) -> ! {
    loop {
        let slot = samples.receive().await;
        let start_ticks = shared.timing.now();
        let mut hand_over = |output: Output<'_>| {
            if !outputs.try_send(&output, shared.timing.now()) {
                shared.outputs_lost.fetch_add(1, Relaxed);
            }
            if output.payload.is_of_hop() {
                shared.timing.record(Stage::Code, slot.drdy_ticks);
            }
        };
        producer.set_rate(shared.rate());
        if SUBSTITUTION.is_some()
            && let Some(policy) = shared.exclusion.try_take()
        {
            producer.set_exclusion(policy);
        }
        if let Some(filters) = FILTERS.try_take() {
            producer.set_filters(filters);
        }
        // Queue the events that happened up to a sample before the sample's outputs. The exception
        // is the first sample of a run: it starts the run, so it is processed before its events.
        let starts_run = slot.acquired.new_run.is_some();
        if starts_run {
            shared.inputs.discard_before(slot.acquired.drdy_us);
        } else {
            producer.place_events(&slot.acquired, || shared.inputs.pop_event(), &mut hand_over);
        }
        let is_uploaded = (&shared.slot).with(|uploaded| {
            let uploaded = uploaded.weights();
            producer.process_with(uploaded.as_ref(), &slot.acquired, &mut hand_over);
        });
        if is_uploaded.is_none() {
            producer.process(&slot.acquired, &mut hand_over);
        }
        if starts_run {
            producer.place_events(&slot.acquired, || shared.inputs.pop_event(), &mut hand_over);
        }
        shared.clipped.store(producer.clipped(), Relaxed);
        if slot.acquired.step.is_some() {
            shared.timing.record(Stage::Step, start_ticks);
        }
        samples.receive_done();
        shared.progress.mark_encoded();
    }
}

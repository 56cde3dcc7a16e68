//! Acquisition task, the most urgent task: reads and filters every sample, and queues a step for
//! the encoder whenever a step is due.

use device::{Marks, Order, Run, fault_text};
use link::{SelfTest, Stage};
use model::ADC_RATE_HZ;
use pipeline::{Acquisition, Sample, Step};

use crate::{
    converter::{Conversion, Converter},
    queues::SampleSender,
    shared::Shared,
};

/// Runs the acquisition. Without an active run, samples are read and discarded.
///
/// The task waits only for the converter, and neither allocates nor logs. When the queue to the
/// encoder is full, the sample is dropped and counted as an overrun, and the next sample that is
/// queued carries an overrun mark.
pub async fn acquire(
    mut converter: impl Converter,
    shared: &Shared,
    (mut samples, acquisition): (SampleSender, &mut Acquisition),
) -> ! {
    let mut running: Option<Running> = None;
    let mut sample = Sample::default();
    publish_status(&converter, shared);
    let mut samples_until_status = ADC_RATE_HZ;
    loop {
        // With `cfg!` instead, the future would be part of images without the feature.
        #[cfg(any(test, feature = "impedance"))]
        converter.set_excitation(shared.is_excited()).await;
        let conversion = converter.next(&mut sample).await;
        shared.progress.mark_acquired();
        match shared.orders.try_take() {
            Some(Order::Start(run)) => {
                acquisition.restart(run.mains);
                running = Some(Running::new(run));
            }
            Some(Order::Stop) => running = None,
            Some(Order::SelfTest) => {
                running = None;
                converter.self_test(|| shared.progress.mark_acquired()).await;
                publish_self_test_result(&converter, shared);
                publish_status(&converter, shared);
            }
            // The conversation task executes these orders itself.
            Some(
                Order::Reset(_)
                | Order::SetRate(_)
                | Order::SetExclusion(_)
                | Order::SetImpedance(_),
            )
            | None => {}
        }
        samples_until_status -= 1;
        if samples_until_status == 0 {
            samples_until_status = ADC_RATE_HZ;
            publish_status(&converter, shared);
        }
        if let Some(running) = &mut running {
            shared.count_sample();
            shared.count_overruns(conversion.missed);
            if conversion.status_bad {
                shared.count_adc_status_bad();
            }
            let step = acquisition.process_sample(&sample);
            running.hand_over(&sample, step.as_ref(), &conversion, shared, &mut samples);
            shared.timing.record(Stage::Acquire, conversion.drdy_ticks);
        }
    }
}

/// Publishes the converters' status for the conversation task. Not inlined, to keep the status text
/// off the stack frame of the acquisition task.
#[inline(never)]
fn publish_status(converter: &impl Converter, shared: &Shared) {
    if let Some(status) = converter.status() {
        shared.converter_status.signal(status);
    }
}

/// Publishes the result of a self-test for the conversation task. Not inlined, to keep the result,
/// one kilobyte, off the stack frame of the acquisition task.
#[inline(never)]
fn publish_self_test_result(converter: &impl Converter, shared: &Shared) {
    let result = converter.self_test_result().unwrap_or_else(|| SelfTest {
        fault: fault_text("nothing was tested: the converters have no signals of their own"),
        ..SelfTest::default()
    });
    shared.self_test_result.signal(result);
}

/// State of the active run in the acquisition task.
struct Running {
    /// Settings of the run, until its first queued sample has passed them to the encoder; then
    /// `None`.
    start: Option<Run>,
    /// Samples read in the run.
    samples: u64,
    /// Steps produced in the run.
    steps: u64,
    /// Faults of the samples lost to a full queue since the last queued sample. The next queued
    /// sample carries them.
    lost: Marks,
}

impl Running {
    const fn new(run: Run) -> Self {
        Self { start: Some(run), samples: 0, steps: 0, lost: Marks::NONE }
    }

    /// Queues a sample and its step for the encoder; if the queue is full, counts an overrun.
    fn hand_over(
        &mut self,
        sample: &Sample,
        step: Option<&Step>,
        conversion: &Conversion,
        shared: &Shared,
        samples: &mut SampleSender,
    ) {
        let marks = Marks {
            overrun: conversion.missed > 0,
            adc_status_bad: conversion.status_bad,
            lead_off: conversion.lead_off,
            ..Marks::NONE
        };
        let (index, step_index) = (self.samples, self.steps);
        self.samples += 1;
        self.steps += u64::from(step.is_some());
        // Record progress even if the queue is full. A hung encoder leaves its queue full; without
        // this record, the watchdog check would take the encoder for idle.
        shared.progress.mark_handed_over();
        let Some(slot) = samples.try_send() else {
            shared.count_overruns(1);
            self.lost = self.lost.union(marks);
            self.lost.overrun = true;
            return;
        };
        let place = &mut slot.acquired;
        place.new_run = self.start.take();
        place.sample = *sample;
        place.index = index;
        place.step_index = step_index;
        place.step = step.copied();
        place.drdy_us = conversion.drdy_us;
        place.marks = marks;
        place.lost = core::mem::take(&mut self.lost);
        place.excited = cfg!(feature = "impedance") && conversion.excited;
        slot.drdy_ticks = conversion.drdy_ticks;
        samples.send_done();
    }
}

#[cfg(test)]
mod tests;

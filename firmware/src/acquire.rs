//! The most urgent task: takes every sample, and makes a step of it where one is due.

use device::{Marks, Order, Run};
use embassy_sync::zerocopy_channel::Sender;
use link::Stage;
use pipeline::{Acquisition, Sample, Step};

use crate::{Conversion, Converter, Mutex, Shared, Taken};

/// Takes samples for ever. While nothing streams they are read and forgotten.
///
/// Nothing here waits but for the converter, allocates or logs. Where the encoder has no room, the
/// sample is counted as an overrun, and the next one that is handed on says so.
pub async fn acquire(
    mut converter: impl Converter,
    shared: &Shared,
    mut taken: Sender<'_, Mutex, Taken>,
    acquisition: &mut Acquisition,
) -> ! {
    let mut running: Option<Running> = None;
    let mut sample = Sample::default();
    loop {
        let conversion = converter.next(&mut sample).await;
        shared.progress.acquired();
        match shared.orders.try_take() {
            Some(Order::Start(run)) => {
                acquisition.restart(run.mains);
                running = Some(Running::of(run));
            }
            Some(Order::Stop) => running = None,
            Some(Order::SelfTest | Order::Reset(_)) | None => {}
        }
        if let Some(running) = &mut running {
            shared.count_sample();
            shared.count_overruns(conversion.missed);
            if conversion.status_bad {
                shared.count_adc_status_bad();
            }
            running.marks.overrun |= conversion.missed > 0;
            running.marks.adc_status_bad |= conversion.status_bad;
            running.marks.lead_off |= conversion.lead_off;
            let step = acquisition.push(&sample);
            running.take(&sample, step.as_ref(), &conversion, shared, &mut taken);
            shared.timing.end(Stage::Acquire, conversion.drdy_ticks);
        }
    }
}

/// A stream that runs.
struct Running {
    /// Told to the encoder with the first sample that it has room for.
    begun: Option<Run>,
    /// Steps made since the start.
    steps: u64,
    /// Since the last sample that was handed on.
    marks: Marks,
}

impl Running {
    const fn of(run: Run) -> Self {
        Self {
            begun: Some(run),
            steps: 0,
            marks: Marks::NONE,
        }
    }

    fn take(
        &mut self,
        sample: &Sample,
        step: Option<&Step>,
        conversion: &Conversion,
        shared: &Shared,
        taken: &mut Sender<'_, Mutex, Taken>,
    ) {
        if let Some(step) = step {
            shared.count_clipped(step.clipped);
        }
        let index = self.steps;
        self.steps += u64::from(step.is_some());
        // Also where there is no room: an encoder that hangs has a full queue, and is not idle.
        shared.progress.handed_on();
        let Some(slot) = taken.try_send() else {
            shared.count_overruns(1);
            self.marks.overrun = true;
            return;
        };
        slot.begun = self.begun.take();
        slot.sample = *sample;
        slot.step = step.map(|step| (index, *step));
        slot.drdy_us = conversion.drdy_us;
        slot.drdy_ticks = conversion.drdy_ticks;
        slot.marks = core::mem::take(&mut self.marks);
        taken.send_done();
    }
}

//! The most urgent task: takes every sample, and makes a step of it where one is due.

use device::{Marks, Order, Run, fault_text};
use link::{SelfTest, Stage};
use pipeline::{Acquisition, Sample, Step};

use model::ADC_RATE_HZ;

use crate::{Conversion, Converter, Shared, StampedIn};

/// Takes samples for ever. While nothing streams they are read and forgotten.
///
/// Nothing here waits but for the converter, allocates or logs. Where the encoder has no room, the
/// sample is counted as an overrun, and the next one that is handed on says so.
pub async fn acquire(
    mut converter: impl Converter,
    shared: &Shared,
    (mut taken, acquisition): (StampedIn, &mut Acquisition),
) -> ! {
    let mut running: Option<Running> = None;
    let mut sample = Sample::default();
    tell(&converter, shared);
    let mut until_told = ADC_RATE_HZ;
    loop {
        let conversion = converter.next(&mut sample).await;
        shared.progress.acquired();
        match shared.orders.try_take() {
            Some(Order::Start(run)) => {
                acquisition.restart(run.mains);
                running = Some(Running::of(run));
            }
            Some(Order::Stop) => running = None,
            Some(Order::SelfTest) => {
                running = None;
                converter.self_test(|| shared.progress.acquired()).await;
                tell_of_self_test(&converter, shared);
                tell(&converter, shared);
            }
            Some(Order::Reset(_)) | None => {}
        }
        until_told -= 1;
        if until_told == 0 {
            until_told = ADC_RATE_HZ;
            tell(&converter, shared);
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
            let step = push(acquisition, &sample);
            running.take(&sample, step.as_ref(), &conversion, shared, &mut taken);
            shared.timing.end(Stage::Acquire, conversion.drdy_ticks);
        }
    }
}

/// The filters, apart from the board's task, which is compiled to be small.
#[inline(never)]
fn push(acquisition: &mut Acquisition, sample: &Sample) -> Option<Step> {
    acquisition.process_sample(sample)
}

/// Leaves a note of how the converters are; its text stays off the task's frame.
#[inline(never)]
fn tell(converter: &impl Converter, shared: &Shared) {
    if let Some(state) = converter.state() {
        shared.converters.signal(state);
    }
}

/// Leaves the result of a self-test, which is a kilobyte, without a place in the task's frame.
#[inline(never)]
fn tell_of_self_test(converter: &impl Converter, shared: &Shared) {
    let tested = converter.tested().unwrap_or_else(|| SelfTest {
        fault: fault_text("nothing was tested: the converters have no signals of their own"),
        ..SelfTest::default()
    });
    shared.self_test.signal(tested);
}

/// A stream that runs.
struct Running {
    /// Told to the encoder with the first sample that it has room for.
    begun: Option<Run>,
    /// Samples taken since the start.
    samples: u64,
    /// Steps made of them.
    steps: u64,
    /// Since the last sample that was handed on.
    marks: Marks,
}

impl Running {
    const fn of(run: Run) -> Self {
        Self {
            begun: Some(run),
            samples: 0,
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
        taken: &mut StampedIn,
    ) {
        if let Some(step) = step {
            shared.count_clipped(step.clipped);
        }
        let (index, step_index) = (self.samples, self.steps);
        self.samples += 1;
        self.steps += u64::from(step.is_some());
        // Also where there is no room: an encoder that hangs has a full queue, and is not idle.
        shared.progress.handed_on();
        let Some(slot) = taken.try_send() else {
            shared.count_overruns(1);
            self.marks.overrun = true;
            return;
        };
        let place = &mut slot.taken;
        place.begun = self.begun.take();
        place.sample = *sample;
        place.index = index;
        place.step = step.map(|step| (step_index, *step));
        place.drdy_us = conversion.drdy_us;
        place.marks = core::mem::take(&mut self.marks);
        slot.drdy_ticks = conversion.drdy_ticks;
        taken.send_done();
    }
}

#[cfg(test)]
mod tests;

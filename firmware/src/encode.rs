//! The least urgent task: the encoder, and what each electrode delivers.

use core::sync::atomic::Ordering::Relaxed;

use device::Marks;
use embassy_sync::zerocopy_channel::{Receiver, Sender};
use link::Stage;
use model::{HOP, STEPS};
use pipeline::{Encoder, SignalQuality, Step};

use crate::{Made, Mutex, Shared, Taken};

/// Turns steps into codes for ever.
///
/// A step for which there was no room is filled in by the one before it, so that a window's index
/// stays that of its time; its codes are marked.
pub async fn encode(
    shared: &Shared,
    mut taken: Receiver<'_, Mutex, Taken>,
    mut made: Sender<'_, Mutex, Made>,
    encoder: &mut Encoder<'static>,
    quality: &mut SignalQuality,
) -> ! {
    let mut windows = Windows::default();
    loop {
        let item = taken.receive().await;
        if let Some(run) = item.begun {
            encoder.restart();
            quality.restart(run.mains);
            windows = Windows {
                run: run.number,
                ..Windows::default()
            };
        }
        windows.mark(item.marks);
        if let Some((index, step)) = &item.step {
            while windows.step < *index {
                let substitute = windows.last;
                windows.mark(Marks {
                    overrun: true,
                    ..Marks::default()
                });
                windows.push(encoder, &substitute, item, shared, &mut made);
            }
            windows.push(encoder, step, item, shared, &mut made);
        }
        let step = item.step.as_ref().map(|(_, step)| step);
        if let Some(quality) = quality.push(&item.sample, step) {
            let report = Made::Quality {
                run: windows.run,
                quality,
                at_us: item.drdy_us,
            };
            hand_on(shared, &mut made, report);
        }
        taken.receive_done();
        shared.progress.encoded();
    }
}

/// What is known of the windows that are open.
#[derive(Default)]
struct Windows {
    run: u32,
    /// Index of the next step.
    step: u64,
    last: Step,
    /// What went wrong in each of the last hops, the newest first.
    marks: [Marks; STEPS.div_ceil(HOP)],
}

impl Windows {
    fn mark(&mut self, marks: Marks) {
        self.marks[0] = either(self.marks[0], marks);
    }

    fn push(
        &mut self,
        encoder: &mut Encoder<'static>,
        step: &Step,
        item: &Taken,
        shared: &Shared,
        made: &mut Sender<'_, Mutex, Made>,
    ) {
        self.last = *step;
        self.step += 1;
        let begin = shared.timing.now();
        let code = encoder.push(step);
        shared.timing.end(Stage::Step, begin);
        if let Some(code) = code {
            let marks = self.marks.into_iter().fold(Marks::default(), either);
            let code = Made::Code {
                run: self.run,
                step_us: item.drdy_us + u64::from(code.offset_us),
                made_ticks: shared.timing.now(),
                code,
                marks,
            };
            hand_on(shared, made, code);
            shared.timing.end(Stage::Code, item.drdy_ticks);
        }
        if self.step.is_multiple_of(HOP as u64) {
            self.marks.rotate_right(1);
            self.marks[0] = Marks::default();
        }
    }
}

const fn either(a: Marks, b: Marks) -> Marks {
    Marks {
        adc_status_bad: a.adc_status_bad | b.adc_status_bad,
        lead_off: a.lead_off | b.lead_off,
        overrun: a.overrun | b.overrun,
    }
}

fn hand_on(shared: &Shared, made: &mut Sender<'_, Mutex, Made>, what: Made) {
    if let Some(slot) = made.try_send() {
        *slot = what;
        made.send_done();
    } else {
        shared.made_lost.fetch_add(1, Relaxed);
    }
}

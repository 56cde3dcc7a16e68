//! The least urgent task: the encoder, and what else the host wants of the samples.

use core::sync::atomic::Ordering::Relaxed;

use device::{Output, Payload, Producer};
use link::Stage;

use crate::{HandedIn, Shared, StampedOut};

/// Makes of samples and steps what the host wants, for ever.
pub async fn encode(
    shared: &Shared,
    (mut taken, mut made, producer): (StampedOut, HandedIn, &mut Producer),
) -> ! {
    loop {
        let item = taken.receive().await;
        let begin = shared.timing.now();
        let mut hand_on = |what: Output| {
            let is_code = matches!(what.payload, Payload::Code(..));
            hand_on(shared, &mut made, what);
            if is_code {
                shared.timing.end(Stage::Code, item.drdy_ticks);
            }
        };
        // Events first: what is made of the sample says how the input stood. A run must have begun.
        let begins = item.taken.new_run.is_some();
        if begins {
            shared.inputs.forget_before(item.taken.drdy_us);
        } else {
            producer.place_events(&item.taken, || shared.inputs.next(), &mut hand_on);
        }
        producer.process(&item.taken, &mut hand_on);
        if begins {
            producer.place_events(&item.taken, || shared.inputs.next(), &mut hand_on);
        }
        if item.taken.step.is_some() {
            shared.timing.end(Stage::Step, begin);
        }
        taken.receive_done();
        shared.progress.encoded();
    }
}

fn hand_on(shared: &Shared, made: &mut HandedIn, what: Output) {
    if let Some(slot) = made.try_send() {
        slot.made = what;
        slot.ticks = shared.timing.now();
        made.send_done();
    } else {
        shared.made_lost.fetch_add(1, Relaxed);
    }
}

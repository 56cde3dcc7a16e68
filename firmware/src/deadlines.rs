//! What is due when: every rate, deadline, priority and depth of a queue, with where it comes from.

use embassy_time::Duration;
use model::{ADC_RATE_HZ, HOP, STEP_RATE_HZ};

/// From one sample to the next: a sample must be taken, filtered and handed on before the next DRDY.
/// 1.953 ms at 512 Hz.
pub const SAMPLE: Duration = Duration::from_micros(1_000_000 / ADC_RATE_HZ as u64);

/// From one step to the next: what the encoder does with a step must be done before the next.
/// 7.8125 ms.
pub const STEP: Duration = Duration::from_micros(1_000_000 / STEP_RATE_HZ as u64);

/// From one code to the next: 62.5 ms with a hop of 8 steps.
pub const CODE: Duration = Duration::from_micros(HOP as u64 * 1_000_000 / STEP_RATE_HZ as u64);

/// Interrupt priorities, smaller is more urgent, in the 16 levels of an STM32 (4 bits).
///
/// Rate-monotonic (the shorter the period, the more urgent), except for the time driver, which comes first
/// because everything that reads the time relies on its count. Of the interrupts only the port's have a
/// priority between those of the tasks, so that a host cannot delay a sample.
pub mod priority {
    /// Time driver: counts half periods of 32.768 ms and wakes what waits for an alarm. Above everything
    /// that reads the time, so that no reader can hold up a count; some 100 instructions.
    pub const TIME: u8 = 1;
    /// DRDY's edge and the transfer that it starts: the stamp is taken here.
    pub const DRDY: u8 = 2;
    /// The task that takes samples.
    pub const ACQUIRE: u8 = 3;
    /// An edge of the trigger: a timer has stamped it already, so that it may wait for a sample; the
    /// timer keeps one edge, so that it does not wait for anything slower.
    pub const TRIGGER: u8 = 4;
    /// USB and UART, and the tasks that converse with the host.
    pub const CONVERSE: u8 = 6;
    /// The encoder: longest work, longest deadline.
    pub const ENCODE: u8 = 14;
}

/// Samples that wait for the encoder at most: four steps at 512 Hz. An encoder that is later than
/// that loses samples, which is counted and flagged.
pub const SAMPLES_WAITING: usize = 16;

/// Codes and reports that wait for the conversation at most; it is more urgent than the encoder, so
/// that one would do.
pub const MADE_WAITING: usize = 4;

/// Events at the inputs that wait for the sample after them, at most: a trigger that bounces for that
/// long has told what it had to tell.
pub const EVENTS_WAITING: usize = 16;

/// Edges of the trigger that are looked at between two samples, at most: more have no room to wait. The
/// rest, of a line that bounces or floats, costs no time: an edge takes some 300 instructions, 16 of them
/// 30 us of [`SAMPLE`] at 168 MHz, reckoned.
pub const TRIGGER_EDGES: usize = EVENTS_WAITING;

/// From the last sample of any converter, or the end of the last attempt, until all converters are reset
/// and set up again. An attempt loses nothing then, and an analogue board whose supply comes late is in use
/// within seconds.
pub const CONVERTERS_RETRY: Duration = Duration::from_secs(5);

/// From an order to start anew until the device does: time for the answer to go out.
pub const FAREWELL: Duration = Duration::from_millis(100);

/// Bytes of frames that wait for the host: 3 s of codes and reports. Raw samples may take three quarters
/// of it, 90 ms; a host that looks away for longer loses samples, and codes only after a second.
pub const FRAMES_WAITING: usize = 12_288;

/// A task that has made no progress for so long has hung: the watchdog is not fed any more. Eight
/// steps.
pub const PROGRESS: Duration = CODE;

/// The watchdog resets the device when it has not been fed for so long, by the nominal frequency of its
/// oscillator, [`LSI_HZ`]: it is 136 to 376 ms on an STM32F446 and 190 to 218 ms on an STM32H743.
pub const WATCHDOG: Duration = Duration::from_millis(200);

/// The oscillator of an STM32's watchdog, nominal, and at its fastest: 17 to 47 kHz on an STM32F446
/// (DS10693, LSI), 29.4 to 33.6 on an STM32H743 (DS12110, LSI).
const LSI_HZ: u64 = 32_000;
const LSI_FASTEST_HZ: u64 = 47_000;

const _: () = {
    assert!(SAMPLE.as_micros() < STEP.as_micros());
    // A task that makes progress just after a check is seen to have done so at the next check but one.
    assert!(2 * PROGRESS.as_micros() * LSI_FASTEST_HZ < WATCHDOG.as_micros() * LSI_HZ);
    assert!(
        priority::TIME < priority::DRDY
            && priority::DRDY < priority::ACQUIRE
            && priority::ACQUIRE < priority::TRIGGER
            && priority::TRIGGER < priority::CONVERSE
            && priority::CONVERSE < priority::ENCODE
    );
};

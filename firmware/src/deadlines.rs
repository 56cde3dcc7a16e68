//! All periods, deadlines, interrupt priorities and queue depths, each with its derivation.

use embassy_time::Duration;
use model::{ADC_RATE_HZ, HOP, STEP_RATE_HZ};

/// Sample period, 1.953 ms at 512 Hz, within which a sample must be read, filtered and queued.
pub const SAMPLE: Duration = Duration::from_micros(1_000_000 / ADC_RATE_HZ as u64);

/// Step period, 7.8125 ms, within which the encoder must finish a step.
pub const STEP: Duration = Duration::from_micros(1_000_000 / STEP_RATE_HZ as u64);

/// Code period, 62.5 ms at a hop of 8 steps, within which the port must accept a code.
pub const CODE: Duration = Duration::from_micros(HOP as u64 * 1_000_000 / STEP_RATE_HZ as u64);

/// Interrupt priorities, 0 to 15 as on an STM32 (4 bits); a smaller number is more urgent.
///
/// The shorter the period of an interrupt or task, the more urgent it is (rate-monotonic). Only the
/// time driver comes before all others, because everything that reads the time relies on its count.
/// The interrupts of trigger and port are less urgent than the acquisition task, so that neither a
/// trigger signal nor a host can delay a sample.
pub mod priority {
    /// Time driver: counts half periods of its 16-bit timer, 32.768 ms each, and serves alarms, in
    /// some 100 instructions. More urgent than all readers of the time, so that none can delay a
    /// count.
    pub const TIME: u8 = 1;
    /// Interrupt at the DRDY edge, which takes the sample's time stamp, and interrupts of the DMA
    /// that then transfers the sample.
    pub const DRDY: u8 = 2;
    /// Acquisition task, which must be ready for the next sample within a sample period.
    pub const ACQUIRE: u8 = 3;
    /// Interrupt at a trigger edge. A timer has already captured the time of the edge, so the
    /// interrupt may wait for the acquisition task. The timer holds only one edge, so the interrupt
    /// must not wait for a slower task.
    pub const TRIGGER: u8 = 4;
    /// Interrupts of USB or of the UART, and the conversation task.
    pub const CONVERSE: u8 = 6;
    /// Encoder task, the task with the longest execution time; everything else may interrupt it.
    pub const ENCODE: u8 = 14;
}

/// Depth of the queue from acquisition to encoder, samples: four steps at 512 Hz, two at 1024 Hz.
/// When the encoder falls further behind, samples are dropped, counted and flagged.
pub const SAMPLES_WAITING: usize = 16;

/// Depth of the queue from encoder to conversation. One slot would be enough, because the
/// conversation preempts the encoder; the others are spare.
pub const OUTPUTS_WAITING: usize = 4;

/// Depth of the bulk queue, which holds the content of large outputs. One slot is enough, because
/// the conversation preempts the encoder and empties the slot.
pub const BULK_WAITING: usize = 1;

/// Depth of the queue of trigger events, which the encoder empties with every sample. Only a
/// bouncing trigger can fill the queue, and the edges that are then dropped carry no information.
pub const EVENTS_WAITING: usize = 16;

/// Largest number of trigger edges handled between two samples; the event queue holds no more. A
/// line that bounces or floats therefore costs a limited time: an edge takes some 300 instructions,
/// so 16 edges take 30 us of [`SAMPLE`] at 168 MHz (estimated).
pub const TRIGGER_EDGES: usize = EVENTS_WAITING;

/// Pause before another attempt to reset and set up all converters. It begins with the last valid
/// sample of any converter, or with the end of the previous attempt. So an attempt interrupts no
/// converter that still delivers samples, and an analogue board that is powered late works within
/// seconds.
pub const CONVERTERS_RETRY: Duration = Duration::from_secs(5);

/// Delay between the reply to a reset command and the reset, so that the reply reaches the host.
pub const DRAIN_TIMEOUT: Duration = Duration::from_millis(100);

/// Size of the buffer for frames that wait for the host, bytes: with the built-in model 3 s of
/// codes and reports. Raw samples may fill three quarters of the buffer; with this model, they do
/// so in 90 ms. If a host pauses for longer, raw samples are dropped at once, but codes only after
/// another second.
pub const FRAME_BYTES_WAITING: usize = 12_288;

/// Period of the progress check: eight steps, whatever the model's hop. If a task makes no progress
/// for this time, it has hung, and the watchdog is no longer fed.
pub const PROGRESS: Duration = Duration::from_micros(8 * 1_000_000 / STEP_RATE_HZ as u64);

/// Period of the watchdog at the nominal 32 kHz of its oscillator (LSI). Over the frequency range
/// of the oscillator, the period is 136 to 376 ms on an STM32F446 and 190 to 218 ms on an
/// STM32H743.
pub const WATCHDOG: Duration = Duration::from_millis(200);

/// Period of the watchdog from the start of the image until every task has made progress once: 4096
/// counts, each of 32 periods of the watchdog's oscillator. The clocks take half a second at most,
/// the converters 1.4 s.
pub const START_UP: Duration = Duration::from_micros(4_096 * 32 * 1_000_000 / LSI_HZ);

/// Nominal frequency of the watchdog's oscillator, Hz. Its range is 17 to 47 kHz on an STM32F446
/// (DS10693, LSI) and 29.4 to 33.6 kHz on an STM32H743 (DS12110, LSI).
const LSI_HZ: u64 = 32_000;
/// Highest frequency of the watchdog's oscillator on either chip, Hz.
const LSI_FASTEST_HZ: u64 = 47_000;

const _: () = {
    assert!(SAMPLE.as_micros() < STEP.as_micros());
    assert!(START_UP.as_micros() * LSI_HZ / LSI_FASTEST_HZ > 2_500_000);
    // Up to two periods of the progress check pass between two feeds, and even the fastest watchdog
    // must not expire in this time.
    assert!(2 * PROGRESS.as_micros() * LSI_FASTEST_HZ < WATCHDOG.as_micros() * LSI_HZ);
    assert!(
        priority::TIME < priority::DRDY
            && priority::DRDY < priority::ACQUIRE
            && priority::ACQUIRE < priority::TRIGGER
            && priority::TRIGGER < priority::CONVERSE
            && priority::CONVERSE < priority::ENCODE
    );
};

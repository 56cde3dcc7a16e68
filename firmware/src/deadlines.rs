//! All rates, deadlines, interrupt priorities and queue depths, each with its derivation.

use embassy_time::Duration;
use model::{ADC_RATE_HZ, HOP, STEP_RATE_HZ};

/// Sample period, 1.953 ms at 512 Hz: a sample must be taken, filtered and handed over before the next
/// DRDY.
pub const SAMPLE: Duration = Duration::from_micros(1_000_000 / ADC_RATE_HZ as u64);

/// Step period, 7.8125 ms: the encoder must finish a step before the next one is due.
pub const STEP: Duration = Duration::from_micros(1_000_000 / STEP_RATE_HZ as u64);

/// Code period, 62.5 ms with a hop of 8 steps.
pub const CODE: Duration = Duration::from_micros(HOP as u64 * 1_000_000 / STEP_RATE_HZ as u64);

/// Interrupt priorities in the 16 levels of an STM32 (4 bits); a smaller number is more urgent.
///
/// Rate-monotonic (the shorter the period, the more urgent), except for the time driver, which comes first
/// because everything that reads the time relies on its count. Of the interrupts only the port's have a
/// priority between those of the tasks, so that a host cannot delay a sample.
pub mod priority {
    /// Time driver: counts half periods of 32.768 ms and serves alarms, in some 100 instructions. Above
    /// everything that reads the time, so that no reader can delay a count.
    pub const TIME: u8 = 1;
    /// DRDY edge, which takes the sample's time stamp, and the DMA transfer that it starts.
    pub const DRDY: u8 = 2;
    /// Acquisition task.
    pub const ACQUIRE: u8 = 3;
    /// Edge of the trigger. A timer has captured its time, so it can wait for a sample; the timer holds only
    /// one edge, so it must not wait for anything slower.
    pub const TRIGGER: u8 = 4;
    /// USB and UART interrupts, and the task that talks to the host.
    pub const CONVERSE: u8 = 6;
    /// Encoder task: longest execution time, longest deadline.
    pub const ENCODE: u8 = 14;
}

/// Depth of the queue from acquisition to encoder: 16 samples, or four steps at 512 Hz. When the encoder
/// falls further behind, samples are dropped, counted and flagged.
pub const SAMPLES_WAITING: usize = 16;

/// Depth of the queue from encoder to conversation. A depth of one would do, because the conversation
/// preempts the encoder.
pub const OUTPUTS_WAITING: usize = 4;

/// Depth of the event queue, which is emptied with every sample. Only a bouncing trigger fills it, and its
/// further edges carry no information.
pub const EVENTS_WAITING: usize = 16;

/// Trigger edges handled between two samples; the event queue holds no more. Further edges of a line that
/// bounces or floats cost no time: an edge takes some 300 instructions, and 16 of them 30 us of [`SAMPLE`]
/// at 168 MHz (estimated).
pub const TRIGGER_EDGES: usize = EVENTS_WAITING;

/// Pause before all converters are reset and set up again. It begins with the last sample of any converter,
/// or with the end of the last attempt. After such a pause no samples arrive that an attempt could interrupt,
/// and an analogue board that is powered late works within seconds.
pub const CONVERTERS_RETRY: Duration = Duration::from_secs(5);

/// Delay between a reset command and the reset, so that the answer reaches the host.
pub const DRAIN_TIMEOUT: Duration = Duration::from_millis(100);

/// Bytes of frames that wait for the host: 3 s of codes and reports. Raw samples can take three quarters of
/// these bytes, which is 90 ms. A host that pauses for longer loses samples at once, and codes only after a
/// second.
pub const FRAME_BYTES_WAITING: usize = 12_288;

/// Period of the progress check: a task without progress for that long, eight steps, has hung, and the
/// watchdog is no longer fed.
pub const PROGRESS: Duration = CODE;

/// Period of the watchdog at the nominal 32 kHz of its oscillator (LSI). Over the oscillator's range that is
/// 136 to 376 ms on an STM32F446 and 190 to 218 ms on an STM32H743.
pub const WATCHDOG: Duration = Duration::from_millis(200);

/// Nominal frequency of the watchdog's oscillator, Hz. Its range is 17 to 47 kHz on an STM32F446 (DS10693,
/// LSI) and 29.4 to 33.6 kHz on an STM32H743 (DS12110, LSI).
const LSI_HZ: u64 = 32_000;
/// Highest frequency of the watchdog's oscillator on either chip, Hz.
const LSI_FASTEST_HZ: u64 = 47_000;

const _: () = {
    assert!(SAMPLE.as_micros() < STEP.as_micros());
    // Up to two progress checks pass between two feeds. In this time the fastest watchdog must not expire.
    assert!(2 * PROGRESS.as_micros() * LSI_FASTEST_HZ < WATCHDOG.as_micros() * LSI_HZ);
    assert!(
        priority::TIME < priority::DRDY
            && priority::DRDY < priority::ACQUIRE
            && priority::ACQUIRE < priority::TRIGGER
            && priority::TRIGGER < priority::CONVERSE
            && priority::CONVERSE < priority::ENCODE
    );
};

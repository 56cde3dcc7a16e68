//! Selects the source of the core's clock at start: the clock at the HSE input if it runs and the
//! board knows its frequency, otherwise the internal oscillator.

use core::ops::RangeInclusive;

#[cfg(target_os = "none")]
use {cortex_m::asm, embassy_stm32::pac::RCC};

/// Oscillator from which all clocks of the chip are derived.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClockSource {
    /// 8 MHz from the ST-LINK, at the HSE input: half of the ST-LINK's own RC oscillator.
    StLink,
    /// 8.33 MHz from the ST-LINK, at the HSE input: a third of the ST-LINK's crystal.
    StLinkCrystal,
    /// Crystal of the board, at the HSE oscillator.
    Crystal,
    /// Internal RC oscillator (HSI), because there is no clock at the HSE input.
    NoClock,
    /// Internal RC oscillator (HSI), because the frequency of the clock at the HSE input is not
    /// supported.
    OtherClock,
}

/// What is connected to the HSE pins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HseInput {
    /// A clock, which bypasses the oscillator.
    Clock,
    /// A crystal or ceramic resonator.
    Crystal,
}

/// Timer that captures its own count at edges of HSE.
pub trait HseTimer {
    /// Starts the timer, which then captures its count at each 8th edge of HSE / [`HSE_DIVIDER`].
    fn start(&mut self);

    /// Returns the newest captured count, if there is one since the last call.
    fn capture(&mut self) -> Option<u16>;

    /// Stops the timer and switches its clock off.
    fn stop(&mut self);
}

/// Factor by which the chip divides HSE for the timer (RCC_CFGR.RTCPRE).
pub const HSE_DIVIDER: u8 = 16;

/// Periods of HSE between two captures.
const CAPTURE_PERIODS: u32 = 8 * HSE_DIVIDER as u32;

/// Number of captures per measurement; all of them take 0.3 ms at 8 MHz.
const CAPTURES: u32 = 16;

/// Number of polls after which a capture counts as missing. Each poll takes at least one core
/// cycle.
const CAPTURE_POLLS: u32 = 100_000;

/// Clock at the HSE input from which a board can derive all others, and the range of frequencies in
/// Hz that counts as this clock, measured with the chip's own oscillator.
pub type KnownClock = (ClockSource, RangeInclusive<u32>);

/// Time limit for the clock at the HSE input to start, ms. The start-up time of the ST-LINK, which
/// supplies the clock, is not specified. Only a board without a clock waits for the whole time.
const TIMEOUT_MS: u32 = 500;

impl ClockSource {
    /// Returns the clock at the HSE input if it starts within 500 ms and is in `known`, otherwise
    /// the internal oscillator. `core_hz` is the clock of core and timer after a reset. Replaces
    /// embassy's own wait for the clock, which has no time limit.
    #[cfg(target_os = "none")]
    pub fn find(
        core_hz: u32,
        input: HseInput,
        timer: &mut impl HseTimer,
        known: &[KnownClock],
    ) -> Self {
        // Set HSEBYP first: it can be set only while HSE is off (RM0433, RM0390 and RM0090,
        // RCC_CR).
        RCC.cr().modify(|control| control.set_hsebyp(input == HseInput::Clock));
        RCC.cr().modify(|control| control.set_hseon(true));
        let is_ready = || RCC.cr().read().hserdy();
        let source = if poll_until(TIMEOUT_MS, is_ready, || asm::delay(core_hz / 1_000)) {
            Self::of_frequency(measure(core_hz, timer), known)
        } else {
            Self::NoClock
        };
        if !source.is_hse() {
            RCC.cr().modify(|control| control.set_hseon(false));
        }
        source
    }

    /// Returns the source in `known` whose range contains the measured frequency, or `OtherClock`.
    fn of_frequency(measured_hz: Option<u32>, known: &[KnownClock]) -> Self {
        let is_it = |(_, range): &&KnownClock| measured_hz.is_some_and(|hz| range.contains(&hz));
        known.iter().find(is_it).map_or(Self::OtherClock, |(source, _)| *source)
    }

    /// Returns whether the source is the clock at the HSE input.
    pub const fn is_hse(self) -> bool {
        matches!(self, Self::StLink | Self::StLinkCrystal | Self::Crystal)
    }

    /// Returns the name of the source for the log.
    #[cfg(target_os = "none")]
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::StLink => "8 MHz from the ST-LINK",
            Self::StLinkCrystal => "8.33 MHz from the ST-LINK",
            Self::Crystal => "the board's crystal",
            Self::NoClock | Self::OtherClock => "the chip's own oscillator",
        }
    }

    /// Returns the fault text for `Hello`, which is empty if the clock at the HSE input is used.
    pub(crate) const fn fault(self) -> &'static str {
        match self {
            Self::StLink | Self::StLinkCrystal | Self::Crystal => "",
            Self::NoClock => {
                "no clock at the HSE input: the board runs from the chip's own oscillator, device times \
                 are off by up to some per cent, and USB, if any, is out of tolerance; check the crystal, \
                 or the ST-LINK's supply and firmware"
            }
            Self::OtherClock => {
                "the clock at the HSE input has a frequency that this board does not know: it runs from \
                 the chip's own oscillator, device times are off by up to some per cent, and USB, \
                 if any, is out of tolerance; docs/hardware.md says which frequencies it knows"
            }
        }
    }
}

/// Measures HSE against the timer's clock of `timer_hz`. Returns the frequency in Hz, with a
/// resolution of 0.1 % at 64 MHz and 0.4 % at 16 MHz; `None` if a capture is missing. Uses the
/// shortest interval between captures: a late poll misses captures, which lengthens an interval.
fn measure(timer_hz: u32, timer: &mut impl HseTimer) -> Option<u32> {
    timer.start();
    let mut next = || (0..CAPTURE_POLLS).find_map(|_| timer.capture());
    // Start from the second capture: the first can date from before the start of the timer.
    let mut last = next().and_then(|_| next());
    let mut shortest = None;
    for _ in 0..CAPTURES {
        let count = next();
        let interval = last.zip(count).map(|(last, count)| count.wrapping_sub(last));
        // A missing capture is `None`, which is less than any interval, so the result is `None`.
        shortest = shortest.map_or(Some(interval), |shortest| Some(interval.min(shortest)));
        last = count;
    }
    timer.stop();
    let edges = u64::from(CAPTURE_PERIODS) * u64::from(timer_hz);
    u32::try_from(edges.checked_div(shortest.flatten()?.into())?).ok()
}

/// Calls `pause` until `is_ready()`, at most `pauses` times. Returns the last `is_ready()`.
fn poll_until(pauses: u32, mut is_ready: impl FnMut() -> bool, mut pause: impl FnMut()) -> bool {
    for _ in 0..pauses {
        if is_ready() {
            return true;
        }
        pause();
    }
    is_ready()
}

#[cfg(test)]
mod tests {
    use core::cell::Cell;

    use super::*;

    /// Waits for a clock that becomes ready after `until_ready` ms. Returns the milliseconds
    /// waited, and whether the clock became ready.
    fn waited(until_ready: u32) -> (u32, bool) {
        let waited = Cell::new(0);
        let is_ready = || waited.get() >= until_ready;
        let came = poll_until(TIMEOUT_MS, is_ready, || waited.update(|ms| ms + 1));
        (waited.get(), came)
    }

    #[test]
    fn a_late_clock_is_found_and_a_missing_one_costs_half_a_second() {
        assert_eq!(waited(0), (0, true));
        assert_eq!(waited(20), (20, true));
        assert_eq!(waited(TIMEOUT_MS), (TIMEOUT_MS, true));
        assert_eq!(waited(u32::MAX), (TIMEOUT_MS, false));
    }

    /// Simulated timer with a clock of `timer_hz`, which captures the edges of an HSE of `hse_hz`.
    struct Captures {
        timer_hz: u64,
        hse_hz: u64,
        number: u64,
        /// Number of the capture that is missed because no poll comes in time.
        lost: u64,
    }

    impl HseTimer for Captures {
        fn start(&mut self) {}

        fn capture(&mut self) -> Option<u16> {
            self.number += u64::from(self.hse_hz > 0);
            self.number += u64::from(self.number == self.lost);
            let edges = self.number * u64::from(CAPTURE_PERIODS);
            let count = (edges * self.timer_hz).checked_div(self.hse_hz)?;
            Some((count & 0xFFFF) as u16)
        }

        fn stop(&mut self) {}
    }

    #[test]
    fn the_frequency_decides_the_source() {
        use ClockSource::{OtherClock, StLink, StLinkCrystal};
        let both = [(StLink, 7_760_000..=8_160_000), (StLinkCrystal, 8_200_000..=8_470_000)];
        for timer_hz in [16_000_000, 64_000_000] {
            for (hse_hz, expected) in [
                (7_976_000, StLink),
                (8_000_000, StLink),
                (8_100_000, StLink),
                (8_180_000, OtherClock),
                (8_333_333, StLinkCrystal),
                (7_700_000, OtherClock),
                (16_000_000, OtherClock),
                (0, OtherClock),
            ] {
                let mut timer = Captures { timer_hz: timer_hz.into(), hse_hz, number: 0, lost: 9 };
                let measured = measure(timer_hz, &mut timer);
                if let Some(hz) = measured {
                    let count = timer_hz / u32::try_from(hse_hz / 128).expect("a short interval");
                    let off = u64::from(hz).abs_diff(hse_hz);
                    assert!(off * u64::from(count) <= hse_hz, "{hz}");
                }
                let source = ClockSource::of_frequency(measured, &both);
                assert_eq!(source, expected, "{hse_hz} Hz");
            }
        }
        let only_8_mhz = ClockSource::of_frequency(Some(8_333_000), &both[..1]);
        assert_eq!(only_8_mhz, OtherClock);
    }

    #[test]
    fn only_the_chips_own_oscillator_is_reported_and_its_text_fits_a_message() {
        assert_eq!(ClockSource::StLink.fault(), "");
        for source in [ClockSource::NoClock, ClockSource::OtherClock] {
            let text = source.fault();
            assert!(!text.is_empty() && text.len() <= link::MAX_TEXT_BYTES);
        }
    }
}

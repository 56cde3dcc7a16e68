//! Selects the source of the core's clock at start: the ST-LINK's clock, if it runs and has a
//! frequency that the board knows, or the internal oscillator.

#[cfg(target_os = "none")]
use {cortex_m::asm, embassy_stm32::pac::RCC};

/// Oscillator from which all clocks of the chip are derived.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClockSource {
    /// 8 MHz from the ST-LINK, at the HSE input: half of the ST-LINK's own RC oscillator.
    StLink,
    /// 8.33 MHz from the ST-LINK, at the HSE input: a third of the ST-LINK's crystal.
    StLinkCrystal,
    /// Internal RC oscillator (HSI), because there is no clock at the HSE input.
    NoClock,
    /// Internal RC oscillator (HSI), because the clock at the HSE input has another frequency.
    OtherClock,
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

/// Captures of a measurement, which takes 1 ms at 8 MHz and resolves 60 ppm.
const CAPTURES: u32 = 64;

/// Polls after which a capture counts as missing; one takes at least a cycle of the core.
const CAPTURE_POLLS: u32 = 100_000;

/// Deviation of the measured from the nominal frequency up to which they are the same, in percent:
/// the sum of HSI's and the ST-LINK's.
const TOLERANCE_PERCENT: u32 = 2;

/// Longest wait for the ST-LINK's clock, ms. The clock starts with the ST-LINK's own firmware,
/// whose start-up time is not specified. Only a board without this clock waits for the whole time.
const TIMEOUT_MS: u32 = 500;

impl ClockSource {
    /// Returns the ST-LINK's clock if it starts within 500 ms and is one of `known`, and the
    /// internal oscillator otherwise. `core_hz` is the core's and the timer's clock after a reset.
    /// Replaces embassy's own wait for the clock, which has no limit.
    #[cfg(target_os = "none")]
    pub fn find(core_hz: u32, timer: &mut impl HseTimer, known: &[Self]) -> Self {
        // Set HSEBYP first: it can be set only while HSE is off (RM0433 and RM0390, RCC_CR).
        RCC.cr().modify(|control| control.set_hsebyp(true));
        RCC.cr().modify(|control| control.set_hseon(true));
        let is_ready = || RCC.cr().read().hserdy();
        let source = if poll_until(TIMEOUT_MS, is_ready, || asm::delay(core_hz / 1_000)) {
            Self::of_frequency(measure(core_hz, timer), known)
        } else {
            Self::NoClock
        };
        if source.hz().is_none() {
            RCC.cr().modify(|control| control.set_hseon(false));
        }
        source
    }

    /// Returns the source among `known` whose frequency is the measured one, within
    /// [`TOLERANCE_PERCENT`].
    fn of_frequency(measured_hz: Option<u32>, known: &[Self]) -> Self {
        let is_it = |source: &&Self| {
            source
                .hz()
                .zip(measured_hz)
                .is_some_and(|(hz, measured)| measured.abs_diff(hz) <= hz / 100 * TOLERANCE_PERCENT)
        };
        known
            .iter()
            .find(is_it)
            .copied()
            .unwrap_or(Self::OtherClock)
    }

    /// Returns the frequency at the HSE input, in Hz, rounded down; `None` if it is not used.
    pub const fn hz(self) -> Option<u32> {
        match self {
            Self::StLink => Some(8_000_000),
            Self::StLinkCrystal => Some(8_333_333),
            Self::NoClock | Self::OtherClock => None,
        }
    }

    /// Returns the fault text for `Hello`, which is empty if the ST-LINK's clock is used.
    pub(crate) const fn fault(self) -> &'static str {
        match self {
            Self::StLink | Self::StLinkCrystal => "",
            Self::NoClock => {
                "no 8 MHz from the ST-LINK: the board runs from the chip's own oscillator, device times \
                 are off by up to some per cent, and USB is out of tolerance; check the ST-LINK's supply \
                 and firmware"
            }
            Self::OtherClock => {
                "the ST-LINK's clock has a frequency that this board does not know: the board runs from \
                 the chip's own oscillator, device times are off by up to some per cent, and USB is out \
                 of tolerance; set the ST-LINK's MCO output (docs/hardware.md)"
            }
        }
    }
}

/// Measures HSE against the timer's clock of `timer_hz`, and returns its frequency in Hz; `None` if
/// a capture is missing. Edges of HSE that come while no one polls count as a lower frequency.
fn measure(timer_hz: u32, timer: &mut impl HseTimer) -> Option<u32> {
    timer.start();
    let mut next = || (0..CAPTURE_POLLS).find_map(|_| timer.capture());
    // The first capture can be left from before the start, and the second end a short interval.
    let started = next().and_then(|_| next());
    let mut counts = started.map(|first| (first, 0_u32));
    for _ in 0..CAPTURES {
        let Some((last, sum)) = counts else { break };
        let add = |count: u16| (count, sum + u32::from(count.wrapping_sub(last)));
        counts = next().map(add);
    }
    timer.stop();
    let (_, sum) = counts.filter(|(_, sum)| *sum > 0)?;
    let edges = u64::from(CAPTURES * CAPTURE_PERIODS);
    u32::try_from(edges * u64::from(timer_hz) / u64::from(sum)).ok()
}

/// Calls `pause` until `is_ready()`, but at most `pauses` times. Returns whether it became ready.
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

    /// Waits as the board does for a clock that becomes ready after `until_ready` ms. Returns the
    /// milliseconds waited, and whether the clock was found.
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

    /// Timer of `timer_hz` at which HSE has `hse_hz`.
    struct Captures {
        timer_hz: u64,
        hse_hz: u64,
        number: u64,
    }

    impl HseTimer for Captures {
        fn start(&mut self) {}

        fn capture(&mut self) -> Option<u16> {
            self.number += u64::from(self.hse_hz > 0);
            let edges = self.number * u64::from(CAPTURE_PERIODS);
            let count = (edges * self.timer_hz).checked_div(self.hse_hz)?;
            Some((count & 0xFFFF) as u16)
        }

        fn stop(&mut self) {}
    }

    #[test]
    fn the_frequency_decides_the_source() {
        use ClockSource::{OtherClock, StLink, StLinkCrystal};
        let both = [StLink, StLinkCrystal];
        for timer_hz in [16_000_000, 64_000_000] {
            for (hse_hz, expected) in [
                (7_976_000, StLink),
                (8_000_000, StLink),
                (8_150_000, StLink),
                (8_200_000, StLinkCrystal),
                (8_333_333, StLinkCrystal),
                (7_800_000, OtherClock),
                (16_000_000, OtherClock),
                (0, OtherClock),
            ] {
                let mut timer = Captures {
                    timer_hz: timer_hz.into(),
                    hse_hz,
                    number: 0,
                };
                let measured = measure(timer_hz, &mut timer);
                if let Some(hz) = measured {
                    assert!(u64::from(hz).abs_diff(hse_hz) * 10_000 < 2 * hse_hz, "{hz}");
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

//! Selects the source of the core's clock at start: the ST-LINK's clock or the internal oscillator.

#[cfg(target_os = "none")]
use {cortex_m::asm, embassy_stm32::pac::RCC};

/// Oscillator from which all clocks of the chip are derived.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClockSource {
    /// 8 MHz from the ST-LINK's crystal, at the HSE input.
    StLink,
    /// Internal RC oscillator (HSI).
    Internal,
}

/// Longest wait for the ST-LINK's clock, ms. The clock starts with the ST-LINK's own firmware,
/// whose start-up time is not specified. Only a board without this clock waits for the whole time.
const TIMEOUT_MS: u32 = 500;

impl ClockSource {
    /// Returns the ST-LINK's clock if it starts within 500 ms, and the internal oscillator
    /// otherwise; `core_hz` is the core's clock after a reset. Replaces embassy's own wait for the
    /// clock, which has no limit and takes place before the watchdog runs.
    #[cfg(target_os = "none")]
    pub fn find(core_hz: u32) -> Self {
        // Set HSEBYP first: it can be set only while HSE is off (RM0433 and RM0390, RCC_CR).
        RCC.cr().modify(|control| control.set_hsebyp(true));
        RCC.cr().modify(|control| control.set_hseon(true));
        let is_ready = || RCC.cr().read().hserdy();
        if poll_until(TIMEOUT_MS, is_ready, || asm::delay(core_hz / 1_000)) {
            return Self::StLink;
        }
        RCC.cr().modify(|control| control.set_hseon(false));
        Self::Internal
    }

    /// Returns the fault text for `Hello`, which is empty for the ST-LINK's clock.
    pub(crate) const fn fault(self) -> &'static str {
        match self {
            Self::StLink => "",
            Self::Internal => {
                "no 8 MHz from the ST-LINK: the board runs from the chip's own oscillator, device times \
                 are off by up to some per cent, and USB is out of tolerance; check the ST-LINK's supply \
                 and firmware"
            }
        }
    }
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

    #[test]
    fn only_the_chips_own_oscillator_is_reported_and_its_text_fits_a_message() {
        assert_eq!(ClockSource::StLink.fault(), "");
        let text = ClockSource::Internal.fault();
        assert!(!text.is_empty() && text.len() <= link::MAX_TEXT_BYTES);
    }
}

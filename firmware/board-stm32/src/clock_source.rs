//! What the clocks are derived from.

#[cfg(target_os = "none")]
use {cortex_m::asm, embassy_stm32::pac::RCC};

/// Where the core's clock comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClockSource {
    /// 8 MHz from the ST-LINK's quartz, at HSE's input.
    StLink,
    /// The chip's own oscillator, HSI.
    Internal,
}

/// How long the ST-LINK's clock may take, ms. It comes up with the ST-LINK's own firmware, whose start is
/// not specified; it only delays a board whose clock never comes.
const PATIENCE_MS: u32 = 500;

impl ClockSource {
    /// Waits for the ST-LINK's clock; `core_hz` is the core's clock after a reset. embassy would wait for
    /// it without end, before the watchdog runs.
    #[cfg(target_os = "none")]
    pub fn find(core_hz: u32) -> Self {
        // Only while HSE is off the bypass can be set (RM0433 and RM0390, RCC_CR).
        RCC.cr().modify(|control| control.set_hsebyp(true));
        RCC.cr().modify(|control| control.set_hseon(true));
        let is_ready = || RCC.cr().read().hserdy();
        if comes(PATIENCE_MS, is_ready, || asm::delay(core_hz / 1_000)) {
            return Self::StLink;
        }
        RCC.cr().modify(|control| control.set_hseon(false));
        Self::Internal
    }

    /// What is wrong with it, for the host.
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

/// Returns whether `is_ready` becomes true within `pauses` pauses.
fn comes(pauses: u32, mut is_ready: impl FnMut() -> bool, mut pause: impl FnMut()) -> bool {
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

    /// Milliseconds waited for a clock that needs this long, and whether it came.
    fn waited(until_ready: u32) -> (u32, bool) {
        let waited = Cell::new(0);
        let is_ready = || waited.get() >= until_ready;
        let came = comes(PATIENCE_MS, is_ready, || waited.update(|ms| ms + 1));
        (waited.get(), came)
    }

    #[test]
    fn a_clock_that_is_late_is_waited_for_and_one_that_never_comes_costs_half_a_second() {
        assert_eq!(waited(0), (0, true));
        assert_eq!(waited(20), (20, true));
        assert_eq!(waited(PATIENCE_MS), (PATIENCE_MS, true));
        assert_eq!(waited(u32::MAX), (PATIENCE_MS, false));
    }

    #[test]
    fn only_the_chips_own_oscillator_is_reported_and_its_text_fits_a_message() {
        assert_eq!(ClockSource::StLink.fault(), "");
        let text = ClockSource::Internal.fault();
        assert!(!text.is_empty() && text.len() <= link::MAX_TEXT_BYTES);
    }
}

//! Trigger input: the timer that counts the device time also stamps the input's edges.
//!
//! The time driver counts microseconds with TIM2, in periods of 2^16, and uses the timer's channels
//! 1 and 2. Channel 3 captures the counter at rising and falling edges (RM0433 and RM0390, TIM2,
//! input capture mode). A stamp is therefore the device time of the edge, to the microsecond, even
//! if the interrupt runs late. The driver does not use channel 3, except that it clears the
//! channel's flag, which nothing reads. TIM5 could replace TIM2, but on the NUCLEO-F446RE the
//! ST-LINK's UART occupies the pins of TIM5's spare channels 3 and 4.

use core::cell::RefCell;

use critical_section::Mutex;
use embassy_stm32::{
    Peri,
    exti::{ExtiInput, TriggerEdge},
    gpio::Pull,
    mode::Blocking,
    pac::{
        GPIOB, TIM2,
        gpio::vals::{Idr, Moder},
        timer::vals::CcmrInputCcs,
    },
    peripherals::{EXTI10, PB10},
};
use embassy_time::Instant;
use firmware::deadlines;
use link::EventKind;

use crate::application::SHARED;
use crate::interrupts;
use crate::trigger_line::TriggerLine;

/// Pin of the trigger input. It is pulled down, so an open input is low.
pub struct Trigger {
    /// Pin at TIM2's channel 3.
    pub pin: Peri<'static, PB10>,
    /// EXTI line of the pin.
    pub line: Peri<'static, EXTI10>,
}

/// Number of the pin in its port, which is also the number of its EXTI line.
const PIN: usize = 10;
/// Index of TIM2's channel 3, counted from 0.
const CHANNEL: usize = 2;
/// Alternate function that connects the pin to TIM2 (DS12110 and DS10693, alternate functions).
const FUNCTION: u8 = 1;

static LINE: Mutex<RefCell<TriggerLine>> = Mutex::new(RefCell::new(TriggerLine::new()));

impl Trigger {
    /// Starts to capture edges. No edge is handled before the first call of [`refill_budget`].
    pub(crate) fn start_capture(self) {
        let input: ExtiInput<'_, Blocking> =
            ExtiInput::new_blocking(self.pin, self.line, Pull::Down, TriggerEdge::Any);
        // Dropping `input` would release the pin.
        core::mem::forget(input);
        // Connect the pin to TIM2. EXTI still receives the pin's level (RM0433, GPIO, external
        // interrupt lines).
        GPIOB.afr(PIN / 8).modify(|pins| pins.set_afr(PIN % 8, FUNCTION));
        GPIOB.moder().modify(|pins| pins.set_moder(PIN, Moder::ALTERNATE));
        // Connect the timer's channel to its own input; there is no filter and no prescaler.
        TIM2.ccmr_input(CHANNEL / 2)
            .modify(|channels| channels.set_ccs(CHANNEL % 2, CcmrInputCcs::from_bits(0b01)));
        // Capture rising and falling edges.
        TIM2.ccer().modify(|channels| {
            channels.set_ccp(CHANNEL, true);
            channels.set_ccnp(CHANNEL, true);
            channels.set_cce(CHANNEL, true);
        });
        critical_section::with(|section| {
            let mut line = LINE.borrow_ref_mut(section);
            line.reset(is_high(), stamp());
        });
    }
}

/// Allows the trigger's interrupt to run [`deadlines::TRIGGER_EDGES`] times until the next call of
/// this function. The DRDY input calls it before every wait for an edge.
pub(crate) fn refill_budget() {
    let was_exhausted = critical_section::with(|section| {
        let mut line = LINE.borrow_ref_mut(section);
        line.refill_budget(deadlines::TRIGGER_EDGES)
    });
    if was_exhausted {
        interrupts::enable_trigger();
    }
}

/// Handles an edge; called by the trigger's interrupt. Disables the interrupt when the budget is
/// spent.
///
/// The timer continues to capture edges, and after the next [`refill_budget`] the interrupt handles
/// the latest edge. While no samples are read, and therefore no run is active, nothing refills the
/// budget; the time of this latest edge can then be wrong by multiples of 65.536 ms.
pub(crate) fn on_edge() {
    interrupts::clear_pending(1 << PIN);
    let edge = critical_section::with(|section| {
        let mut line = LINE.borrow_ref_mut(section);
        // Read the level before the stamp: an edge in between raises a new interrupt.
        let (is_high, stamp) = (is_high(), stamp());
        let edge = line.observe(is_high, stamp, Instant::now().as_micros());
        if line.budget_exhausted() {
            interrupts::disable_trigger();
        }
        edge
    });
    let Some(edge) = edge else { return };
    SHARED.inputs.count_lost(edge.lost);
    let kind = if edge.is_rise { EventKind::TriggerRise } else { EventKind::TriggerFall };
    SHARED.inputs.push_event(kind, edge.at_us);
}

fn is_high() -> bool {
    GPIOB.idr().read().idr(PIN) == Idr::HIGH
}

/// Returns the stamp of the latest edge: the lower 16 bits of its device time in microseconds.
#[expect(clippy::cast_possible_truncation, reason = "the time driver's counter has 16 bits")]
fn stamp() -> u16 {
    TIM2.ccr(CHANNEL).read() as u16
}

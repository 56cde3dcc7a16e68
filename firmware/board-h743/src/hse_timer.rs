//! TIM17, which measures the clock at the HSE input before the clocks are configured.

use board_stm32::{HSE_DIVIDER, HseTimer};
use embassy_stm32::pac::timer::vals::CcmrInputCcs;
use embassy_stm32::pac::{RCC, TIM17};

pub(crate) struct Timer;

impl HseTimer for Timer {
    fn start(&mut self) {
        RCC.cfgr().modify(|clocks| clocks.set_rtcpre(HSE_DIVIDER));
        RCC.apb2enr().modify(|enable| enable.set_tim17en(true));
        // The clock of the timer starts with a delay; a read of the register waits until the clock
        // runs.
        let _ = RCC.apb2enr().read();
        // Input 1 is HSE / RTCPRE (RM0433, TIM17_TISEL; stm32h7xx_hal_tim_ex.h).
        TIM17.tisel().write(|input| input.set_tisel(0, 2));
        TIM17.ccmr_input(0).modify(|channel| {
            channel.set_ccs(0, CcmrInputCcs::TI4);
            channel.set_icpsc(0, 3);
        });
        TIM17.ccer().modify(|channel| channel.set_cce(0, true));
        TIM17.cr1().modify(|control| control.set_cen(true));
    }

    fn capture(&mut self) -> Option<u16> {
        // Reading the count clears the flag.
        TIM17.sr().read().ccif(0).then(|| TIM17.ccr(0).read().ccr())
    }

    fn stop(&mut self) {
        RCC.apb2rstr().modify(|reset| reset.set_tim17rst(true));
        RCC.apb2rstr().modify(|reset| reset.set_tim17rst(false));
        RCC.apb2enr().modify(|enable| enable.set_tim17en(false));
        RCC.cfgr().modify(|clocks| clocks.set_rtcpre(0));
    }
}

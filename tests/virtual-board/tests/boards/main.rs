//! What the images that are flashed do on their boards. `cargo xtask board` builds the images and runs
//! these tests.

mod codes;
mod converter_faults;
mod failures;
mod figures;
mod images;
mod memory;
mod priorities;
mod reset;
mod self_test;
mod session;
mod start_up;
mod trigger;

/// A module for each board with a test for each scenario, a function of [`Model`](virtual_board::Model).
macro_rules! scenarios {
    ($($board:ident = $model:ident { $($name:ident: $scenario:path,)* })*) => {
        $(mod $board {
            $(#[test]
            fn $name() {
                $scenario(virtual_board::Model::$model);
            })*
        })*
    };
}

scenarios! {
    h743 = H743 {
        starts_up: crate::start_up::starts_up,
        starts_up_without_the_clock: crate::start_up::starts_up_without_the_clock,
        codes_equal_the_simulators: crate::codes::codes_equal_the_simulators,
        self_test_passes: crate::self_test::self_test_passes,
        trigger_edges_have_their_microsecond: crate::trigger::trigger_edges_have_their_microsecond,
        restarts_on_command: crate::reset::restarts_on_command,
        a_dead_chip_is_named: crate::converter_faults::a_dead_chip_is_named,
        converters_may_be_powered_late: crate::converter_faults::converters_may_be_powered_late,
        a_silent_chain_is_flagged: crate::converter_faults::a_silent_chain_is_flagged,
        a_shifted_bit_is_named: crate::converter_faults::a_shifted_bit_is_named,
        a_hang_is_ended_by_the_watchdog: crate::failures::a_hang_is_ended_by_the_watchdog,
        a_panic_is_told_after_the_restart: crate::failures::a_panic_is_told_after_the_restart,
        a_hard_fault_is_told_after_the_restart: crate::failures::a_hard_fault_is_told_after_the_restart,
        a_stack_overflow_is_told_after_the_restart: crate::failures::a_stack_overflow_is_told_after_the_restart,
        interrupts_have_their_priorities: crate::priorities::interrupts_have_their_priorities,
        dma_reaches_its_buffers: crate::memory::dma_reaches_its_buffers,
    }
    f446 = F446 {
        starts_up: crate::start_up::starts_up,
        starts_up_without_the_clock: crate::start_up::starts_up_without_the_clock,
        codes_equal_the_simulators: crate::codes::codes_equal_the_simulators,
        self_test_passes: crate::self_test::self_test_passes,
        trigger_edges_have_their_microsecond: crate::trigger::trigger_edges_have_their_microsecond,
        restarts_on_command: crate::reset::restarts_on_command,
        a_dead_chip_is_named: crate::converter_faults::a_dead_chip_is_named,
        converters_may_be_powered_late: crate::converter_faults::converters_may_be_powered_late,
        a_silent_chain_is_flagged: crate::converter_faults::a_silent_chain_is_flagged,
        a_shifted_bit_is_named: crate::converter_faults::a_shifted_bit_is_named,
        a_hang_is_ended_by_the_watchdog: crate::failures::a_hang_is_ended_by_the_watchdog,
        a_panic_is_told_after_the_restart: crate::failures::a_panic_is_told_after_the_restart,
        a_hard_fault_is_told_after_the_restart: crate::failures::a_hard_fault_is_told_after_the_restart,
        a_stack_overflow_is_told_after_the_restart: crate::failures::a_stack_overflow_is_told_after_the_restart,
        interrupts_have_their_priorities: crate::priorities::interrupts_have_their_priorities,
        dma_reaches_its_buffers: crate::memory::dma_reaches_its_buffers,
    }
}

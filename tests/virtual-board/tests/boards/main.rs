//! What the images that are flashed do on their boards. `cargo xtask board` builds the images and runs
//! these tests.

mod bridge;
mod codes;
mod commands;
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
mod usb;
mod watchdog;

use images::Subject;
use virtual_board::{Cable, Model};

/// The default image of the default board.
const H743: Subject = Subject {
    model: Model::H743,
    cable: Cable::Usb,
};

/// The same with the feature `uart`.
const H743_UART: Subject = Subject {
    model: Model::H743,
    cable: Cable::Uart,
};

/// The default image of the small board.
const F446: Subject = Subject {
    model: Model::F446,
    cable: Cable::Uart,
};

/// The same for a USB socket of the user's own.
const F446_USB: Subject = Subject {
    model: Model::F446,
    cable: Cable::Usb,
};

/// A module for each subject with a test for each scenario, a function of [`Subject`].
macro_rules! scenarios {
    ($($module:ident = $subject:ident { $($room:ident: $($scenario:ident)+;)* })*) => {
        $(mod $module {
            $($(#[test]
            fn $scenario() -> Result<(), virtual_board::Trouble> {
                crate::$room::$scenario(crate::$subject)
            })+)*
        })*
    };
}

scenarios! {
    h743 = H743 {
        start_up: starts_up starts_up_without_the_clock;
        codes: codes_equal_the_simulators;
        self_test: self_test_passes;
        trigger: trigger_edges_have_their_microsecond;
        reset: restarts_on_command restarts_into_the_loader;
        converter_faults: a_dead_chip_is_named a_packed_chain_is_understood converters_may_be_powered_late a_silent_chain_is_flagged
            a_shifted_bit_is_named;
        failures: a_hang_is_ended_by_the_watchdog a_panic_is_reported_after_the_restart
            a_hard_fault_is_reported_after_the_restart a_stack_overflow_is_reported_after_the_restart a_wild_stack_is_reported_after_the_restart;
        priorities: interrupts_have_their_priorities;
        memory: dma_reaches_its_buffers;
        commands: commands_arrive_while_codes_stream;
        usb: enumerates outlasts_its_host comes_back_when_it_is_replugged;
        bridge: connects;
        watchdog: watchdog_suits_its_oscillator;
    }
    h743_uart = H743_UART {
        start_up: starts_up;
        codes: codes_equal_the_simulators;
        priorities: interrupts_have_their_priorities;
        memory: dma_reaches_its_buffers;
        commands: commands_arrive_while_codes_stream a_damaged_line_costs_what_it_damages;
    }
    f446 = F446 {
        start_up: starts_up starts_up_without_the_clock;
        codes: codes_equal_the_simulators;
        self_test: self_test_passes;
        trigger: trigger_edges_have_their_microsecond;
        reset: restarts_on_command restarts_into_the_loader;
        converter_faults: a_dead_chip_is_named a_packed_chain_is_understood converters_may_be_powered_late a_silent_chain_is_flagged
            a_shifted_bit_is_named;
        failures: a_hang_is_ended_by_the_watchdog a_panic_is_reported_after_the_restart
            a_hard_fault_is_reported_after_the_restart a_stack_overflow_is_reported_after_the_restart a_wild_stack_is_reported_after_the_restart;
        priorities: interrupts_have_their_priorities;
        memory: dma_reaches_its_buffers;
        commands: commands_arrive_while_codes_stream a_damaged_line_costs_what_it_damages;
        bridge: connects;
        watchdog: watchdog_suits_its_oscillator;
    }
    f446_usb = F446_USB {
        start_up: starts_up;
        codes: codes_equal_the_simulators;
        priorities: interrupts_have_their_priorities;
        memory: dma_reaches_its_buffers;
        usb: enumerates comes_back_when_it_is_replugged;
    }
}

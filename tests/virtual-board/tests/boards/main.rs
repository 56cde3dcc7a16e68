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

/// A test for each scenario, a function of [`Subject`].
macro_rules! scenarios {
    ($subject:ident: $($room:ident: $($scenario:ident)+;)*) => {
        $($(#[test]
        fn $scenario() -> Result<(), virtual_board::Trouble> {
            crate::$room::$scenario(crate::$subject)
        })+)*
    };
}

/// What every image does.
macro_rules! every_image {
    ($subject:ident) => {
        scenarios! {
            $subject:
            start_up: starts_up;
            codes: codes_equal_the_simulators;
            priorities: interrupts_have_their_priorities;
            memory: dma_reaches_its_buffers;
        }
    };
}

/// What the default image of a board does as well.
macro_rules! default_image {
    ($subject:ident) => {
        every_image!($subject);
        scenarios! {
            $subject:
            start_up: starts_up_without_the_clock;
            self_test: self_test_passes;
            trigger: trigger_edges_have_their_microsecond;
            commands: commands_arrive_while_codes_stream an_idle_board_answers_at_once;
            reset: restarts_on_command restarts_into_the_loader;
            converter_faults: a_dead_chip_is_named a_packed_chain_is_understood
                converters_may_be_powered_late a_silent_chain_is_flagged a_shifted_bit_is_named;
            failures: a_hang_is_ended_by_the_watchdog a_panic_is_reported_after_the_restart
                a_hard_fault_is_reported_after_the_restart
                a_stack_overflow_is_reported_after_the_restart
                a_wild_stack_is_reported_after_the_restart;
            watchdog: watchdog_suits_its_oscillator;
            bridge: connects;
        }
    };
}

mod h743 {
    default_image!(H743);
    scenarios! { H743: usb: enumerates outlasts_its_host comes_back_when_it_is_replugged; }
}

mod h743_uart {
    every_image!(H743_UART);
    scenarios! {
        H743_UART:
        commands: commands_arrive_while_codes_stream a_damaged_line_costs_what_it_damages;
    }
}

mod f446 {
    default_image!(F446);
    scenarios! { F446: commands: a_damaged_line_costs_what_it_damages; }
}

mod f446_usb {
    every_image!(F446_USB);
    scenarios! { F446_USB: usb: enumerates comes_back_when_it_is_replugged; }
}

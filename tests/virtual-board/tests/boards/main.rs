//! Scenarios of the firmware images on virtual boards; `cargo xtask board` builds the images and
//! runs them.

mod bridge;
mod codes;
mod commands;
mod converter_faults;
mod failures;
mod images;
mod packed;
mod reference;
mod session;
mod simulation;
mod start_up;
mod trigger;
mod upload;
mod usb;
mod watchdog;

use images::Subject;
use virtual_board::{Cable, Model};

/// The default image of the NUCLEO-H743ZI2, which uses USB.
const H743: Subject = Subject::new(Model::H743, Cable::Usb, "h743");

/// The image of the NUCLEO-H743ZI2 with the feature `uart`, which uses the UART.
const H743_UART: Subject = Subject::new(Model::H743, Cable::Uart, "h743-uart");

/// The default image of the NUCLEO-F446RE, which uses the UART.
const F446: Subject = Subject::new(Model::F446, Cable::Uart, "f446");

/// The image of the NUCLEO-F446RE for a USB connector that the user has added.
const F446_USB: Subject = Subject::new(Model::F446, Cable::Usb, "f446-usb");

/// The image of the NUCLEO-F446RE that has the packed code in place of the network.
const F446_PACKED: Subject = Subject::new(Model::F446, Cable::Uart, "f446-packed");

/// The image of the ironbci, for one converter at 250 Hz that runs from its own oscillator.
const IRONBCI: Subject = Subject::new(Model::Ironbci, Cable::Uart, "ironbci").with_own_model();

/// The image of the NUCLEO-H743ZI2 for one converter at 250 Hz.
const KIT_250: Subject = Subject::new(Model::H743, Cable::Usb, "kit-250").with_own_model();

/// The image of the NUCLEO-H743ZI2 for one converter at 500 Hz.
const KIT_500: Subject = Subject::new(Model::H743, Cable::Usb, "kit-500").with_own_model();

/// The image of the NUCLEO-H743ZI2 for two converters in a daisy chain at 250 Hz.
const CYTON_16: Subject = Subject::new(Model::H743, Cable::Usb, "cyton-16").with_own_model();

/// The image of the NUCLEO-H743ZI2 for four cascaded converters at 512 Hz.
const TEN_TWENTY_32: Subject =
    Subject::new(Model::H743, Cable::Usb, "ten-twenty-32").with_own_model();

/// Defines a test of the image `$subject` for each scenario. A scenario is a function that takes a
/// [`Subject`].
macro_rules! scenarios {
    ($subject:ident: $($room:ident: $($scenario:ident)+;)*) => {
        $($(#[test]
        fn $scenario() -> Result<(), virtual_board::BoardError> {
            crate::$room::$scenario(crate::$subject)
        })+)*
    };
}

/// Defines, for one image, the tests that all images with the network have.
macro_rules! every_image {
    ($subject:ident) => {
        scenarios! {
            $subject:
            start_up: starts_up;
            codes: codes_equal_those_of_host_sim;
        }
    };
}

/// Defines the tests of a board's default image: those that every image has, and further ones.
macro_rules! default_image {
    ($subject:ident) => {
        every_image!($subject);
        scenarios! {
            $subject:
            start_up: starts_up_without_the_clock refuses_an_unknown_clock;
            trigger: trigger_edges_have_correct_times;
            commands: commands_arrive_while_codes_stream self_test_passes;
            converter_faults: a_dead_chip_is_reported a_packed_chain_is_decoded
                converters_can_be_powered_late a_silent_drdy_is_flagged a_shifted_bit_is_reported;
            failures: failures_are_reported_after_the_restart restarts_on_command
                restarts_into_the_loader;
            watchdog: watchdog_works_over_the_oscillator_range;
            bridge: bridge_delivers_codes;
        }
    };
}

mod h743 {
    default_image!(H743);
    scenarios! {
        H743:
        start_up: runs_from_the_clocks_of_an_st_link a_hang_during_the_start_up_ends_in_a_reset;
        commands: impedances_are_measured;
        usb: works_after_pauses_and_suspend reconnects_after_unplugging;
        packed: packed_blocks_equal_those_of_host_sim everything_at_once_is_in_time;
        upload: uploaded_model_is_used unsound_upload_is_refused;
    }
}

mod h743_uart {
    every_image!(H743_UART);
    scenarios! {
        H743_UART:
        start_up: runs_from_the_clocks_of_an_st_link;
        commands: commands_arrive_while_codes_stream damaged_bytes_destroy_only_their_commands;
        upload: uploaded_model_is_used;
    }
}

mod f446 {
    default_image!(F446);
    scenarios! {
        F446:
        commands: damaged_bytes_destroy_only_their_commands impedances_are_refused;
        packed: compressed_samples_equal_those_of_host_sim;
        bridge: bridge_cannot_calibrate;
    }
}

mod f446_usb {
    every_image!(F446_USB);
    scenarios! { F446_USB: usb: reconnects_after_unplugging; }
}

/// Defines the tests of an image for other converters and another model than the built-in one.
macro_rules! other_converters {
    ($subject:ident) => {
        scenarios! {
            $subject:
            start_up: starts_up;
            reference: codes_equal_those_of_the_reference;
            commands: self_test_passes impedances_are_measured;
            converter_faults: a_dead_chip_is_reported a_silent_drdy_is_flagged;
        }
    };
}

mod kit_250 {
    other_converters!(KIT_250);
    scenarios! { KIT_250: bridge: bridge_delivers_codes; }
}

mod kit_500 {
    other_converters!(KIT_500);
}

mod cyton_16 {
    other_converters!(CYTON_16);
}

mod ten_twenty_32 {
    other_converters!(TEN_TWENTY_32);
}

mod ironbci {
    other_converters!(IRONBCI);
    scenarios! {
        IRONBCI:
        start_up: starts_up_without_the_clock;
        trigger: trigger_edges_have_correct_times;
        commands: loader_is_refused;
        failures: failures_are_reported_after_the_restart;
    }
}

mod f446_packed {
    scenarios! {
        F446_PACKED:
        start_up: starts_up;
        packed: packed_blocks_equal_those_of_host_sim codes_and_uploads_are_refused;
    }
}

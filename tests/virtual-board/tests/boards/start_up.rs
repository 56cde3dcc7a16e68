//! Scenarios for the start of a board, from power-on until its converters run.

use std::num::NonZeroU64;

use ads1299::Wiring;
use firmware::deadlines::priority;
use link::{Flags, ResetCause, Streams};
use virtual_board::{BoardError, Cable, Converters, Kind, Model, Setup, VirtualBoard};

use crate::images::Subject;
use crate::session::{
    assert_no_findings, assert_sound, greetings, pick, power_on, run_codes, run_up, running_with,
    start,
};
use crate::{commands, usb};

/// Time limit from power-on to `Hello`, in us of device time. It covers the start of the clocks and
/// the initialisation of the encoder's memory. The time would be 65,536 us longer if the time
/// driver counted a half period too many.
const HELLO_US: u64 = 20_000;

/// Scenario: the board starts up without findings, sends complete first frames and answers commands
/// at once; a USB host can enumerate it, and all interrupts have their priorities.
pub(crate) fn starts_up(subject: Subject) -> Result<(), BoardError> {
    let mut board = power_on(subject, &subject.setup());
    if subject.cable == Cable::Usb {
        usb::assert_enumerates(&mut board)?;
        subject.record("usb_enumerates", true);
    }
    run_up(&mut board)?;
    let frames = board.inbox().frames();
    let hello = &frames[0];
    let Kind::Hello { board: name, reset_cause, fault, .. } = &hello.kind else {
        panic!("the first frame is {hello:?}");
    };
    assert_eq!(
        (name.as_str(), *reset_cause, fault.as_str()),
        (subject.model.facts().name, ResetCause::PowerOn, "")
    );
    assert!(hello.device_us < HELLO_US, "Hello at {} us", hello.device_us);
    let capabilities = frames.iter().filter(|frame| frame.kind == Kind::Capabilities);
    assert_eq!(capabilities.count(), 1, "Capabilities is longer than any buffer of the port");
    for (number, frame) in (0..).zip(frames) {
        assert_eq!(frame.seq, number, "a frame is missing");
    }
    assert_core_runs_at(&mut board, subject.model.facts().core_hz)?;
    // The ironbci has a crystal, the other boards the ST-LINK's clock.
    let has_clock = subject.model != Model::Ironbci;
    assert_eq!(board.hse_is_bypassed()?, has_clock, "HSEBYP");
    // On the STM32H743, SCLK is 100 kHz to access registers and 12.8 MHz to read samples; on the
    // others, 82 kHz and 10.5 MHz (docs/hardware.md). The converters run, so SCLK must have the
    // frequency for samples.
    let burst_hz = board.sclk_hz();
    assert!((10_000_000..=20_000_000).contains(&burst_hz), "SCLK of {burst_hz} Hz");
    if let Some(baud) = board.port().baud() {
        // Over a byte's ten bits, sender and ST-LINK may drift apart by half a bit, less a margin
        // for noise; this usually leaves 2 % to each of them.
        assert!(baud.abs_diff(921_600) <= 921_600 / 50, "{baud} baud");
        subject.record("baud", baud);
    }
    subject.record("booted", true);
    subject.record("hello_us", board.inbox().frames()[0].device_us);
    subject.record("violations", board.converters().violations());
    subject.record("unmapped", board.findings()?.unmapped.len());
    assert_interrupts_have_their_priorities(&mut board, subject)?;
    assert_pins_are_set(&mut board, subject)?;
    commands::assert_idle_board_answers_at_once(&mut board)?;
    assert_sound(&mut board)
}

/// Scenario: without a clock at the HSE input, the board runs from its internal oscillator and
/// reports that the clock is missing.
pub(crate) fn starts_up_without_the_clock(subject: Subject) -> Result<(), BoardError> {
    let setup = Setup { clock_hz: 0, ..subject.setup() };
    let mut board = running_with(subject, &setup)?;
    let greetings = greetings(board.inbox().frames());
    let (cause, fault) = &greetings[0];
    assert_eq!(*cause, ResetCause::PowerOn);
    assert!(fault.contains("no clock at the HSE input"), "Hello reports {fault:?}");
    assert_core_runs_at(&mut board, subject.model.facts().core_hz)?;
    assert_no_findings(&mut board)
}

/// Scenario: the STM32H743 runs from the two clocks that an ST-LINK can supply: 8.33 MHz, and 8 MHz
/// with an error of 0.3 %. This error is beyond USB's tolerance, but the device must flag no sample
/// because of it; the status reports the measured rate.
pub(crate) fn runs_from_the_clocks_of_an_st_link(subject: Subject) -> Result<(), BoardError> {
    let (clock_hz, core_hz) = match subject.cable {
        Cable::Usb => (8_333_333, 480_000_000),
        Cable::Uart => (7_976_000, 478_560_000),
    };
    let setup = Setup { clock_hz, ..subject.setup() };
    let mut board = running_with(subject, &setup)?;
    let (_, fault) = &greetings(board.inbox().frames())[0];
    assert_eq!(fault, "");
    assert_core_runs_at(&mut board, core_hz)?;
    start(&mut board, Streams::CODES)?;
    run_codes(&mut board, 20)?;
    for (_, code) in board.inbox().codes() {
        assert!(!code.flags.contains(Flags::ADC_STATUS_BAD));
    }
    // If the device's clock is slow, the device's second is longer, so the device counts more
    // samples per second.
    let rate = |kind: &Kind| match kind {
        Kind::Converters(converters) => Some(converters.drdy_millihertz),
        _ => None,
    };
    let millihertz = pick(board.inbox().frames(), rate).next_back();
    let expected = u32::try_from(512_000 * 480_000_000 / core_hz).expect("a rate");
    let difference = millihertz.map(|millihertz| millihertz.abs_diff(expected));
    assert!(difference.is_some_and(|mhz| mhz < 20), "{millihertz:?} for {expected}");
    subject.record("clock_hz", clock_hz);
    assert_sound(&mut board)
}

/// Asserts that the core runs at `hz`, within 1 ppm, the precision of a fractional PLL.
fn assert_core_runs_at(board: &mut VirtualBoard, hz: u64) -> Result<(), BoardError> {
    let found_hz = board.core_hz()?;
    assert!(found_hz.abs_diff(hz) * 1_000_000 <= hz, "{found_hz} Hz, {hz} expected");
    Ok(())
}

/// Scenario: the board reports an external clock whose frequency it does not know, and its core
/// runs at the usual frequency.
pub(crate) fn refuses_an_unknown_clock(subject: Subject) -> Result<(), BoardError> {
    let setup = Setup { clock_hz: 12_000_000, ..subject.setup() };
    let mut board = running_with(subject, &setup)?;
    let (_, fault) = &greetings(board.inbox().frames())[0];
    assert!(fault.contains("a frequency that this board does not know"), "{fault:?}");
    assert_core_runs_at(&mut board, subject.model.facts().core_hz)?;
    assert_no_findings(&mut board)
}

/// Time limit in us for the watchdog's reset during the start-up: 4096 counts of 32 periods of its
/// 32 kHz oscillator, and half a second for the work before the hang.
const START_UP_US: u64 = 4_096_000 + 500_000;
/// Factor by which the core is slower than the board's while it waits for the watchdog. Emulating
/// the wait at full speed takes two minutes.
const SLOWER: u64 = 10;

/// Scenario: if USB's core hangs while it is set up, the watchdog restarts the board.
pub(crate) fn a_hang_during_the_start_up_ends_in_a_reset(
    subject: Subject,
) -> Result<(), BoardError> {
    let speed = subject.model.facts().instructions_per_second / SLOWER;
    let setup = Setup { instructions_per_second: NonZeroU64::new(speed), ..subject.setup() };
    let mut board = power_on(subject, &setup);
    board.hold_usb(true);
    board.run_until_us(START_UP_US)?;
    let resets = board.findings()?.resets;
    assert_eq!(resets.len(), 1, "{resets:?}");
    board.hold_usb(false);
    run_up(&mut board)?;
    let (cause, _) = &greetings(board.inbox().frames())[0];
    assert_eq!(*cause, ResetCause::Watchdog);
    subject.record("reset_from_start_up_us", resets[0].0);
    assert_sound(&mut board)
}

/// Interrupts that have the same line on all chips (RM0433 rev 9, table 147; RM0390, table 38;
/// RM0090 rev 22, table 61).
const COMMON: [Wanted; 6] = [
    ("EXTI9_5, DRDY", 23, priority::DRDY),
    ("TIM2, time driver", 28, priority::TIME),
    ("EXTI15_10, trigger", 40, priority::TRIGGER),
    ("UART4, acquire", 52, priority::ACQUIRE),
    ("USART6, converse", 71, priority::CONVERSE),
    ("I2C3_EV, encode", 72, priority::ENCODE),
];

/// An interrupt that must be enabled: source and task, line, priority.
type Wanted = (&'static str, u16, u8);

/// Returns the DMA interrupts of the converters' SPI (RM0433 rev 9, table 147; RM0390, table 38).
fn spi_interrupts(model: Model) -> [Wanted; 2] {
    match model {
        Model::H743 => {
            [("DMA1 stream 0, SPI", 11, priority::DRDY), ("DMA1 stream 1, SPI", 12, priority::DRDY)]
        }
        Model::F446 => {
            [("DMA1 stream 3, SPI", 14, priority::DRDY), ("DMA1 stream 4, SPI", 15, priority::DRDY)]
        }
        Model::Ironbci => {
            [("DMA1 stream 2, SPI", 13, priority::DRDY), ("DMA1 stream 5, SPI", 16, priority::DRDY)]
        }
    }
}

/// Returns the interrupts of the port to the host: one for USB, or several for UART and DMA.
fn port_interrupts(subject: Subject) -> &'static [Wanted] {
    match (subject.model, subject.cable) {
        (Model::H743, Cable::Usb) => &[("OTG_FS", 101, priority::CONVERSE)],
        (Model::H743, Cable::Uart) => &[
            ("USART3", 39, priority::CONVERSE),
            ("DMA1 stream 2, UART", 13, priority::CONVERSE),
            ("DMA1 stream 3, UART", 14, priority::CONVERSE),
        ],
        (Model::F446, Cable::Usb) => &[("OTG_FS", 67, priority::CONVERSE)],
        (Model::F446, Cable::Uart) => &[
            ("USART2", 38, priority::CONVERSE),
            ("DMA1 stream 5, UART", 16, priority::CONVERSE),
            ("DMA1 stream 6, UART", 17, priority::CONVERSE),
        ],
        (Model::Ironbci, _) => &[
            ("UART5", 53, priority::CONVERSE),
            ("DMA1 stream 0, UART", 11, priority::CONVERSE),
            ("DMA1 stream 7, UART", 47, priority::CONVERSE),
        ],
    }
}

/// Asserts that every interrupt of the firmware has the priority that `firmware::deadlines`
/// defines, and that no other interrupt that can occur is as urgent as the acquire task or more
/// urgent.
fn assert_interrupts_have_their_priorities(
    board: &mut VirtualBoard,
    subject: Subject,
) -> Result<(), BoardError> {
    let enabled = board.interrupts()?;
    let spi = spi_interrupts(subject.model);
    let wanted: Vec<_> = COMMON.iter().chain(&spi).chain(port_interrupts(subject)).collect();
    for (name, line, level) in &wanted {
        let found = enabled.iter().find(|interrupt| interrupt.0 == *line);
        assert_eq!(found.map(|interrupt| interrupt.1), Some(*level), "{name}");
    }
    let urgent = enabled.iter().filter(|(line, level)| {
        *level <= priority::ACQUIRE && !wanted.iter().any(|(_, known, _)| known == line)
    });
    // embassy enables the interrupts of all DMA streams, but unused streams never interrupt.
    let unknown: Vec<_> = urgent.filter(|(line, _)| !is_inactive(*line)).collect();
    assert!(unknown.is_empty(), "unexpected urgent interrupts: {unknown:?}");
    Ok(())
}

/// Asserts that SCLK and MOSI have the speed "medium", which rings less on wires than a faster one,
/// and that DRDY is pulled up and the trigger down. MISO must be pulled up, so that without a chip
/// all bits are 1; but it must have no pull if the pull would form a divider with the read-back
/// resistors of a daisy chain.
fn assert_pins_are_set(board: &mut VirtualBoard, subject: Subject) -> Result<(), BoardError> {
    let Converters { chips, wiring, .. } = subject.converters();
    let has_resistors = chips > 1 && wiring == Wiring::Daisy;
    let miso = if has_resistors { NO_PULL } else { PULL_UP };
    let (speeds, pulls) = board.pin_settings()?;
    assert_eq!(speeds, [MEDIUM; 2], "speeds of SCLK and MOSI");
    let expected = [miso, PULL_UP, PULL_DOWN];
    assert_eq!(pulls, expected, "pulls of MISO, DRDY and trigger");
    Ok(())
}

/// Values of a pin in OSPEEDR and PUPDR (RM0433, RM0390 and RM0090, GPIO registers).
const MEDIUM: u64 = 0b01;
const NO_PULL: u64 = 0b00;
const PULL_UP: u64 = 0b01;
const PULL_DOWN: u64 = 0b10;

/// Returns whether a line's interrupt never delays a task: it belongs to an unused stream of DMA1,
/// DMA2, MDMA or BDMA, or to the STM32H743's RNG, which is read once before the first task.
fn is_inactive(line: u16) -> bool {
    matches!(line, 11..=17 | 47 | 56..=60 | 68..=70 | 80 | 122 | 129..=136)
}

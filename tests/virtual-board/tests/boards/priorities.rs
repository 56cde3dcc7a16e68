//! Interrupt priorities in the NVIC.

use firmware::deadlines::priority;
use virtual_board::{BoardError, Cable, Model};

use crate::images::Subject;
use crate::session::{assert_sound, running};

/// Interrupts with the same line on both chips (RM0433 rev 9, table 147; RM0390, table 38).
const COMMON: [Wanted; 6] = [
    ("EXTI9_5, DRDY", 23, priority::DRDY),
    ("TIM2, time driver", 28, priority::TIME),
    ("EXTI15_10, trigger", 40, priority::TRIGGER),
    ("UART4, acquire", 52, priority::ACQUIRE),
    ("UART5, converse", 53, priority::CONVERSE),
    ("SAI1, encode", 87, priority::ENCODE),
];

/// Expected interrupt: source, line and priority.
type Wanted = (&'static str, u16, u8);

/// Returns the DMA interrupts of the converters' SPI (RM0433 rev 9, table 147; RM0390, table 38).
fn spi_interrupts(model: Model) -> [Wanted; 2] {
    match model {
        Model::H743 => [
            ("DMA1 stream 0, SPI", 11, priority::DRDY),
            ("DMA1 stream 1, SPI", 12, priority::DRDY),
        ],
        Model::F446 => [
            ("DMA1 stream 3, SPI", 14, priority::DRDY),
            ("DMA1 stream 4, SPI", 15, priority::DRDY),
        ],
    }
}

/// Returns the interrupts of the port to the host: USB, or UART and DMA.
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
    }
}

/// Every interrupt of the application has the priority that `firmware::deadlines` defines. No other enabled
/// interrupt has a priority as urgent as that of the acquire task.
pub(crate) fn interrupts_have_their_priorities(subject: Subject) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    let enabled = board.interrupts()?;
    let spi = spi_interrupts(subject.model);
    let wanted: Vec<_> = COMMON
        .iter()
        .chain(&spi)
        .chain(port_interrupts(subject))
        .collect();
    for (name, line, level) in &wanted {
        let found = enabled.iter().find(|interrupt| interrupt.0 == *line);
        assert_eq!(found.map(|interrupt| interrupt.1), Some(*level), "{name}");
    }
    let urgent = enabled.iter().filter(|(line, level)| {
        *level <= priority::ACQUIRE && !wanted.iter().any(|(_, known, _)| known == line)
    });
    // embassy enables the interrupts of all DMA streams; those of unused streams never occur.
    let unknown: Vec<_> = urgent.filter(|(line, _)| !is_inactive(*line)).collect();
    assert!(
        unknown.is_empty(),
        "unexpected urgent interrupts: {unknown:?}"
    );
    assert_sound(&mut board)?;
    Ok(())
}

/// Returns whether a line never interrupts the tasks. Such lines are unused streams of DMA1, DMA2,
/// MDMA and BDMA, and the RNG of the STM32H743, which is read once before the first task.
fn is_inactive(line: u16) -> bool {
    matches!(line, 11..=17 | 47 | 56..=60 | 68..=70 | 80 | 122 | 129..=136)
}

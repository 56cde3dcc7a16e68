//! Registers of a UART.

use embassy_stm32::pac::usart::Usart;

/// Returns the address of the data register.
pub fn data_register(uart: Usart) -> *mut u8 {
    uart.dr().as_ptr().cast()
}

/// Enables the receiver, its DMA requests, and interrupts on an idle line and on damaged bytes.
pub fn enable_receiver(uart: Usart) {
    uart.cr3().modify(|control| {
        control.set_dmar(true);
        control.set_eie(true);
    });
    uart.cr1().modify(|control| {
        control.set_idleie(true);
        control.set_re(true);
    });
}

/// Masks the interrupts of the flags IDLE, FE and NF until the next byte arrives; the interrupt of
/// that byte (RXNEIE) unmasks them.
///
/// A read of SR followed by a read of DR clears these flags (RM0390 and RM0090, USART_SR). The CPU
/// must not read DR: a byte can arrive between its two reads, and the DMA would not store that byte
/// in the ring. So the CPU reads SR, and the DMA reads DR when it moves the next byte. If the DMA's
/// read did not clear the flags, each byte would interrupt and wake the reader, which is slower but
/// loses nothing.
///
/// The flag ORE is the exception. It means that a byte is lost already, and with RXNEIE it would
/// interrupt continuously, so the CPU clears it at once by reading DR.
pub fn acknowledge(uart: Usart) {
    let status = uart.sr().read();
    // The data register (DR) may still hold a byte. If so, the DMA will read the byte, which clears
    // the flags.
    let is_moved = !status.rxne();
    if status.ore() && is_moved {
        let _ = uart.dr().read();
    }
    let is_flagged = status.idle() || status.fe() || status.ne();
    let waits_for_byte = is_flagged && is_moved && !status.ore();
    uart.cr3().modify(|control| control.set_eie(!waits_for_byte));
    uart.cr1().modify(|control| {
        control.set_idleie(!waits_for_byte);
        control.set_rxneie(waits_for_byte);
    });
}

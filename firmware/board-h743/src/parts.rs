//! Pins of the board. The chip selects are on port E, so that the board's pin headers carry all
//! signals of the converter chain.

board_stm32::parts! {
    pins {
        sclk: PA5, "SCLK", "all chips";
        miso: PA6, "MISO", "DOUT, as the wiring says";
        mosi: PB5, "MOSI", "DIN of all chips";
        select0: PE2, "CS 0", "chip 0, electrodes' channels 1 to 8";
        select1: PE4, "CS 1", "chip 1";
        select2: PE5, "CS 2", "chip 2";
        select3: PE6, "CS 3", "chip 3";
        select4: PE9, "CS 4", "chip 4";
        select5: PE11, "CS 5", "chip 5";
        select6: PE13, "CS 6", "chip 6";
        select7: PE14, "CS 7", "chip 7";
        start: PE10, "START", "all chips";
        reset: PE12, "RESET", "all chips";
        drdy: PE7, "DRDY", "chip 0";
        trigger: PB10, "TRIGGER", "your trigger, 3.3 V";
        usb_dp: PA12, "USB D+", "the socket `USB`";
        usb_dm: PA11, "USB D-", "the socket `USB`";
        uart_tx: PD8, "UART TX", "the ST-LINK (USART3), feature `uart`";
        uart_rx: PD9, "UART RX", "the ST-LINK (USART3), feature `uart`";
    }
    peripherals {
        spi: SPI1;
        spi_tx: DMA1_CH0;
        spi_rx: DMA1_CH1;
        drdy_line: EXTI7;
        trigger_line: EXTI10;
        usb: USB_OTG_FS;
        uart: USART3;
        uart_to_host: DMA1_CH2;
        uart_from_host: DMA1_CH3;
        rng: RNG;
        watchdog: IWDG1;
    }
}

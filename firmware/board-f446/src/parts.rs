//! Pins of the board. The chip selects are on port C, so that the board's morpho headers carry all
//! signals of the converter chain.

board_stm32::parts! {
    pins {
        sclk: PB13, "SCLK", "all chips";
        miso: PB14, "MISO", "DOUT, as the wiring says";
        mosi: PB15, "MOSI", "DIN of all chips";
        select0: PC0, "CS 0", "chip 0, electrodes' channels 1 to 8";
        select1: PC1, "CS 1", "chip 1";
        select2: PC2, "CS 2", "chip 2";
        select3: PC3, "CS 3", "chip 3";
        select4: PC8, "CS 4", "chip 4";
        select5: PC9, "CS 5", "chip 5";
        select6: PC10, "CS 6", "chip 6";
        select7: PC11, "CS 7", "chip 7";
        start: PC6, "START", "all chips";
        reset: PC12, "RESET", "all chips";
        drdy: PC7, "DRDY", "chip 0";
        trigger: PB10, "TRIGGER", "your trigger, 3.3 V";
        usb_dp: PA12, "USB D+", "a socket that you wire, without the feature `uart`";
        usb_dm: PA11, "USB D-", "a socket that you wire, without the feature `uart`";
        uart_tx: PA2, "UART TX", "the ST-LINK (USART2)";
        uart_rx: PA3, "UART RX", "the ST-LINK (USART2)";
    }
    peripherals {
        spi: SPI2;
        spi_tx: DMA1_CH4;
        spi_rx: DMA1_CH3;
        drdy_line: EXTI7;
        trigger_line: EXTI10;
        usb: USB_OTG_FS;
        uart: USART2;
        uart_to_host: DMA1_CH6;
        uart_from_host: DMA1_CH5;
        adc: ADC1;
        watchdog: IWDG;
    }
}

//! Pins of the board, as its schematic connects them.

board_stm32::parts! {
    pins {
        sclk: PB3, "SCLK", "the ADS1299";
        miso: PC11, "MISO", "DOUT";
        mosi: PB5, "MOSI", "DIN";
        select0: PD12, "CS 0", "the ADS1299";
        drdy: PA9, "DRDY", "the ADS1299";
        trigger: PB10, "TRIGGER", "LED 2, which is at this pin; your trigger, 3.3 V";
        uart_tx: PC12, "UART TX", "J2.6, pin 2 (UART5)";
        uart_rx: PD2, "UART RX", "J2.6, pin 3 (UART5)";
    }
    peripherals {
        spi: SPI3;
        spi_tx: DMA1_CH5;
        spi_rx: DMA1_CH2;
        drdy_line: EXTI9;
        trigger_line: EXTI10;
        uart: UART5;
        uart_to_host: DMA1_CH7;
        uart_from_host: DMA1_CH0;
        adc: ADC1;
        watchdog: IWDG;
    }
}

//! Level of MISO while a chip of a daisy chain answers through its read-back resistor.

/// Supply of the digital pins, DVDD, in volts.
const DVDD: f64 = 3.3;

/// Capacitance of MISO and of what is wired to it directly, in farads: an estimate.
const MISO_FARADS: f64 = 40e-12;

/// Capacitance at the DOUT of a chip that is not selected, in farads: an estimate.
const DOUT_FARADS: f64 = 15e-12;

/// Thresholds of the microcontroller's input, as fractions of DVDD (STM32 data sheets, I/O static
/// characteristics): a voltage of at least `HIGH` reads as 1, a voltage of at most `LOW` as 0.
const HIGH: f64 = 0.7;
const LOW: f64 = 0.3;

/// Number of integration steps in half a period of SCLK.
const STEPS: u32 = 200;

/// Voltages of MISO and of the other chips' DOUTs, which are connected to MISO through their
/// resistors.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Miso {
    volts: f64,
    douts: f64,
}

impl Miso {
    /// Sets the voltages of MISO and of the other chips' DOUTs to the level that a chip drives
    /// without a resistor.
    pub(super) fn drive(&mut self, is_high: bool) {
        let volts = if is_high { DVDD } else { 0.0 };
        (self.volts, self.douts) = (volts, volts);
    }

    /// Transfers a byte that one chip drives through `ohms`, with the resistors of `others` more
    /// chips on MISO, and returns the byte that the microcontroller reads. The microcontroller
    /// samples in the middle of a bit (SPI mode 1). A level between the thresholds reads as the
    /// wrong bit.
    pub(super) fn read(&mut self, byte: u8, ohms: f64, others: f64, sclk_hz: u32) -> u8 {
        let half_period = 0.5 / f64::from(sclk_hz);
        (0..8).rev().fold(0, |read, bit| {
            let is_high = byte >> bit & 1 == 1;
            self.settle(is_high, ohms, others, half_period);
            let is_right =
                if is_high { self.volts >= HIGH * DVDD } else { self.volts <= LOW * DVDD };
            self.settle(is_high, ohms, others, half_period);
            read << 1 | u8::from(is_high == is_right)
        })
    }

    fn settle(&mut self, is_high: bool, ohms: f64, others: f64, seconds: f64) {
        let driven = if is_high { DVDD } else { 0.0 };
        let step = seconds / f64::from(STEPS);
        for _ in 0..STEPS {
            let through_others = (self.douts - self.volts) / ohms;
            let amperes = (driven - self.volts) / ohms + others * through_others;
            self.volts += step * amperes / MISO_FARADS;
            self.douts -= step * through_others / DOUT_FARADS;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_first_bit_settles_as_computed() {
        // Seven of eight chips have resistors. The expected voltages were computed with an
        // independent integration in 2,000 steps.
        for (ohms, expected) in [(47e3, 1.88), (22e3, 2.70)] {
            let mut miso = Miso::default();
            miso.settle(true, ohms, 6.0, 5e-6);
            assert!((miso.volts - expected).abs() < 0.01, "{}", miso.volts);
        }
    }

    #[test]
    fn bytes_are_read_through_22_kilohms_at_100_khz_and_damaged_through_47() {
        let bytes = [0x3E, 0x95, 0xC0, 0x00, 0xFF, 0x01];
        let read = |ohms, sclk_hz| {
            let mut miso = Miso::default();
            bytes.map(|byte| miso.read(byte, ohms, 6.0, sclk_hz))
        };
        assert_eq!(read(22e3, 100_000), bytes);
        assert_ne!(read(47e3, 100_000), bytes);
        assert_eq!(read(47e3, 25_000), bytes);
        assert_ne!(read(22e3, 200_000), bytes);
    }
}

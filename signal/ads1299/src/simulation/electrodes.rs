//! Sources of the electrodes' signals in a simulated chain.

use std::boxed::Box;

use crate::frame::CHANNELS;

/// Source of the electrodes' signal. The function is called once per sample with the sample's number,
/// from 0, while any channel converts its electrodes; samples of a self-test are not counted.
pub enum Electrodes<const CHIPS: usize> {
    /// Differential voltages in volts; the simulated chip applies gain and clipping and adds noise.
    Volts(Deliver<f64, CHIPS>),
    /// ADC counts, |count| <= 2^23, delivered exactly, whatever the gain, and without noise.
    Counts(Deliver<i32, CHIPS>),
}

/// Function that fills one sample, by chip and channel; its first argument is the sample's number.
pub type Deliver<T, const CHIPS: usize> = Box<dyn FnMut(u64, &mut [[T; CHANNELS]; CHIPS]) + Send>;

impl<const CHIPS: usize> Electrodes<CHIPS> {
    /// Returns electrodes at 0 V, so that the counts are the chips' noise.
    pub fn silent() -> Self {
        Self::Volts(Box::new(|_, volts| *volts = [[0.0; CHANNELS]; CHIPS]))
    }

    /// Returns electrodes whose volts are a function of the sample's number.
    pub fn volts(deliver: impl FnMut(u64, &mut [[f64; CHANNELS]; CHIPS]) + Send + 'static) -> Self {
        Self::Volts(Box::new(deliver))
    }

    /// Returns electrodes whose counts are a function of the sample's number.
    pub fn counts(
        deliver: impl FnMut(u64, &mut [[i32; CHANNELS]; CHIPS]) + Send + 'static,
    ) -> Self {
        Self::Counts(Box::new(deliver))
    }
}

//! What the ADC delivers at one moment.

use model::CHANNELS;

/// One time step of all ADC channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// Counts, 24-bit two's complement in 32, |count| <= 2^23; the index is the ADC channel.
    pub counts: [i32; CHANNELS],
}

impl Sample {
    /// Largest count of a 24-bit converter; the smallest is `-MAX - 1`. A channel that delivers
    /// either is at the rail.
    pub const MAX: i32 = (1 << 23) - 1;
}

impl Default for Sample {
    /// Silence.
    fn default() -> Self {
        Self {
            counts: [0; CHANNELS],
        }
    }
}

//! The converters that a model needs on its board.

use std::path::Path;

use ads1299::{CHANNELS, Clock, Rate, Wiring};
use artifact::{AdcClock, AdcWiring, Artifact, ArtifactError};

/// The converters on a virtual board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Converters {
    /// Number of chips, 1 to 8.
    pub chips: usize,
    /// Number of samples per second that the model expects.
    pub rate_hz: u32,
    /// How the data outputs are connected to MISO.
    pub wiring: Wiring,
    /// Frequency of the chips' clock in Hz. The internal oscillator is simulated 0.4 % too fast,
    /// which is within its tolerance at 25 degC (data sheet SBAS499C, section 7.5).
    pub clock_hz: u32,
}

impl Converters {
    /// Converters of the checked-in model.
    pub const EIGHT: Self =
        Self { chips: 8, rate_hz: 512, wiring: Wiring::Daisy, clock_hz: 1 << 21 };

    /// Returns the converters that the model in `folder` is for.
    ///
    /// # Errors
    /// The folder contains no model.
    ///
    /// # Panics
    /// Never: every rate that an artifact may have is a rate of the converters.
    pub fn of_model(folder: &Path) -> Result<Self, ArtifactError> {
        let adc = Artifact::read(folder)?.description.adc;
        let external = Rate::of_hz(adc.rate_hz).map(|(clock, _)| clock.hz());
        Ok(Self {
            chips: adc.channels.div_ceil(CHANNELS),
            rate_hz: adc.rate_hz,
            wiring: match adc.wiring {
                AdcWiring::Daisy => Wiring::Daisy,
                AdcWiring::Cascaded => Wiring::Cascaded,
            },
            clock_hz: match adc.clock {
                AdcClock::External => external.expect("reading the artifact has checked its rate"),
                AdcClock::Internal => Clock::INTERNAL.hz() / 1_000 * 1_004,
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_models_of_the_repository_have_their_converters() {
        let models = Path::new("../../signal/model");
        let of = |name: &str| Converters::of_model(&models.join(name)).expect(name);
        assert_eq!(of("artifact"), Converters::EIGHT);
        let kit = Converters { chips: 1, rate_hz: 500, clock_hz: 2_048_000, ..Converters::EIGHT };
        assert_eq!(of("kit-500"), kit);
        let ironbci = Converters { rate_hz: 250, clock_hz: 2_056_192, ..kit };
        assert_eq!(of("ironbci"), ironbci);
    }
}

//! Impedance of the electrodes, measured from the samples that carry the excitation.

use ads1299::ImpedanceMeter;
use link::Streams;
use model::{ADC_RATE_HZ, ELECTRODES};

use crate::acquired_sample::{AcquiredSample, Marks};
use crate::converters::CONVERTER_SETTINGS;

/// Impedance of each electrode in one measurement; [`link::Impedance`] is its form on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Impedance {
    /// Impedances, in the order of the montage: ohms, least significant byte first, or
    /// [`link::Impedance::OPEN`].
    ohms: [[u8; 4]; ELECTRODES],
}

impl Impedance {
    /// Builds the wire message, which borrows the impedances.
    pub(crate) const fn message(&self) -> link::Impedance<'_> {
        link::Impedance { ohms: self.ohms.as_flattened() }
    }
}

const _: () = assert!(link::Impedance::OPEN == ImpedanceMeter::<ELECTRODES>::OPEN);

/// Whether this firmware image can measure impedances.
pub(crate) const HAS_IMPEDANCE: bool = cfg!(any(test, feature = "impedance"));

/// Returns whether the excitation, at a quarter of the ADC's rate, falls into the band of any of
/// `streams`. At ADC rates from 500 Hz on, the band-pass removes it. At lower rates, only
/// unfiltered streams can run during a measurement, so impedances are measured before a session.
pub(crate) const fn spoils(streams: Streams) -> bool {
    spoils_at(ADC_RATE_HZ, streams)
}

const fn spoils_at(adc_rate_hz: u16, streams: Streams) -> bool {
    let filtered =
        streams.without(Streams::RAW).without(Streams::COMPRESSED_RAW).without(Streams::EVENTS);
    adc_rate_hz < 500 && !filtered.is_empty()
}

/// Measures the impedance of the electrodes from the samples with excitation.
#[derive(Clone, Debug)]
pub(crate) struct ImpedanceMeasurement(ImpedanceMeter<ELECTRODES>);

impl ImpedanceMeasurement {
    pub(crate) const NEW: Self = Self(ImpedanceMeter::new(CONVERTER_SETTINGS));

    /// Adds a sample. Returns the impedances if a measurement is complete. A measurement ends
    /// without a result if a sample is lost, if a chip is bad (its counts are then repeated), or if
    /// a sample is without excitation.
    pub(crate) fn observe(&mut self, acquired: &AcquiredSample) -> Option<Impedance> {
        if !acquired.excited {
            self.0.restart();
            return None;
        }
        let [marks, lost] = [acquired.marks, acquired.lost];
        let is_broken = |marks: Marks| marks.overrun || marks.adc_status_bad;
        if acquired.new_run.is_some() || is_broken(marks) || is_broken(lost) {
            self.0.restart();
        }
        let ohms = self.0.observe(&acquired.sample.counts)?;
        Some(Impedance { ohms: ohms.map(u32::to_le_bytes) })
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    #[test]
    fn below_500_hz_only_unfiltered_streams_run_beside_the_excitation() {
        let unfiltered = Streams::RAW | Streams::COMPRESSED_RAW | Streams::EVENTS;
        for hz in [250, 256, 500, 512, 1000, 1024] {
            assert!(!spoils_at(hz, unfiltered));
            assert_eq!(spoils_at(hz, unfiltered | Streams::CODES), hz < 500);
            assert_eq!(spoils_at(hz, Streams::FILTERED), hz < 500);
        }
    }

    #[test]
    fn a_measurement_begins_again_after_a_lost_sample_and_without_excitation() {
        let period = u64::from(ADC_RATE_HZ);
        let samples = if period.is_multiple_of(4) { period } else { 2 * period };
        let (excited, lost) = (100, 100 + samples / 2);
        let mut measurement = ImpedanceMeasurement::NEW;
        let mut found = Vec::new();
        for index in 0..lost + 2 * samples + 20 {
            let mut acquired =
                AcquiredSample { index, excited: index >= excited, ..AcquiredSample::default() };
            acquired.sample.counts = [[4_989, 0, -4_989, 0][(index % 4) as usize]; model::CHANNELS];
            acquired.marks.overrun = index == lost;
            acquired.marks.adc_status_bad = index == lost - 1;
            found.extend(measurement.observe(&acquired).map(|one| (index, one)));
        }
        let ends: Vec<u64> = found.iter().map(|(index, _)| index + 1).collect();
        assert_eq!(ends, [lost + 8 + samples, lost + 8 + 2 * samples]);
        let message = found[0].1.message();
        assert!(message.electrodes().all(|ohms| ohms.is_some_and(|ohms| ohms > 100)));
    }
}

//! Features of a recording: the integers that a device computes from it for a classifier.

use crate::track::Track;
use artifact::classifier::{Classifier, LEVEL_OF_ONE, LEVELS_PER_OCTAVE, MAX_FEATURES};
use fixed_dsp::{BandPass, BandPower};

// The levels of classifier files must be on the scale of the device's levels.
const _: () = assert!(
    LEVELS_PER_OCTAVE == fixed_dsp::LEVELS_PER_OCTAVE && LEVEL_OF_ONE == fixed_dsp::LEVEL_OF_ONE
);

/// Range of an electrode's value in quarters of a microvolt: 13 bits.
const QUARTERS: [f64; 2] = [-4_096.0, 4_095.0];

/// Returns the level of each filter, `8 log2(energy) - 80`, in each whole hop of a recording. The
/// levels equal those that `pipeline::FeatureExtractor` computes from the same steps.
///
/// The band-pass starts at rest. The recording must have the classifier's electrodes.
pub fn levels(track: &Track, classifier: &Classifier) -> Vec<Vec<u8>> {
    let band = classifier.band.sections.map(BandPass::from_q32);
    let filters = &classifier.filters;
    let mut power = BandPower::<MAX_FEATURES>::REST;
    let hops = (track.values).chunks_exact(track.electrodes * usize::from(classifier.hop_steps));
    let levels = hops.map(|hop| {
        for step in hop.chunks_exact(track.electrodes) {
            let step: Vec<i32> = step.iter().map(|&uv| quarters(uv)).collect();
            let signal = |weights: &[i8]| {
                let products = weights.iter().zip(&step);
                products.map(|(&weight, x)| i32::from(weight) * x).sum()
            };
            let signals = std::array::from_fn(|filter| {
                (filters.get(filter)).map_or(0, |filter| signal(&filter.weights))
            });
            power.add_block(&band, &[signals], filters.len());
        }
        power.take_levels(filters.len())[..filters.len()].to_vec()
    });
    levels.collect()
}

/// Converts microvolts to quarters of a microvolt, rounded half up and saturated.
fn quarters(uv: f32) -> i32 {
    let [least, most] = QUARTERS;
    let quarters = (4.0 * f64::from(uv) + 0.5).floor().clamp(least, most);
    #[expect(clippy::cast_possible_truncation, reason = "a whole number of 13 bits")]
    let quarters = quarters as i32;
    quarters
}

#[cfg(test)]
mod tests {
    use super::*;
    use artifact::classifier::{
        Band, Class, ClassifierTraining, DecisionRule, LARGEST_ROW, SpatialFilter,
    };
    use pipeline::{ELECTRODES, FeatureExtractor, FeatureFilters, Step};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    // Classifier files and the device must have the same limits of filters and weights.
    const _: () =
        assert!(MAX_FEATURES == pipeline::MAX_FEATURES && LARGEST_ROW == pipeline::LARGEST_ROW);

    #[test]
    fn levels_equal_those_of_the_device() {
        let description = artifact::Artifact::read("../../signal/model/artifact".as_ref())
            .expect("the default model")
            .description;
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let electrodes = description.montage.electrodes;
        let filter = |most: i8, rng: &mut ChaCha8Rng| SpatialFilter {
            weights: (0..ELECTRODES).map(|_| rng.random_range(-most..=most)).collect(),
            pattern: vec![0.0; ELECTRODES],
        };
        let bands = [[8.0, 30.0], [1.0, 60.0], [12.0, 15.0]];
        for (band, most) in bands.into_iter().zip([33, 1, 33]) {
            let classifier = Classifier {
                format: 1,
                electrodes: electrodes.clone(),
                step_rate_hz: 128,
                hop_steps: 8,
                band: Band { hz: band, sections: model_gen::band_power_sections(band, 128.0) },
                decision: DecisionRule {
                    classes: [1, 2].map(|code| Class { code, event: code.to_string() }).into(),
                    window_hops: 1,
                    weights: vec![vec![0.0; 3]; 2],
                    bias: vec![0.0; 2],
                },
                filters: (0..3).map(|_| filter(most, &mut rng)).collect(),
                training: ClassifierTraining::default(),
            };
            let text = classifier.to_toml().expect("a classifier");
            assert_eq!(Classifier::parse(&text).expect("in range"), classifier);
            let filters = FeatureFilters::new(
                classifier.id(),
                classifier.band.sections,
                &classifier.weight_bytes(),
            );
            let mut extractor = FeatureExtractor::NEW;
            extractor.set_filters(filters.expect("in range"));
            // Amplitudes from 1 uV to 1.6 mV, beyond the input range.
            let uv_per_unit = description.adc.lsb_uv() / 32.0;
            let (mut values, mut expected) = (Vec::new(), Vec::new());
            for step in 0..1_203 {
                let most = 1_600 << (step / 120);
                let units: [i32; ELECTRODES] =
                    std::array::from_fn(|_| rng.random_range(-most..=most));
                let features = extractor.add_step(&Step { electrodes: units, ..Step::SILENCE });
                expected.extend(features.map(|features| features.levels().to_vec()));
                #[expect(clippy::cast_possible_truncation, reason = "as in a track")]
                values.extend(units.map(|x| (f64::from(x) * uv_per_unit) as f32));
            }
            let track = Track::new("random", ELECTRODES, values);
            assert_eq!(expected.len(), 150);
            assert_eq!(levels(&track, &classifier), expected);
        }
    }
}

//! The streaming encoder computes the same codes as the batch reference, on every window of an EEG
//! recording that was not used for training.

use acceptance::real_data;
use model_gen::IntegerModel;
use pipeline::{Acquisition, Code, Encoder, FrontEnd, Mains, Plane, quantise};

use crate::inputs::{artifact, recorded};

const STEPS: usize = model::STEPS;

/// Compares the codes of acquisition and encoder with those that model-gen's simple loops compute
/// from the same quantised planes (one scalp grid for each time step).
#[test]
fn streaming_equals_batch_on_every_window_of_a_recording() {
    let file = real_data::EDF_R12;
    let test = format!("streaming equals batch on {file}");
    let Some(path) = real_data::path(&test, file) else {
        return;
    };
    let batch = model_gen::quantise(&artifact()).expect("an integer model");

    // The recordings come from a country where the mains frequency is 60 Hz.
    let (mut acquisition, mut encoder) = (Acquisition::new(Mains::Hz60), Encoder::new());
    let mut front_end = FrontEnd::new(Mains::Hz60, &model::RESAMPLER);
    let mut planes: Vec<Plane> = Vec::new();
    let mut codes: Vec<Code> = Vec::new();
    for sample in recorded(&path) {
        let step = acquisition.process_sample(&sample);
        codes.extend(step.and_then(|step| encoder.encode_step(&step)));
        planes.extend(
            front_end.filter_sample(&sample).map(|(electrodes, _)| quantise(&electrodes).0),
        );
    }
    assert_eq!(codes.len(), 1 + (planes.len() - STEPS) / model::HOP);
    let different = different(&batch, &planes, &codes);
    println!("{file}: {} windows, {different} different", codes.len());
    assert_eq!(different, 0);
    // 125 s of EEG give about 2,000 codes. Most must differ from the code before them: equal codes
    // would agree even if both encoders gave a constant or clipped every value.
    assert!(codes.len() > 1900);
    assert!(codes.windows(2).filter(|pair| pair[0].values != pair[1].values).count() > 1800);
}

fn different(batch: &IntegerModel, planes: &[Plane], codes: &[Code]) -> usize {
    let windows = planes.windows(STEPS).step_by(model::HOP);
    windows
        .zip(codes)
        .filter(|(window, code)| {
            let batch = batch.encode_window(window.as_flattened());
            let ours = (code.values.exponent(), code.values.integers().to_vec());
            (batch.exponent, batch.values) != ours
        })
        .count()
}

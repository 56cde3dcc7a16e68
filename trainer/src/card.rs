//! The description of a new artifact, and its training card.

use artifact::{
    Adc, CodeFormat, CodeQuantisation, Decimation, Description, Figures, Filters, Grid, Input,
    Mode, Montage, STEPS, TrainingCard, Window,
};

use crate::evaluate::{Evaluation, ReconstructionError};
use crate::pool::NETWORK;

/// Returns the description of the paper's chain (arXiv 2008.13485) for an ADS1299 at gain 24, with an
/// empty training card.
pub fn description() -> Description {
    let grid = Grid::paper();
    Description {
        format: 1,
        mode: Mode::Shortcut,
        window: Window {
            steps: STEPS,
            hop: STEPS / 2,
            rate_hz: 128,
        },
        network: NETWORK,
        code: CodeQuantisation {
            format: CodeFormat::Int8,
        },
        montage: Montage {
            electrodes: grid.electrodes(),
        },
        grid,
        adc: Adc {
            rate_hz: 512,
            vref_v: 4.5,
            gain: 24,
            channels: 64,
        },
        filters: Filters {
            mains_hz: vec![50, 60],
            notch_q: 30.0,
            harmonics: 0,
            band_hz: [0.5, 60.0],
            order: 5,
            decimation: Decimation::Literal,
        },
        input: Input { sd_uv: 1.0 },
        training: TrainingCard {
            dataset: String::new(),
            citation: String::new(),
            real_electrodes: 0,
            interpolated_electrodes: 0,
            interpolated: Vec::new(),
            note: String::new(),
            train_files: Vec::new(),
            test_files: Vec::new(),
            validation: String::new(),
            mains_hz: 0,
            seed: 0,
            epochs: 0,
            best_epoch: 0,
            windows: 0,
            optimiser: String::new(),
            mse: None,
            prd_percent: None,
        },
    }
}

/// Returns the training card's note about recorded and interpolated electrodes.
pub fn note(real: usize, interpolated: usize) -> String {
    if interpolated == 0 {
        return "All electrodes were recorded.".to_owned();
    }
    format!(
        "{interpolated} of {} electrodes are mixes of the {real} recorded ones: the data span at \
         most {real} dimensions in space, an easy set that favours linear codes. The error is over \
         all electrodes, recorded and mixed.",
        real + interpolated
    )
}

/// Returns the figure that `figure` selects, of the network and of PCA, rounded to six decimals.
pub fn figures(
    network: &Evaluation,
    pca: &Evaluation,
    figure: impl Fn(&ReconstructionError) -> f64,
) -> Figures {
    // One training run on one subject does not make more decimals significant.
    let figure = |error| (figure(error) * 1e6).round() / 1e6;
    Figures {
        autoencoder_float: figure(&network.float),
        autoencoder_int8: figure(&network.integer),
        pca_float: figure(&pca.float),
        pca_int8: figure(&pca.integer),
    }
}

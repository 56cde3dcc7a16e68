//! Tests that a model written to a folder reads back unchanged, and that invalid models are
//! refused.

use super::*;
use crate::description::{
    AdcClock, AdcControl, AdcWiring, Decimation, Grid, NetworkShape, Padding, Window,
};
use crate::error::TensorProblem;
use crate::testing;

#[test]
fn a_written_model_reads_back_with_the_same_id() {
    let folder = tempfile::tempdir().unwrap();
    let mut small = testing::description();
    small.window = Window { steps: 32, hop: 4, rate_hz: 128 };
    small.code.numbers = 8;
    let labels = ["C3", "Cz", "C4", "Pz"].map(str::to_owned);
    small.grid = Grid::new(vec![labels.to_vec()]);
    small.montage.electrodes = labels.to_vec();
    (small.adc.rate_hz, small.adc.channels) = (256, 8);
    (small.training.real_electrodes, small.training.interpolated_electrodes) = (4, 0);
    small.training.interpolated.clear();
    let small = testing::pca_with(small);
    for artifact in [testing::pca(), testing::shortcut(), small] {
        let id = artifact.write(folder.path()).unwrap();
        let read = Artifact::read(folder.path()).unwrap();
        assert_eq!(read, artifact);
        assert_eq!(read.id, id);
    }
}

#[test]
fn a_change_in_any_file_changes_the_id() {
    let artifact = testing::pca();
    let mut described = artifact.clone();
    described.description.filters.notch_q = 31.0;
    let mut weighted = artifact.clone();
    let one = vec![1.0; 128 * 16 * 61];
    weighted.weights.insert("encoder.shortcut.weight", &[128, 16 * 61], one);
    let mut calibrated = artifact.clone();
    calibrated.calibration.insert("input.max_abs", &[1], vec![99.0]);
    for changed in [described, weighted, calibrated] {
        let folder = tempfile::tempdir().unwrap();
        assert_ne!(changed.write(folder.path()).unwrap(), artifact.id);
    }
}

#[test]
fn the_written_description_has_one_grid_row_on_a_line() {
    let files = testing::pca().to_files().unwrap();
    let text = std::str::from_utf8(&files[0].1).unwrap();
    assert!(text.contains("    [\"FTT7\", \"FCC5\","), "{text}");
}

#[test]
fn the_error_of_a_missing_folder_names_the_missing_file() {
    let error = Artifact::read(Path::new("/nowhere")).unwrap_err();
    assert!(error.to_string().contains("/nowhere/model.toml"), "{error}");
}

#[test]
fn the_error_of_a_misspelt_field_names_it() {
    let files = testing::pca().to_files().unwrap();
    let text = std::str::from_utf8(&files[0].1).unwrap();
    let misspelt = text.replace("notch_q", "notch_Q");
    let error = Artifact::from_files(&[(DESCRIPTION, misspelt.as_bytes())]).unwrap_err();
    let ArtifactError::Toml { source, .. } = error else { panic!("{error}") };
    assert!(source.to_string().contains("notch_Q"), "{source}");
}

#[test]
fn the_error_of_an_invalid_description_names_the_field() {
    type Change = fn(&mut Description);
    let cases: [(Change, &str); 32] = [
        (|d| d.format = 2, "format"),
        (|d| d.window.hop = 7, "window.hop"),
        (|d| d.network.pool = [0, 2, 2], "network.pool"),
        (|d| d.network.pool = [2, 2, 0], "network.pool"),
        (|d| d.network.pool = [2, 7, 2], "network.pool"),
        (|d| d.network.pool = [16, 2, 2], "network.pool"),
        (|d| d.network.pool = [3, 2, 2], "network.pool"),
        (
            |d| {
                d.network.padding = Padding::All;
                d.network.pool = [4, 2, 2];
            },
            "network.pool",
        ),
        (|d| d.grid.cells.truncate(9), "grid.cells"),
        (|d| d.montage.electrodes.truncate(3), "montage.electrodes"),
        (|d| d.adc.rate_hz = 500, "adc.rate_hz"),
        (|d| d.adc.rate_hz = 2000, "adc.rate_hz"),
        (|d| d.adc.gain = 7, "adc.gain"),
        (|d| d.adc.vref_v = 2.5, "adc.vref_v"),
        (|d| d.adc.channels = 62, "adc.channels"),
        (|d| d.adc.channels = 72, "adc.channels"),
        (|d| d.adc.clock = AdcClock::Internal, "adc.clock"),
        (
            |d| {
                d.adc.rate_hz = 250;
                (d.filters.decimation, d.adc.clock) = (Decimation::Fir, AdcClock::Internal);
            },
            "adc.clock",
        ),
        (
            |d| (d.adc.wiring, d.adc.control) = (AdcWiring::Cascaded, AdcControl::Commands),
            "adc.control",
        ),
        (|d| d.window.steps = 24, "window.steps"),
        (|d| d.code.numbers = 4, "code.numbers"),
        (|d| d.code.numbers = 260, "code.numbers"),
        (|d| d.code.numbers = 30, "code.numbers"),
        (|d| d.grid = Grid::new(vec![vec!["Cz".to_owned(); 13]]), "grid.columns"),
        (|d| d.grid = Grid::new(vec![vec![]]), "grid.columns"),
        (|d| d.grid = Grid::new(vec![]), "grid.rows"),
        (|d| d.adc.rate_hz = 0, "adc.rate_hz"),
        (|d| d.adc.channels = 60, "adc.channels"),
        (|d| d.filters.band_hz = [0.5, 256.0], "filters.band_hz"),
        (|d| d.filters.harmonics = 4, "filters.harmonics"),
        (|d| d.input.sd_uv = f64::NAN, "input.sd_uv"),
        (|d| d.training.interpolated_electrodes = 0, "training.interpolated"),
    ];
    for (change, expected) in cases {
        let mut artifact = testing::shortcut();
        change(&mut artifact.description);
        let error = artifact.check().unwrap_err();
        let ArtifactError::Field { field, .. } = error else { panic!("{error}") };
        assert_eq!(field, expected);
    }
}

#[test]
fn the_error_of_an_invalid_pool_states_the_valid_sizes() {
    let refusal = |padding, pool| {
        let mut artifact = testing::shortcut();
        artifact.description.network = NetworkShape { padding, pool };
        artifact.check().unwrap_err().to_string()
    };
    let text = refusal(Padding::None, [2, 7, 2]);
    assert!(text.contains("[2, 7, 2]") && text.contains("[12, 6, 5]"), "{text}");
    let text = refusal(Padding::All, [4, 2, 2]);
    assert!(text.contains("1 or 2 steps"), "{text}");
    for (padding, pool) in
        [(Padding::None, [4, 6, 5]), (Padding::Space, [4, 10, 9]), (Padding::All, [1, 1, 1])]
    {
        let mut description = testing::description();
        description.network = NetworkShape { padding, pool };
        testing::shortcut_with(description);
    }
}

#[test]
fn the_error_of_a_montage_that_does_not_fit_the_grid_names_the_label() {
    type Change = fn(&mut Description);
    let cases: [(Change, &str); 4] = [
        (|d| d.montage.electrodes[3] = "F9".to_owned(), "F2"),
        (|d| d.montage.electrodes[3] = "F3".to_owned(), "F3"),
        (|d| d.grid.cells[0][0] = "F3".to_owned(), "F3"),
        (|d| d.montage.electrodes[0] = "F 3".to_owned(), "F 3"),
    ];
    for (change, expected) in cases {
        let mut artifact = testing::pca();
        change(&mut artifact.description);
        let error = artifact.check().unwrap_err();
        let ArtifactError::Label { label, .. } = error else { panic!("{error}") };
        assert_eq!(label, expected);
    }
}

#[test]
fn empty_ranges_and_negative_variances_are_refused() {
    type Change = fn(&mut Artifact);
    let cases: [Change; 3] = [
        |a| (a.weights).insert("encoder.norm1.running_var", &[16], vec![-1.0; 16]),
        |a| (a.calibration).insert("code.min", &[128], vec![1.0; 128]),
        |a| (a.calibration).insert("activation1.max", &[1], vec![0.0]),
    ];
    for change in cases {
        let mut artifact = testing::shortcut();
        change(&mut artifact);
        let error = artifact.check().unwrap_err();
        let ArtifactError::Tensor { problem, .. } = error else { panic!("{error}") };
        assert!(matches!(problem, TensorProblem::Range(..)), "{problem}");
    }
}

//! `trainer evaluate`.

use super::{Folder, LABELS};
use std::fs;

#[test]
fn any_recording_is_evaluated_beside_pca_without_the_training_files() {
    let folder = Folder::with_runs(2, 30);
    let trained = folder.train("shortcut", "--train=run1 --test=run2 --epochs=1");
    fs::remove_file(folder.path("run1.gdf")).expect("the training file");
    // The recordings of the training card, whose figures are the same.
    let again = folder.succeed("evaluate --artifact=model --data=.");
    assert_eq!(again, trained);
    // Another recording, by its path, with fewer electrodes.
    folder.write_recording("other.gdf", &LABELS[..6], 30, 9);
    let json = folder.json("evaluate --artifact=model --test=other.gdf --json");
    let figure = |name: &str| json[name].as_f64().expect("a number");
    assert_eq!(json["bits_per_window"], 128);
    assert_eq!(json["real_electrodes"], 6);
    assert_eq!(json["recordings"][0], "other.gdf");
    for [float, int8] in [["mse_float", "mse_int8"], ["mse_pca", "mse_pca_int8"]] {
        assert!(
            figure(float) > 0.0 && figure(int8) > 0.0 && figure(int8) < 2.0,
            "{json}"
        );
    }
    // Three sources in eight electrodes: codes of 16 numbers keep most of the power. Measured: 0.9
    // and more.
    for name in ["band_correlation_8_13", "band_correlation_13_30"] {
        for name in [name.to_owned(), format!("{name}_pca")] {
            assert!((0.7..1.0).contains(&figure(&name)), "{name}: {json}");
        }
    }
}

#[test]
fn a_model_without_pca_is_evaluated_alone_and_a_training_file_is_named() {
    let folder = Folder::with_runs(1, 30);
    folder.train("shortcut", "--train=run1.gdf --epochs=1");
    let log = folder.fail("evaluate --artifact=model", 2);
    assert!(log.contains("--test"), "{log}");
    fs::remove_file(folder.path("model/pca.safetensors")).expect("the stored PCA");
    let [table, log] = folder.run("evaluate --artifact=model --test=run1.gdf", 0);
    assert!(
        log.contains("trained on run1.gdf") && log.contains("no pca.safetensors"),
        "{log}"
    );
    assert!(
        table.contains("autoencoder") && !table.contains("PCA"),
        "{table}"
    );
}

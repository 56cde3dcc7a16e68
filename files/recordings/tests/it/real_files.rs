//! Tests with real recordings, from the folder in the variable `CORTICODE_DATA`.
//!
//! For files that MNE-Python 1.13.2 can read, the expected values are what it printed
//! (`mne.io.read_raw_edf` / `_bdf` / `_gdf`). MNE treats a missing unit as V, so its values of
//! MI128 were divided by 1e6.

use std::{env, io::Write, path::PathBuf};

use recordings::{EventLabel, Format, Missing, MontageMap, MontageMapError, Recording, Warning};

use crate::{event, played, read_all};

/// Returns the path of a file in the data folder. If the folder is not set, prints that the test is
/// skipped, and returns `None`.
pub(crate) fn data(file: &str) -> Option<PathBuf> {
    let Some(folder) = env::var_os("CORTICODE_DATA") else {
        // `eprintln!` would be captured by the test harness.
        let skipped = format!("SKIPPED: {file} not read, CORTICODE_DATA is not set");
        writeln!(std::io::stderr(), "{skipped}").expect("stderr");
        return None;
    };
    Some(PathBuf::from(folder).join(file))
}

fn open(file: &str) -> Option<Recording> {
    data(file).map(|path| Recording::open(path).expect("a readable recording"))
}

fn close(found: f64, expected: f64) -> bool {
    (found - expected).abs() <= 1e-8 * expected.abs().max(1.0)
}

#[test]
fn edf_plus_of_eegmmidb_equals_mne() {
    let Some(mut recording) = open("eegmmidb_S001/S001R04.edf") else {
        return;
    };
    assert_eq!(recording.format(), Format::EdfPlusContinuous);
    assert_eq!((recording.signals().len(), recording.records()), (65, 125));
    assert_eq!(recording.warnings(), []);
    let text = |text: &str| EventLabel::Text(text.to_owned());
    let events = recording.events().expect("readable");
    assert_eq!(events.len(), 30);
    assert_eq!(events[0], event(0.0, Some(4.2), text("T0")));
    assert_eq!(events[3], event(12.5, Some(4.1), text("T1")));
    let samples = read_all(&mut recording);
    assert_eq!((samples[0].len(), samples[64].len()), (20_000, 0));
    assert_eq!([samples[0][0], samples[1][0], samples[2][0]], [-5.0, 2.0, 37.0]);
    assert_eq!(samples[0].iter().sum::<f64>(), 2783.0);
}

#[test]
fn edf_and_bdf_of_eeglab_equal_mne() {
    let Some(mut recording) = open("bdf_edf/test.edf") else {
        return;
    };
    let samples = read_all(&mut recording);
    assert!(
        close(samples[0][0], 16.0 / 3.0) && close(samples[0].iter().sum(), 108_629.333_333_333_29)
    );
    let Some(mut recording) = open("bdf_edf/test.bdf") else {
        return;
    };
    let unknown = Warning::RecordsUnknown { derived: 60 };
    assert!(recording.warnings().contains(&unknown));
    let samples = read_all(&mut recording);
    assert_eq!(samples[0].len(), 15_360);
    assert!(close(samples[0][0], -526.609_406_388_364_7));
    assert!(close(samples[0].iter().sum(), -8_115_898.608_745_255));
}

#[test]
fn gdf_signals_of_all_sample_types_are_equal() {
    for (file, events) in [("gdf/alltypes.gdf", 0), ("gdf/Header3Tag1.gdf", 3)] {
        let Some(mut recording) = open(file) else {
            return;
        };
        assert_eq!(recording.format(), Format::Gdf2(2.1));
        let found = recording.events().expect("readable").len();
        assert_eq!(found, events, "{file}");
        let samples = read_all(&mut recording);
        assert_eq!((samples.len(), samples[0].len()), (10, 512));
        // libgdf wrote the same random walk of integers in all sample types; its first value is
        // 0x4c = 76.
        assert_eq!(samples[0][0], 76.0);
        for other in &samples[1..] {
            let mut pairs = other.iter().zip(&samples[0]);
            assert!(pairs.all(|(a, b)| (a - b).abs() < 1e-6), "{file}");
        }
    }
}

#[test]
fn gdf_of_a_bci_and_of_an_ecg_equal_mne() {
    let Some(mut recording) = open("gdf/MI128.gdf") else {
        return;
    };
    let events = recording.events().expect("readable");
    assert_eq!(events.len(), 280);
    // Position 1280, counted from 1, at 128 Hz is 9.9921875 s, which MNE prints as 9.992188 s.
    assert_eq!(events[0], event(1279.0 / 128.0, None, EventLabel::Type(785)));
    let samples = read_all(&mut recording);
    assert_eq!(samples[0].len(), 49_673);
    assert!(close(samples[0][0], -1.483_818_357_620_83));
    assert!(close(samples[0].iter().sum(), -25_722.498_534_656_162));

    let Some(mut recording) = open("gdf/mne_test_1ch.gdf") else {
        return;
    };
    assert_eq!(recording.signals()[0].unit.microvolts(), Some(1000.0));
    let samples = read_all(&mut recording);
    assert_eq!(samples[0].len(), 4500);
    assert!((samples[0].iter().sum::<f64>() * 1000.0 - 79_321.683_94).abs() < 1e-4);
}

#[test]
fn a_10_10_cap_covers_the_scalp_grid() {
    let Some(grid) = open("derived/s001r04_61ch_512hz_f32.gdf") else {
        return;
    };
    let Some(recording) = open("eegmmidb_S001/S001R04.edf") else {
        return;
    };
    let map = MontageMap::new(&recording.labels(), &grid.labels(), Missing::Interpolate)
        .expect("common electrodes");
    // Of the grid's 61 electrodes, the recording has 31: F3..F4, P3..P4 and seven columns each of
    // FC, C and CP. The other 30 are interpolated.
    assert_eq!((map.real().len(), map.interpolated().len(), map.zero().len()), (31, 30, 0));
    assert!(map.unused().contains(&"EDF Annotations"));

    let played = played(recording, &grid.labels(), Missing::Interpolate);
    assert_eq!(played.samples(), 64_000);
    let cz = grid.labels().iter().position(|label| *label == "Cz");
    let cz = cz.expect("in the grid");
    let mut reference = grid;
    let reference = &read_all(&mut reference)[cz];
    let lsb_uv = played.spec().lsb_uv;
    let played = played.take(reference.len()).map(|sample| f64::from(sample.expect("data")[cz]));
    let pairs: Vec<(f64, f64)> =
        played.map(|count| count * lsb_uv).zip(reference.iter().copied()).collect();
    let rms = |of: &dyn Fn(&(f64, f64)) -> f64| {
        (pairs.iter().map(|pair| of(pair).powi(2)).sum::<f64>() / f64::from(30 * 512)).sqrt()
    };
    // The reference was resampled with a wider filter, which passes up to 80 Hz; the virtual ADC
    // halves the amplitude at 70 Hz. That explains a measured difference of 1.684 uV rms for a
    // signal of 52 uV rms. A shift by one sample in either direction would cause 7 uV.
    let error = rms(&|(a, b)| a - b);
    assert!(error < 2.0, "{error} uV rms of {}", rms(&|(_, b)| *b));
}

#[test]
fn recordings_without_scalp_electrodes_are_refused_with_their_labels() {
    let Some(recording) = open("gdf/mne_test_1ch.gdf") else {
        return;
    };
    let refused = MontageMap::new(&recording.labels(), &["Cz"], Missing::Interpolate);
    let error = refused.expect_err("an ECG");
    assert!(matches!(error, MontageMapError::NoCommonElectrode { .. }), "{error}");
    let Some(recording) = open("bdf_edf/test.bdf") else {
        return;
    };
    let refused = MontageMap::new(&recording.labels(), &["Cz"], Missing::Interpolate);
    let error = refused.expect_err("a cap with a different numbering");
    assert!(error.to_string().contains("such as A3 A4"), "{error}");
}

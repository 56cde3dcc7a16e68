//! Tests that a mutated file can cause an error, but no panic, no hang and no allocation for data
//! that it does not have.

use proptest::{collection::vec, prelude::*};

use crate::{
    files::{EdfFile, EdfSignal, GdfFile},
    open, read_all,
};
use recordings::{AdcSpec, Electrode, Missing, MontageMap, Position, VirtualAdc};

fn edf() -> Vec<u8> {
    let lists: [&[u8]; 2] = [b"+0\x14\x14\0+0.5\x14a\x14\0", b"+1\x14\x14\0"];
    EdfFile::edf_plus("EDF+D", "2", (4, &[1, 2, 3, 4, 5, 6, 7, 8]), &lists).bytes()
}

fn gdf(version_1: bool, records: i64) -> Vec<u8> {
    let mut file = GdfFile::float32(records, 2, &[1.0, 2.0, 3.0, 4.0]);
    file.version_1 = version_1;
    file.events = vec![1, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 3];
    file.bytes()
}

/// Returns a file of each format, and GDF files that do not state their number of records.
fn valid_files() -> Vec<Vec<u8>> {
    let bdf = EdfFile::bdf("2", 4, vec![7; 24]).bytes();
    let gdf_files = [(false, 2), (true, 2), (false, -1), (true, -1)];
    let gdf_files = gdf_files.map(|(version_1, records)| gdf(version_1, records));
    [vec![edf(), bdf], gdf_files.into()].concat()
}

/// Reads a file completely and checks that it has no more samples and no more events than bytes.
fn read_or_refuse(bytes: Vec<u8>) -> Result<(), TestCaseError> {
    let size = bytes.len();
    let Ok(mut recording) = open(bytes.clone()) else {
        return Ok(());
    };
    let samples: usize = read_all(&mut recording).iter().map(Vec::len).sum();
    prop_assert!(samples <= size, "{samples} samples from {size} bytes");
    if let Ok(events) = recording.events() {
        prop_assert!(events.len() <= size);
    }
    for warning in recording.warnings() {
        prop_assert!(!warning.to_string().is_empty());
    }
    let Ok(recording) = open(bytes) else {
        return Ok(());
    };
    if let Ok(map) = MontageMap::new(&recording.labels(), &["Cz"], Missing::Zero)
        && let Ok(adc) = VirtualAdc::new(recording, &map, AdcSpec::ads1299(512))
    {
        // A damaged header can announce a record of many years, so only 2000 samples are read.
        for counts in adc.take(2000) {
            let counts = counts.map_err(|error| TestCaseError::fail(error.to_string()))?;
            prop_assert!((-8_388_608..=8_388_607).contains(&counts[0]));
        }
    }
    Ok(())
}

/// Generates bytes that are likely to break number parsing or lengths in binary headers.
fn special_byte() -> impl Strategy<Value = u8> {
    prop_oneof![
        any::<u8>(),
        prop::sample::select(&b"0189-+.eE ,\0\xffnai"[..])
    ]
}

fn mutated(valid: Vec<u8>) -> impl Strategy<Value = Vec<u8>> {
    let size = valid.len();
    let changes = vec((0..size, vec(special_byte(), 1..9)), 0..6);
    (
        changes,
        prop_oneof![Just(size), 0..=size],
        vec(any::<u8>(), 0..40),
    )
        .prop_map(move |(changes, length, tail)| {
            let mut bytes = valid.clone();
            for (at, new) in changes {
                let end = (at + new.len()).min(size);
                bytes[at..end].copy_from_slice(&new[..end - at]);
            }
            bytes.truncate(length);
            bytes.extend(tail);
            bytes
        })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(1500) })]

    #[test]
    fn a_mutated_file_of_any_format_is_read_or_refused(
        bytes in prop::sample::select(valid_files()).prop_flat_map(mutated),
    ) {
        read_or_refuse(bytes)?;
    }

    #[test]
    fn every_label_is_an_electrode_on_the_sphere_or_none(
        anything in "\\PC{0,20}",
        similar in "[a-zA-Z]{1,4}[0-9]{0,3}[hH.]{0,2}",
    ) {
        for label in [anything, similar] {
            if let Some(electrode) = Electrode::parse(&label) {
                let position = Position::from_electrode(&electrode);
                let radius = (position.x.powi(2) + position.y.powi(2) + position.z.powi(2)).sqrt();
                prop_assert!((radius - 1.0).abs() < 1e-12, "{label}: {position:?}");
                prop_assert_eq!(Electrode::parse(&electrode.to_string()), Some(electrode));
            }
        }
    }

    #[test]
    fn any_bytes_after_a_valid_magic_are_read_or_refused(
        magic in prop::sample::select(vec![*b"0       ", *b"\xffBIOSEMI", *b"GDF 1.25", *b"GDF 2.20", *b"GDF 2.51"]),
        rest in vec(any::<u8>(), 0..2000),
    ) {
        let mut bytes = magic.to_vec();
        bytes.extend(rest);
        read_or_refuse(bytes)?;
    }
}

#[test]
fn impossible_sizes_are_refused_without_an_allocation() {
    // The header announces 99,999,999 samples in a record, but the file has a few hundred bytes.
    let file = EdfFile::edf("99999999", vec![EdfSignal::int16("Cz", 99_999_999, &[])]);
    let mut bytes = file.bytes();
    bytes.extend([0; 100]);
    let error = open(bytes).err().expect("refused").to_string();
    assert!(
        error.contains("a record takes 199999998 bytes and the file holds 100"),
        "{error}"
    );

    let mut file = GdfFile::float32(i64::MAX, u32::MAX, &[]);
    file.signals[0].type_number = 17;
    let error = open(file.bytes()).err().expect("refused").to_string();
    assert!(
        error.contains("a record takes 34359738360 bytes"),
        "{error}"
    );
}

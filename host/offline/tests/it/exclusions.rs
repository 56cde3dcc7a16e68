//! Electrodes that the device excluded are marked in the written files, and do not count in the
//! error.

use std::fs;
use std::io::Read as _;

use link::{Exclusion, ExclusionPolicy, ToHost};
use offline::SignalFormat;
use recordings::{Event, EventLabel, Recording};

use crate::comparison::filtered;
use crate::recording::{Fixture, labels, values};

/// Excluded electrode, and the rows at which it is excluded.
const ELECTRODE: usize = 7;
const ROWS: std::ops::Range<usize> = 1_472..1_600;

/// Writes the fixture's codes with other reports of exclusions: drops the device's own, and turns
/// the first two reports of quality into the reports that this test needs.
fn codes(fixture: &Fixture) -> std::path::PathBuf {
    fixture.encode();
    let mut reports = vec![(ROWS.end, 0), (ROWS.start, 1 << ELECTRODE)];
    fixture.changed("excluded.codes", |message| {
        let is_kept = !matches!(message, ToHost::Exclusion(_));
        if matches!(message, ToHost::Quality(_))
            && let Some((row, excluded)) = reports.pop()
        {
            *message = ToHost::Exclusion(Exclusion {
                first_step: row as u64,
                excluded,
                policy: ExclusionPolicy::AUTOMATIC,
            });
        }
        is_kept
    })
}

#[test]
fn files_of_records_have_an_annotation_with_duration_and_label() {
    let fixture = Fixture::settled();
    let codes = codes(&fixture);
    for format in [SignalFormat::Edf, SignalFormat::Bdf, SignalFormat::Gdf] {
        let name = format!("excluded.{}", format.extension());
        let decoded = fixture.decode(&codes, &name, format, false);
        let warnings = decoded.expect("decoded").warnings.join("\n");
        let warning = format!("from the others: {} for 1.0 s;", labels()[ELECTRODE]);
        assert!(warnings.contains(&warning), "{warnings}");
        let mut recording = Recording::open(fixture.path(&name)).expect("a recording");
        let text = format!("substituted@@{}", labels()[ELECTRODE]);
        let event = |onset_s, duration_s, label| Event { onset_s, duration_s, signal: None, label };
        let expected = match format {
            // A GDF table of mode 1 has no durations: bit 15 of a type marks the end of an event.
            SignalFormat::Gdf => vec![
                event(11.5, None, EventLabel::Type(1)),
                event(12.5, None, EventLabel::Type(0x8001)),
            ],
            _ => vec![event(11.5, Some(1.0), EventLabel::Text(text))],
        };
        assert_eq!(recording.events().expect("events"), expected, "{format:?}");
    }
}

#[test]
fn arrays_for_numpy_have_a_mask_of_rows_and_electrodes() {
    let fixture = Fixture::settled();
    let decoded = fixture.decode(&codes(&fixture), "mask.npz", SignalFormat::Npz, false);
    let rows = usize::try_from(decoded.expect("decoded").rows).expect("few rows");
    let mut archive = fs::read(fixture.path("mask.npz")).expect("a file");
    let name = b"excluded.npy";
    let place = archive.windows(name.len()).position(|bytes| bytes == name).expect("the array");
    let array = archive.split_off(place + name.len());
    // The header of an array ends with a line feed.
    let header = array.iter().position(|byte| *byte == b'\n').expect("a header") + 1;
    let shape =
        format!("'descr': '|b1', 'fortran_order': False, 'shape': ({rows},{},)", labels().len());
    let text = String::from_utf8_lossy(&array[..header]);
    assert!(text.contains(&shape), "{text}");
    let mut mask = vec![0; rows * labels().len()];
    (&array[header..]).read_exact(&mut mask).expect("the mask");
    for (row, mask) in mask.chunks_exact(labels().len()).enumerate() {
        let excluded = ROWS.contains(&row);
        let expected = |electrode| u8::from(excluded && electrode == ELECTRODE);
        assert!((0..mask.len()).all(|electrode| mask[electrode] == expected(electrode)), "{row}");
    }
}

#[test]
fn the_error_of_an_electrode_leaves_out_the_steps_at_which_it_was_excluded() {
    let fixture = Fixture::settled();
    let decoded = fixture.decode(&codes(&fixture), "error.gdf", SignalFormat::Gdf, true);
    let comparison = decoded.expect("decoded").comparison.expect("an original");
    let others = (0..labels().len()).filter(|electrode| *electrode != ELECTRODE);
    for electrode in others {
        assert_eq!(comparison.electrodes[electrode].steps, comparison.steps);
    }
    let sums = comparison.electrodes[ELECTRODE];
    assert_eq!(sums.steps, comparison.steps - ROWS.len() as u64);
    let (written, original) = (values(&fixture.path("error.gdf")), filtered(&fixture));
    let first = written[0].len() - usize::try_from(comparison.steps).expect("few steps");
    let rows = (first..written[0].len()).filter(|row| !ROWS.contains(row));
    let errors = rows.map(|row| original[row][ELECTRODE] - written[ELECTRODE][row]);
    let error: f64 = errors.map(|error| error.powi(2)).sum();
    assert!((sums.error / error - 1.0).abs() < 1e-3, "{} of {error}", sums.error);
    let mse = error / f64::from(u32::try_from(sums.steps).expect("few steps"));
    assert!((sums.mse_uv2() / mse - 1.0).abs() < 1e-3);
}

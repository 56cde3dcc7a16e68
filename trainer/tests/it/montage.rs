//! Tests of montage files: mistakes and notes that `trainer montage check` prints.

use super::{Folder, assert_has};
use any_model::MONTAGES;
use artifact::MontageFile;
use std::path::Path;
use trainer::montage_check::{MontageCheck, RecordingCheck};

const FOUR: &str = "name = \"four\"\ngrid = \"\"\"\nF3 Fz F4\nC3 _ C4\n\"\"\"\norder = [\"F3\", \"Fz\", \"F4\", \"C3\", \"C4\"]\n\
    [adc]\nchannels = 8\ngain = 24\nrate_hz = 250\n";

/// Checks the montage [`FOUR`] after all replacements in `changes`.
fn check(changes: &[(&str, &str)]) -> MontageCheck {
    let mut text = FOUR.to_owned();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    MontageCheck::new(&MontageFile::parse(Path::new("four.toml"), &text).expect("a montage"))
}

#[test]
fn each_mistake_is_found_alone_and_none_in_a_valid_montage() {
    assert!(check(&[]).mistakes.is_empty());
    let cases: [(&[(&str, &str)], &str); 13] = [
        (
            &[("F3 Fz F4", "F3 Qz F4"), ("\"Fz\"", "\"Qz\"")],
            "Qz (row 1, column 2) is not an electrode of the 10-20, 10-10 or 10-5 system; write _ for \
             an empty cell",
        ),
        (
            &[("C3 _ C4", "C3 F3 C4")],
            "F3 is in two cells: row 1, column 1 and row 2, column 2; empty one of them",
        ),
        (
            &[("F3 Fz F4", "T3 T7 F4"), ("\"F3\", \"Fz\"", "\"T3\", \"T7\"")],
            "T3 and T7 are the same electrode; remove one of them",
        ),
        (&[("C3 _ C4", "C3 C4")], "row 2 has 2 cells, row 1 has 3; fill the shorter one with _"),
        (
            &[("F3 Fz F4\nC3 _ C4", "F3 Fz F4 C3 _ C4 _ _ _ _ _ _ _")],
            "the grid has 1 rows and 13 columns; 1 to 12 of both are possible",
        ),
        (&[("C3 _ C4", "_ _ C4")], "C3 is in the order of channels but in no cell of the grid"),
        (&[("\"C3\", ", "")], "C3 is on the grid but not in the order of channels"),
        (
            &[("\"F3\", ", "\"F3\", \"F3\", ")],
            "F3 has two channels: 1 and 2; remove one from the order",
        ),
        (
            &[("F3 Fz F4", "_ _ F4"), ("\"F3\", \"Fz\", ", "")],
            "the montage has 3 electrodes; 4 to 64 are possible",
        ),
        (
            &[
                ("F3 Fz F4\nC3 _ C4", "F3 Fz F4\nC3 Cz C4\nP3 Pz P4"),
                ("\"C4\"]", "\"C4\", \"Cz\", \"P3\", \"Pz\", \"P4\"]"),
            ],
            "9 electrodes need more than the 8 channels; write channels = 16, for 2 converters",
        ),
        (
            &[("channels = 8", "channels = 12")],
            "no chain of converters has 12 channels; write a multiple of 8 up to 64",
        ),
        (&[("gain = 24", "gain = 5")], "an ADS1299 has no gain of 5; it has 1, 2, 4, 6, 8, 12, 24"),
        (
            &[("rate_hz = 250", "rate_hz = 300")],
            "an ADS1299 has no rate of 300 Hz here; possible are 250, 256, 500, 512, 1000, 1024",
        ),
    ];
    for (changes, mistake) in cases {
        assert_eq!(check(changes).mistakes, [mistake]);
    }
}

#[test]
fn a_small_grid_and_far_neighbours_are_notes() {
    let words = "cells are too few for convolutions without padding; what fits: ";
    let small = format!("2 x 3 {words}--mode pca");
    assert_eq!(check(&[]).notes, [small]);
    let wide = [("C3 _ C4", "C3 _ C4 P4"), ("F4\n", "F4 _\n"), ("\"C4\"", "\"C4\", \"P4\"")];
    let expected = format!("2 x 4 {words}--padding space, or --mode pca");
    assert_eq!(check(&wide).notes, [expected]);
    // On this grid, O2 lies directly below F4, although both are far apart on the head.
    let notes = check(&[("C3 _ C4", "C3 _ O2"), ("\"C4\"", "\"O2\"")]).notes;
    let [_, far] = notes.as_slice() else {
        panic!("{notes:?}");
    };
    let degrees = far
        .strip_prefix("F4 and O2 are neighbours on the grid but ")
        .and_then(|rest| rest.split(' ').next()?.parse().ok());
    assert!(degrees > Some(72.0), "{far}");
}

#[test]
fn all_mistakes_are_printed_at_once_with_status_2() {
    let folder = Folder::new();
    let text = FOUR.replace("Fz F4", "Qz").replace("gain = 24", "gain = 5");
    folder.write("bad.toml", &text);
    let [printed, _] = folder.run("montage check bad.toml", 2);
    assert_has(
        &printed,
        &[
            "  F3 Qz\n",
            "row 2 has 3 cells",
            "Qz (row 1, column 2)",
            "F4 is in the order",
            "no gain of 5",
        ],
    );
    folder.write("bad.toml", "name = \"x\"\nsize = 3\n");
    let printed = folder.fail("montage check bad.toml", 2);
    assert!(printed.contains("unknown field `size`"), "{printed}");
    folder.write("bad.toml", &FOUR.replace("gain = 24", "gain = 24\nhz = 5"));
    let printed = folder.fail("montage check bad.toml", 2);
    assert!(printed.contains("unknown field `hz`"), "{printed}");
}

#[test]
fn no_montage_file_has_a_mistake() {
    for montage in any_model::montages().expect("the montages") {
        let mistakes = MontageCheck::new(&montage).mistakes;
        assert_eq!(mistakes, [""; 0], "{}", montage.name);
    }
}

#[test]
fn a_recording_is_compared_by_electrode_not_by_spelling() {
    let montage = MontageFile::read(&Path::new(MONTAGES).join("cyton-8.toml"));
    let labels = ["Fp1.", "C3", "C4", "T5", "T6", "O1", "O2", "ECG"].map(str::to_owned);
    let check =
        RecordingCheck::new("r.edf".to_owned(), labels.to_vec(), &montage.unwrap()).unwrap();
    let printed = check.to_string();
    assert_has(
        &printed,
        &[
            "recorded: 7 Fp1 (as Fp1.) C3 C4 P7 (as T5) P8 (as T6) O1 O2",
            "missing, would be interpolated: 1 Fp2",
            "no electrode of the montage: 1 ECG",
        ],
    );
}

//! Montage files, as `trainer montage check` judges them.

use artifact::MontageFile;
use std::path::Path;
use std::process::{Command, Output};
use trainer::montage_check::{Mistake, MontageCheck, Note};

const FOUR: &str = "name = \"four\"\ngrid = \"\"\"\nF3 Fz F4\nC3 _ C4\n\"\"\"\norder = [\"F3\", \"Fz\", \"F4\", \"C3\", \"C4\"]\n\
    [adc]\nchannels = 8\ngain = 24\nrate_hz = 250\n";

/// Returns the check of [`FOUR`] with each of `changes` applied.
fn check(changes: &[(&str, &str)]) -> MontageCheck {
    let mut text = FOUR.to_owned();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    MontageCheck::new(&MontageFile::parse(Path::new("four.toml"), &text).expect("a montage"))
}

fn trainer(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_trainer"));
    command.args(arguments).output().expect("trainer starts")
}

#[test]
fn a_valid_montage_has_no_mistake() {
    assert_eq!(check(&[]).mistakes, []);
}

#[test]
fn each_mistake_is_found_alone() {
    let text = |value: &str| value.to_owned();
    let cases: [(&[(&str, &str)], Mistake); 13] = [
        (
            &[("F3 Fz F4", "F3 Qz F4"), ("\"Fz\"", "\"Qz\"")],
            Mistake::UnknownElectrode {
                label: text("Qz"),
                cell: (1, 2),
            },
        ),
        (
            &[("C3 _ C4", "C3 F3 C4")],
            Mistake::DoubledCell {
                label: text("F3"),
                cells: [(1, 1), (2, 2)],
            },
        ),
        (
            &[
                ("F3 Fz F4", "T3 T7 F4"),
                ("\"F3\", \"Fz\"", "\"T3\", \"T7\""),
            ],
            Mistake::DoubledElectrode {
                labels: [text("T3"), text("T7")],
            },
        ),
        (
            &[("C3 _ C4", "C3 C4")],
            Mistake::UnevenRow {
                row: 2,
                found: 2,
                expected: 3,
            },
        ),
        (
            &[("F3 Fz F4\nC3 _ C4", "F3 Fz F4 C3 _ C4 _ _ _ _ _ _ _")],
            Mistake::GridSize {
                rows: 1,
                columns: 13,
            },
        ),
        (
            &[("C3 _ C4", "_ _ C4")],
            Mistake::NoCell { label: text("C3") },
        ),
        (
            &[("\"C3\", ", "")],
            Mistake::NoChannel { label: text("C3") },
        ),
        (
            &[("\"F3\", ", "\"F3\", \"F3\", ")],
            Mistake::DoubledChannel {
                label: text("F3"),
                channels: [1, 2],
            },
        ),
        (
            &[("F3 Fz F4", "_ _ F4"), ("\"F3\", \"Fz\", ", "")],
            Mistake::Electrodes { found: 3 },
        ),
        (
            &[
                ("F3 Fz F4\nC3 _ C4", "F3 Fz F4\nC3 Cz C4\nP3 Pz P4"),
                ("\"C4\"]", "\"C4\", \"Cz\", \"P3\", \"Pz\", \"P4\"]"),
            ],
            Mistake::TooManyElectrodes {
                electrodes: 9,
                channels: 8,
                needed: 16,
            },
        ),
        (
            &[("channels = 8", "channels = 12")],
            Mistake::Channels { channels: 12 },
        ),
        (&[("gain = 24", "gain = 5")], Mistake::Gain { gain: 5 }),
        (
            &[("rate_hz = 250", "rate_hz = 300")],
            Mistake::Rate { rate_hz: 300 },
        ),
    ];
    for (changes, mistake) in cases {
        assert_eq!(check(changes).mistakes, [mistake]);
    }
}

#[test]
fn a_small_grid_and_far_neighbours_are_notes() {
    let small = Note::SmallGrid {
        rows: 2,
        columns: 3,
    };
    assert_eq!(check(&[]).notes, std::slice::from_ref(&small));
    assert!(small.to_string().contains("--mode pca"), "{small}");
    let wide = Note::SmallGrid {
        rows: 2,
        columns: 4,
    };
    assert!(wide.to_string().contains("--padding space"), "{wide}");
    // O2 is below F4.
    let notes = check(&[("C3 _ C4", "C3 _ O2"), ("\"C4\"", "\"O2\"")]).notes;
    assert!(
        matches!(&notes[..], [_, Note::FarNeighbours { labels, degrees }]
            if labels == &["F4", "O2"] && *degrees > 72.0),
        "{notes:?}"
    );
}

#[test]
fn all_mistakes_are_printed_at_once_with_status_2() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.toml");
    let text = FOUR.replace("Fz F4", "Qz").replace("gain = 24", "gain = 5");
    std::fs::write(&path, text).unwrap();
    let output = trainer(&["montage", "check", path.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(2));
    let printed = String::from_utf8(output.stdout).unwrap();
    for part in [
        "  F3 Qz\n",
        "row 2 has 3 cells",
        "Qz (row 1, column 2)",
        "F4 is in the order",
        "no gain of 5",
    ] {
        assert!(printed.contains(part), "{part}: {printed}");
    }
    std::fs::write(&path, "name = \"x\"\nsize = 3\n").unwrap();
    let output = trainer(&["montage", "check", path.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(2));
    let printed = String::from_utf8(output.stderr).unwrap();
    assert!(printed.contains("unknown field `size`"), "{printed}");
}

//! Files of codes that are incomplete or damaged, and files that hold no codes.

use std::error::Error as _;
use std::fs;

use link::{Flags, ToHost};
use new_file::{Existing, NewFileError};
use offline::{Encoding, OfflineError, Progress, SignalFormat};

use crate::recording::{ENCODING, Fixture};

/// Asserts that a file with the content `bytes` cannot be decoded. Returns the error message with
/// its cause.
fn refusal(fixture: &Fixture, bytes: &[u8]) -> String {
    let path = fixture.written("refused.codes", bytes);
    let error = fixture.decode(&path, "refused.csv", SignalFormat::Csv, false);
    let error = error.expect_err("no codes");
    assert!(!fixture.path("refused.csv").exists());
    let cause = error.source().map(ToString::to_string);
    format!("{error}: {}", cause.unwrap_or_default())
}

#[test]
fn missing_codes_are_covered_by_their_neighbours_or_flagged() {
    let fixture = Fixture::new();
    fixture.encode();
    // Lose one code by itself, and three in a row.
    let lost = [50, 80, 81, 82];
    let path = fixture.changed(
        "lossy.codes",
        |message| !matches!(message, ToHost::Code(code) if lost.contains(&code.window)),
    );
    let whole = fixture.decode(&fixture.codes(), "whole.csv", SignalFormat::Csv, false);
    let decoded = fixture.decode(&path, "lossy.csv", SignalFormat::Csv, false);
    let (whole, decoded) = (whole.expect("decoded"), decoded.expect("decoded"));
    assert_eq!((decoded.missing, decoded.rows), (4, whole.rows));
    let text = fs::read_to_string(fixture.path("lossy.csv")).expect("text");
    let lines: Vec<Vec<&str>> =
        text.lines().skip(1).map(|line| line.split(',').collect()).collect();
    let flags = lines.iter().step_by(model::HOP);
    let flags = flags.map(|line| Flags::from_bits(line[2].parse().expect("flags")));
    let flags: &[Flags] = &flags.collect::<Vec<_>>();
    let with = |flag| {
        let hops = (0..flags.len()).filter(move |hop| flags[*hop].contains(flag));
        hops.collect::<Vec<usize>>()
    };
    // Window h contains the hops h and h + 1. So without the windows 80 to 82, only hops 81 and 82
    // have no code. The first and the last hop, and all other hops of lost windows, have one code.
    assert_eq!(with(Flags::FILLER), [81, 82]);
    let last = lines.len() / model::HOP - 1;
    assert_eq!(with(Flags::HEALING), [0, 50, 51, 80, 83, last]);
    assert_eq!(lines[81 * model::HOP][4..], lines[81 * model::HOP - 1][4..]);
    assert_eq!(lines[50 * model::HOP][3], "codes missing: 1");
    assert_eq!(lines[80 * model::HOP][3], "codes missing: 3");
}

#[test]
fn codes_that_are_missing_at_the_start_keep_the_time_of_the_others() {
    let fixture = Fixture::new();
    fixture.encode();
    let path = fixture.changed(
        "late.codes",
        |message| !matches!(message, ToHost::Code(code) if code.window < 10),
    );
    let whole = fixture.decode(&fixture.codes(), "whole.csv", SignalFormat::Csv, false);
    let decoded = fixture.decode(&path, "late.csv", SignalFormat::Csv, false);
    let (whole, decoded) = (whole.expect("decoded"), decoded.expect("decoded"));
    assert_eq!((decoded.missing, decoded.rows), (10, whole.rows));
    let [whole, late] =
        ["whole.csv", "late.csv"].map(|name| fs::read_to_string(fixture.path(name)).expect("text"));
    // The first hop of window 10 differs, because the lost window 9 also contains it.
    let same = whole.lines().zip(late.lines()).skip(1 + 11 * model::HOP);
    assert!(same.clone().count() > 100);
    assert!(same.clone().all(|(whole, late)| whole == late));
}

#[test]
fn a_damaged_byte_costs_one_code_and_is_reported() {
    let fixture = Fixture::new();
    let encoded = fixture.encode();
    let mut bytes = fs::read(fixture.codes()).expect("codes");
    // Write a file that ends before the frame of window 100; its length is the position of that
    // frame.
    let mut is_before = true;
    let before = fixture.changed("before.codes", |message| {
        is_before &= !matches!(message, ToHost::Code(code) if code.window == 100);
        is_before
    });
    let at = fs::read(before).expect("codes").len();
    bytes[at + 40] ^= 0x10;
    let path = fixture.written("damaged.codes", &bytes);
    let decoded = fixture.decode(&path, "damaged.gdf", SignalFormat::Gdf, false);
    let decoded = decoded.expect("decoded");
    assert_eq!((decoded.missing, decoded.damaged), (1, 1));
    assert_eq!(decoded.codes, u64::from(encoded.stats.codes_made) - 1);
}

#[test]
fn a_file_that_was_cut_off_yields_what_it_holds() {
    let fixture = Fixture::new();
    fixture.encode();
    let bytes = fs::read(fixture.codes()).expect("codes");
    let path = fixture.written("short.codes", &bytes[..bytes.len() / 2]);
    let decoded = fixture.decode(&path, "short.gdf", SignalFormat::Gdf, true);
    let decoded = decoded.expect("decoded");
    assert!((40..60).contains(&decoded.codes), "{}", decoded.codes);
    assert_eq!(decoded.missing, 0);
}

#[test]
fn other_files_are_refused_with_what_to_do() {
    let fixture = Fixture::new();
    fixture.encode();
    let bytes = fs::read(fixture.codes()).expect("codes");
    let is_code = |message: &ToHost| matches!(message, ToHost::Code(_));
    let mut is_start = true;
    let variants = [
        fixture.changed("codes alone", |message| is_code(message)),
        fixture.changed("introduction", |message| {
            is_start &= !is_code(message);
            is_start
        }),
        fixture.changed("another model", |message| {
            if let ToHost::Code(code) = message {
                code.model_id[0] ^= 1;
            }
            true
        }),
        fixture.changed("a gap", |message| {
            if let ToHost::Code(code) = message {
                code.window += 1_000_000 * (code.window / 80);
            }
            true
        }),
    ];
    let [codes, introduction, model, gap] = variants.map(|path| fs::read(path).expect("codes"));
    for (bytes, words) in [
        (Vec::new(), "holds no intact frame; name a file that `host-sim encode`"),
        (b"0       patient".to_vec(), "holds no intact frame"),
        (b"CORTIREC and more".to_vec(), "`corticode-bridge convert` decodes it"),
        (introduction, "holds no code; the shortest recording"),
        (codes, "does not introduce itself before the first code"),
        ([bytes.clone(), bytes.clone()].concat(), "a second run starts after window"),
        (model, "with --model"),
        (gap, "more than an hour"),
    ] {
        let text = refusal(&fixture, &bytes);
        assert!(text.contains(words), "{words}: {text}");
    }
}

#[test]
fn outputs_are_never_inputs() {
    let fixture = Fixture::new();
    let before = fs::read(fixture.recording()).expect("a recording");
    let replacing = Encoding { existing: Existing::Replace, ..ENCODING };
    let itself = replacing.encode(&fixture.recording(), &fixture.recording(), &Progress::default());
    let refused =
        |error: OfflineError| matches!(error, OfflineError::NewFile(NewFileError::Input { .. }));
    assert!(refused(itself.expect_err("the input")));
    assert_eq!(fs::read(fixture.recording()).expect("a recording"), before);
}

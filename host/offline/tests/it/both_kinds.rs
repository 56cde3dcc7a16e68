//! If a file has codes and packed blocks, as a captured stream can have, one kind is decoded and a
//! warning reports the other kind.

use std::fs;
use std::path::{Path, PathBuf};

use link::{Decoder, MAX_FRAME, ToHost};
use offline::{
    CodeKind, Decoded, Decoding, EncodedStream, Encoding, Model, OfflineError, Progress,
    SignalFormat,
};

use crate::recording::{ENCODING, Fixture, decoding, values};

/// Writes the recording of `fixture` to a file of codes of one kind, and returns its bytes.
fn encoded(fixture: &Fixture, stream: EncodedStream, name: &str) -> Vec<u8> {
    let encoding = Encoding { stream, ..ENCODING };
    let path = fixture.path(name);
    let written = encoding.encode(&fixture.recording(), &path, &Progress::default());
    written.expect("encoded");
    fs::read(path).expect("codes")
}

/// Returns the frames of a file: the device time of each, whether it is a packed block, and its
/// bytes.
fn frames(bytes: &[u8]) -> Vec<(u64, bool, &[u8])> {
    let mut decoder = Decoder::<MAX_FRAME>::new();
    let pieces = bytes.split_inclusive(|byte| *byte == 0);
    pieces
        .filter_map(|piece| {
            let frame = decoder.next::<ToHost>(&mut &*piece)?.expect("a frame");
            let is_block = matches!(frame.message, ToHost::PackedCode(_));
            Some((frame.header.device_time_us, is_block, piece))
        })
        .collect()
}

/// Writes a file with the codes and the packed blocks of the recording, in the order in which a
/// device sends them.
fn both(fixture: &Fixture) -> PathBuf {
    let codes = encoded(fixture, EncodedStream::Codes, "codes.codes");
    let packed = encoded(fixture, EncodedStream::Packed(None), "packed.codes");
    let mut merged = frames(&codes);
    let blocks = frames(&packed).into_iter();
    merged.extend(blocks.filter(|(_, is_block, _)| *is_block));
    merged.sort_by_key(|(device_us, ..)| *device_us);
    let bytes: Vec<u8> = merged.iter().flat_map(|(.., bytes)| *bytes).copied().collect();
    let path = fixture.path("both.codes");
    fs::write(&path, bytes).expect("written");
    path
}

fn decode(
    model: &Model,
    input: &Path,
    output: &Path,
    kind: Option<CodeKind>,
) -> Result<Decoded, OfflineError> {
    let decoding = Decoding { kind, ..decoding(model, SignalFormat::Gdf) };
    decoding.decode(input, output, None, &Progress::default())
}

#[test]
fn the_chosen_kind_is_decoded_or_the_first_one_and_the_other_is_named() {
    let fixture = Fixture::new();
    let path = both(&fixture);
    let model = Model::embedded().expect("a model");
    for (kind, is_packed, alone) in [
        (None, true, "packed"),
        (Some(CodeKind::Packed), true, "packed"),
        (Some(CodeKind::Codes), false, "codes"),
    ] {
        let output = fixture.path(&format!("{alone}{}.gdf", kind.is_some()));
        let decoded = decode(&model, &path, &output, kind).expect("decoded");
        assert_eq!(decoded.is_packed(), is_packed);
        let [warning] = &decoded.warnings[..] else { panic!("{:?}", decoded.warnings) };
        let other = if is_packed { "--stream codes" } else { "--stream packed" };
        assert!(warning.contains(other), "{warning}");
        // The signal must equal the signal of a file which holds only this kind.
        let input = fixture.path(&format!("{alone}.codes"));
        let alone = fixture.path(&format!("{alone}-alone{}.gdf", kind.is_some()));
        let expected = decode(&model, &input, &alone, None).expect("decoded");
        assert!(expected.warnings.is_empty(), "{:?}", expected.warnings);
        assert_eq!(values(&output), values(&alone));
    }
}

#[test]
fn a_kind_that_the_file_lacks_is_refused_with_the_one_that_it_has() {
    let fixture = Fixture::new();
    encoded(&fixture, EncodedStream::Codes, "codes.codes");
    let model = Model::embedded().expect("a model");
    let (input, output) = (fixture.path("codes.codes"), fixture.path("decoded.gdf"));
    let refused = decode(&model, &input, &output, Some(CodeKind::Packed));
    let error = refused.expect_err("no blocks");
    let source = std::error::Error::source(&error).expect("a reason").to_string();
    assert_eq!(
        source,
        "it holds no packed blocks, and codes in their place: decode these with --stream codes"
    );
    assert!(!output.exists());
}

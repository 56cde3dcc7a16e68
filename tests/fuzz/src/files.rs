//! Fuzz targets for files from untrusted sources: other programs' recordings, the bridge's
//! recordings, files of codes and firmware images.

use std::fs;
use std::io::Cursor;
use std::sync::LazyLock;

use bridge_core::HostTime;
use capture::{FileHeader, Recorder, RecordingReader};
use crc::{CRC_32_JAMCRC, Crc};
use dfuse::Image;
use link::Streams;
use new_file::Existing;
use offline::{Decoding, Model, Progress, SignalFormat};
use recordings::{AdcSpec, Block, Missing, MontageMap, Recording, VirtualAdc};
use tempfile::TempDir;

use crate::Outcome;
use crate::recording_files::{EdfFile, EdfSignal, GdfFile, GdfSignal, event_table};
use crate::wire;

/// Largest number of samples played from a recording: a damaged header can announce many years.
const PLAYED: usize = 500;

pub(crate) fn edf_seeds() -> Vec<Vec<u8>> {
    let lists: [&[u8]; 2] = [b"+0\x14\x14\0+0.5\x150.1\x14a\x14\0", b"+1\x14\x14\0"];
    let plus = ["EDF+C", "EDF+D"];
    let plus =
        plus.map(|kind| EdfFile::edf_plus(kind, "2", (4, &[1, 2, 3, 4, 5, 6, 7, 8]), &lists));
    let signals = ["EEG Fp1-LE", "EEG Cz-LE", "Status"];
    let signals = signals.map(|label| EdfSignal::int16(label, 2, &[1, -2, 3, -4]));
    let plain = EdfFile::edf("-1", signals.into());
    let files = plus.into_iter().chain([plain]);
    files.map(|file| file.bytes()).collect()
}

pub(crate) fn bdf_seeds() -> Vec<Vec<u8>> {
    ["2", "-1"].map(|records| EdfFile::bdf(records, 4, vec![7; 24]).bytes()).into()
}

pub(crate) fn gdf_seeds() -> Vec<Vec<u8>> {
    let mut seeds = Vec::new();
    for (version_1, records) in [(false, 2), (true, 2), (false, -1), (true, -1)] {
        for type_number in [1, 2, 3, 4, 5, 6, 7, 16, 17, 279, 535] {
            let signal = GdfSignal::with_type(type_number, 2, (0..32).collect());
            let mut file = GdfFile::version_2(records, vec![signal]);
            file.version_1 = version_1;
            if records > 0 {
                file.events = event_table(2.0, &[(1, 769), (2, 0x8301)]);
            }
            seeds.push(file.bytes());
        }
    }
    seeds
}

/// Reads and plays a recording. The recording must have no more samples and no more events than the
/// input has bytes, and the played samples must fit the ADC.
pub(crate) fn recording(bytes: &[u8]) -> Outcome {
    let Ok(mut recording) = Recording::from_source(Cursor::new(bytes.to_vec())) else {
        return Outcome::Refused;
    };
    let mut block = Block::default();
    let mut samples = 0;
    while recording.read_block(&mut block).expect("bytes are readable") {
        samples += block.samples.iter().map(Vec::len).sum::<usize>();
    }
    assert!(samples <= bytes.len(), "{samples} samples from {} bytes", bytes.len());
    let events = recording.onsets().expect("bytes are readable").seconds.len();
    assert!(events <= bytes.len(), "{events} events from {} bytes", bytes.len());
    for warning in recording.warnings() {
        assert!(!warning.to_string().is_empty());
    }
    let again = Recording::from_source(Cursor::new(bytes.to_vec())).expect("readable as before");
    if let Ok(map) = MontageMap::new(&again.labels(), &["Cz"], Missing::Zero)
        && let Ok(adc) = VirtualAdc::new(again, &map, AdcSpec::ads1299(512))
    {
        for counts in adc.take(PLAYED) {
            let counts = counts.expect("bytes are readable");
            assert!((-8_388_608..=8_388_607).contains(&counts[0]));
        }
    }
    Outcome::Accepted
}

pub(crate) fn wire_recording_seeds() -> Vec<Vec<u8>> {
    let header =
        FileHeader { created_ns: 1_700_000_000_000_000_000, streams: Streams::ALL, mains_hz: 50 };
    let at = |us| HostTime { monotonic_us: us, wall_ns: header.created_ns + us * 1000 };
    let mut recorder = Recorder::new(header);
    recorder.opened(at(0));
    let stream = wire::stream(Streams::CODES);
    for (number, piece) in (1..).zip(stream.chunks(100)) {
        recorder.received(piece, at(number * 10_000));
    }
    recorder.ending(at(1_500_000));
    recorder.closed(at(1_500_000));
    vec![recorder.take()]
}

/// Reads a recording of the bridge. The header, the records' contents and the skipped bytes
/// together must not be longer than the file.
pub(crate) fn wire_recording(bytes: &[u8]) -> Outcome {
    let Ok(mut reader) = RecordingReader::new(bytes) else {
        return Outcome::Refused;
    };
    let mut records = 0;
    let mut payload = 0;
    while let Some(record) = reader.next_record().expect("a slice is readable") {
        records += 1;
        payload += record.payload.len();
    }
    let left_out = reader.left_out();
    let left_out = usize::try_from(left_out.within + left_out.at_end).expect("few bytes");
    assert!(FileHeader::BYTES + payload + left_out <= bytes.len());
    Outcome::accepted_if(records > 0)
}

pub(crate) fn code_file_seeds() -> Vec<Vec<u8>> {
    [Streams::CODES, Streams::PACKED].map(wire::stream).into()
}

/// Decodes a file of codes to a GDF file, which must have as many rows as the decoder reports.
pub(crate) fn code_file(bytes: &[u8]) -> Outcome {
    static MODEL: LazyLock<Model> = LazyLock::new(|| Model::embedded().expect("the model"));
    static FOLDER: LazyLock<TempDir> = LazyLock::new(|| tempfile::tempdir().expect("a folder"));
    let [input, output] = ["in.codes", "out.gdf"].map(|name| FOLDER.path().join(name));
    fs::write(&input, bytes).expect("room");
    let decoding = Decoding {
        model: &MODEL,
        format: SignalFormat::Gdf,
        kind: None,
        existing: Existing::Replace,
    };
    let Ok(decoded) = decoding.decode(&input, &output, None, &Progress::default()) else {
        return Outcome::Refused;
    };
    let mut written = Recording::open(&output).expect("a recording");
    let mut block = Block::default();
    let mut rows = 0;
    while written.read_block(&mut block).expect("readable") {
        rows += block.samples[0].len() as u64;
    }
    assert_eq!(rows, decoded.rows);
    Outcome::Accepted
}

pub(crate) fn dfu_seeds() -> Vec<Vec<u8>> {
    let images = [("NUCLEO-H743ZI2", 100), ("NUCLEO-F446RE", 0)].map(|(board, length)| Image {
        board: board.to_owned(),
        firmware: "0.1.0 5d4b736".to_owned(),
        model: "2acfeb29e96e2dab".to_owned(),
        address: 0x0800_0000,
        content: vec![7; length],
    });
    images.map(|image| image.to_dfu().expect("a short image")).into()
}

/// Reads a firmware image from the bytes, as they are and with a correct checksum. An image that
/// was read must be readable again after it is written.
pub(crate) fn dfu(bytes: &[u8]) -> Outcome {
    let accepted = Image::from_dfu(bytes).is_ok();
    let mut signed = bytes[..bytes.len().saturating_sub(4)].to_vec();
    let checksum = Crc::<u32>::new(&CRC_32_JAMCRC).checksum(&signed);
    signed.extend(checksum.to_le_bytes());
    if let Ok(image) = Image::from_dfu(&signed) {
        assert!(image.content.len() < bytes.len());
        if let Ok(file) = image.to_dfu() {
            assert_eq!(Image::from_dfu(&file).as_ref(), Ok(&image));
        }
    }
    Outcome::accepted_if(accepted)
}

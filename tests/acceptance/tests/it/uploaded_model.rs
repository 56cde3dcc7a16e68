//! A board that was built with one model streams with another model that the bridge uploads, even
//! after a restart in the middle of a stream.

use std::path::Path;

use acceptance::port::free_address;
use acceptance::printing::{self, board, messages, values};
use acceptance::process::SLACK;
use any_model::{any_linear_for, any_packed_of};
use artifact::reconstruction::{PackedDecoder, dequantise};
use artifact::{Artifact, PackedModel};
use host_sim::{Identity, Outbox, VirtualBoard, WhenFull};
use link::{
    Decoder, Encoder, Flags, MAX_CHUNK_BYTES, MAX_FRAME, ModelBegin, ModelChunk, Start, Streams,
    ToDevice, ToHost, model_crc,
};
use model::{ADC_RATE_HZ, HAS_SHORTCUT, HOP, STEP_RATE_HZ};
use pipeline::{Mains, PackedEncoder, Rate};

use crate::inputs::{self, synthetic};

/// Duration of each board's stream, seconds, unless the test ends it earlier.
const SECONDS: usize = 6;
const BLOCKS: usize = SECONDS * STEP_RATE_HZ as usize / HOP;
/// Topic of the frames that the bridge decodes from blocks.
const DECODED: &str = "/neurodata_reconstructed";

/// Writes the built-in model to `folder`, with another packed model and, if the board takes one, a
/// linear code.
fn write_personal(folder: &Path) -> Artifact {
    let mut artifact = inputs::artifact();
    let packed = any_packed_of(model::PACKED_COEFFICIENTS, 7, &artifact.description);
    if HAS_SHORTCUT {
        artifact = any_linear_for(2, &artifact).expect("a model");
    }
    let artifact = artifact.with_packed(Some(packed)).expect("it fits");
    artifact.write(folder).expect("written");
    artifact
}

/// Returns the frames that the library decodes from the packed blocks of a board with the model,
/// each before the next block improves it. Also returns the board's dequantised codes if the model
/// has a linear code.
fn expected(artifact: &Artifact, packed: &PackedModel) -> [Vec<Vec<f32>>; 2] {
    let outbox = Outbox::new(WhenFull::Wait);
    let mut board = VirtualBoard::new(Identity::default(), Mains::Hz50, outbox.clone());
    let mut encoder = Encoder::starting_at(0);
    let mut send = |command: ToDevice<'_>| {
        let mut buffer = [0; MAX_FRAME];
        let frame = encoder.encode(0, &command, &mut buffer);
        board.receive(frame.expect("a command fits"), 0);
    };
    let bytes = model_gen::upload(artifact).expect("it fits").expect("it has one");
    send(ToDevice::ModelBegin(ModelBegin {
        id: artifact.id.0,
        bytes: u32::try_from(bytes.len()).expect("short"),
        crc: model_crc(&bytes),
    }));
    let offsets = (0..).step_by(MAX_CHUNK_BYTES);
    for (offset, bytes) in offsets.zip(bytes.chunks(MAX_CHUNK_BYTES)) {
        send(ToDevice::ModelChunk(ModelChunk { offset, bytes }));
    }
    send(ToDevice::ModelEnd);
    send(ToDevice::Start(Start {
        streams: if HAS_SHORTCUT { Streams::PACKED | Streams::CODES } else { Streams::PACKED },
        mains_hz: 50,
    }));
    for sample in synthetic(7).take(SECONDS * usize::from(ADC_RATE_HZ)) {
        board.process_sample(&sample, 0);
    }
    let mut decoder = PackedDecoder::new(packed);
    let rate = Rate::new(packed.description.rate).expect("a rate");
    assert_eq!(rate, PackedEncoder::DEFAULT_RATE);
    let mut frames = Decoder::<MAX_FRAME>::new();
    let integers = model_gen::quantise(artifact).expect("it fits");
    let numbers = integers.code_scale.iter().zip(&integers.code_zero_point);
    let (mut decoded, mut codes) = (Vec::new(), Vec::new());
    for frame in outbox.take_all() {
        let mut bytes = &frame[..];
        while let Some(frame) = frames.next::<ToHost<'_>>(&mut bytes) {
            match frame.expect("intact").message {
                ToHost::PackedCode(code) => {
                    let block = decoder.decode(code.bytes, rate);
                    decoded.push(block.expect("a block of this model").microvolts);
                }
                ToHost::Code(code) => {
                    let levels = code.values.levels().zip(numbers.clone());
                    let z = levels.map(|(level, (scale, zero))| dequantise(level, *scale, *zero));
                    codes.push(z.collect());
                }
                _ => {}
            }
        }
    }
    assert_eq!(decoded.len(), BLOCKS);
    [decoded, codes]
}

/// Returns the index (of a block or window) and the values of each printed frame of `topic` that is
/// no filler.
fn printed(lines: &str, topic: &str) -> Vec<(u64, Vec<f32>)> {
    let frames = messages(lines, topic).filter_map(|message| {
        let word = |index: usize| message["tri"]["data"][index].as_u64().expect("a number");
        let is_filler = word(0) & u64::from(Flags::FILLER.bits()) != 0;
        (!is_filler).then(|| (word(1), values(&message, "eeg")))
    });
    frames.collect()
}

#[test]
fn a_board_streams_with_the_model_that_the_bridge_gives_it_also_after_a_restart() {
    if model::PACKED.is_none() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let personal = folder.join("personal");
    let artifact = write_personal(&personal);
    let packed = artifact.packed.clone().expect("a packed model");
    let [blocks, codes] = expected(&artifact, &packed);
    assert_eq!(codes.is_empty(), !HAS_SHORTCUT);

    let port = free_address();
    let personal = personal.display().to_string();
    let options = [
        if HAS_SHORTCUT { "--streams=codes,packed" } else { "--streams=packed" },
        "--low-latency",
        "--upload-model",
        &personal,
    ];
    let first = board(folder, SECONDS, &port);
    let mut printing = printing::print(folder, &port, &options);
    printing.wait_until("two seconds", SLACK, |bridge| {
        printed(&bridge.output(), DECODED).len() >= 2 * BLOCKS / SECONDS
    });
    drop(first);
    let second = board(folder, SECONDS, &port);
    printing.wait_until("the second run", SLACK, |bridge| {
        let frames = printed(&bridge.output(), DECODED);
        let starts = frames.iter().filter(|(block, _)| *block == 0).count();
        starts == 2 && frames.last().is_some_and(|(block, _)| *block == BLOCKS as u64 - 1)
    });
    drop(second);
    let [lines, log] = printing::stop(printing, folder);
    for (topic, expected) in [(DECODED, blocks), ("/encoded", codes)] {
        let frames = printed(&lines, topic);
        for (at, values) in &frames {
            let expected = usize::try_from(*at).ok().and_then(|at| expected.get(at));
            assert!(expected == Some(values), "{topic} {at}");
        }
        assert!(
            frames.len() >= expected.len() * 4 / 3,
            "{} frames of {} and a part on {topic}",
            frames.len(),
            expected.len()
        );
    }
    let uses = format!("uses model {}", artifact.id);
    assert_eq!(log.matches(&uses).count(), 2, "{log}");
    let diagnostics = messages(&lines, "/diagnostics").last().expect("a report");
    assert!(diagnostics.to_string().contains(&artifact.id.to_string()), "{diagnostics}");
}

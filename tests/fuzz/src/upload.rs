//! Fuzz target for models that a host uploads to a device.

use any_model::any_linear_for;
use artifact::Artifact;
use host_sim::{Identity, Outbox, VirtualBoard, WhenFull};
use link::{
    AckResult, Decoder, Encoder, MAX_CHUNK_BYTES, MAX_FRAME, ModelBegin, ModelChunk, Start,
    Streams, ToDevice, ToHost, model_crc,
};
use pipeline::{MAX_PACKED_BYTES, Mains, Sample};

use crate::Outcome;

/// Returns the built-in model as the host uploads it, alone and with a linear code.
pub(crate) fn seeds() -> Vec<Vec<u8>> {
    let artifact = Artifact::from_files(model::artifact_files::FILES).expect("a model");
    let linear = any_linear_for(2, &artifact).expect("a model");
    let uploads = [artifact, linear].map(|model| model_gen::upload(&model));
    let uploads = uploads.into_iter();
    uploads.filter_map(|upload| upload.expect("it fits the device")).collect()
}

/// Uploads a model with a valid CRC, whatever its bytes, and encodes noise and the ADC's extreme
/// values with it. A device that accepts the model must make blocks of the permitted length; no
/// model may make a device hang or panic.
pub(crate) fn uploaded_model(bytes: &[u8]) -> Outcome {
    let outbox = Outbox::new(WhenFull::Wait);
    let mut board = VirtualBoard::new(Identity::default(), Mains::Hz50, outbox.clone());
    let mut encoder = Encoder::starting_at(0);
    let mut send = |board: &mut VirtualBoard, command: ToDevice<'_>| {
        let mut buffer = [0; MAX_FRAME];
        let frame = encoder.encode(0, &command, &mut buffer);
        board.receive(frame.expect("a command fits a frame"), 0);
    };
    let length = u32::try_from(bytes.len()).unwrap_or(u32::MAX);
    let begin = ModelBegin { id: [1; 8], bytes: length, crc: model_crc(bytes) };
    send(&mut board, ToDevice::ModelBegin(begin));
    for (offset, bytes) in (0..).step_by(MAX_CHUNK_BYTES).zip(bytes.chunks(MAX_CHUNK_BYTES)) {
        send(&mut board, ToDevice::ModelChunk(ModelChunk { offset, bytes }));
    }
    send(&mut board, ToDevice::ModelEnd);
    // The device refuses codes that a host with this model could not decode, and continues.
    for streams in [Streams::PACKED, Streams::PACKED | Streams::CODES] {
        let mains_hz = 50;
        send(&mut board, ToDevice::Start(Start { streams, mains_hz }));
    }
    for number in 0..u64::from(model::ADC_RATE_HZ) / 2 {
        let mixed = |channel: usize| {
            let noise = (number * 7919 + channel as u64 * 104_729) % 4001;
            match number % 16 {
                0 => Sample::MAX,
                8 => -Sample::MAX,
                _ => i32::try_from(noise).unwrap_or(0) - 2000,
            }
        };
        let counts = std::array::from_fn(mixed);
        board.process_sample(&Sample { counts }, number * 1_953);
    }
    let mut decoder = Decoder::<MAX_FRAME>::new();
    let (mut ids, mut blocks, mut ends) = (0, 0, None);
    for frame in outbox.take_all() {
        let mut bytes = &frame[..];
        while let Some(frame) = decoder.next::<ToHost<'_>>(&mut bytes) {
            match frame.expect("a board sends intact frames").message {
                ToHost::Hello(hello) => ids += u32::from(hello.model_id == begin.id),
                ToHost::Ack(ack) if ack.of > 0 && ends.is_none() => {
                    let chunks = length.div_ceil(1024);
                    ends = (ack.of == chunks + 1).then_some(ack.result);
                }
                ToHost::PackedCode(code) => {
                    assert!(code.bytes.len() <= MAX_PACKED_BYTES);
                    blocks += 1;
                }
                _ => {}
            }
        }
    }
    let is_used = ends == Some(AckResult::Done);
    assert_eq!(ids, u32::from(is_used), "the id is that of the model in use");
    assert_eq!(blocks, 8, "the board streams with either model");
    Outcome::accepted_if(is_used)
}

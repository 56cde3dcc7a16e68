//! The hex dumps of docs/wire-format.md equal the encoder's output, byte for byte.

use link::{
    BlockForm, COUNT_BYTES, Code, CompressedRaw, Decoder, Encoder, FILTERED_STEPS, Filtered, Flags,
    MAX_FRAME, Message, PackedCode, Quality, RAW_SAMPLES, Raw, ResetInto, Stage, StageTiming,
    Start, Streams, Timing, ToDevice, ToHost, VALUE_BYTES,
};

use crate::messages::{
    self, CHUNK, FILTERS, MODEL, POLICY, code, code_of_16_bits, code_with_exponent, packed_code,
    quality,
};

const DOCUMENT: &str = include_str!("../../../../docs/wire-format.md");

/// Returns name and bytes of each fenced block that opens with ```` ```hex NAME ````.
fn dumps() -> Vec<(&'static str, Vec<u8>)> {
    let mut dumps = Vec::new();
    let mut lines = DOCUMENT.lines();
    while let Some(line) = lines.next() {
        let Some(name) = line.strip_prefix("```hex ") else {
            continue;
        };
        let bytes = lines
            .by_ref()
            .take_while(|line| *line != "```")
            .flat_map(str::split_whitespace)
            .map(|byte| u8::from_str_radix(byte, 16).unwrap())
            .collect();
        dumps.push((name, bytes));
    }
    dumps
}

fn frame<'m, M: Message<'m>>(seq: u32, device_time_us: u64, message: &M) -> Vec<u8> {
    let mut buffer = [0; MAX_FRAME];
    Encoder::starting_at(seq).encode(device_time_us, message, &mut buffer).unwrap().to_vec()
}

/// Checks that the dump `name` is the frame of `message`, and that the frame decodes to `message`.
fn check<'d, M: Message<'d> + PartialEq + core::fmt::Debug>(
    decoder: &'d mut Decoder,
    (name, (seq, device_time_us), message): (&str, (u32, u64), M),
) {
    let made = frame(seq, device_time_us, &message);
    let hex: Vec<String> = made.iter().map(|byte| format!("{byte:02x}")).collect();
    let hex: Vec<String> = hex.chunks(16).map(|row| row.join(" ")).collect();
    let hex = hex.join("\n");
    let documented = dumps().into_iter().find(|(documented, _)| *documented == name);
    let documented = documented.map(|(_, bytes)| bytes).unwrap_or_default();
    assert!(documented == made, "docs/wire-format.md should have\n```hex {name}\n{hex}\n```");
    let decoded = decoder.next::<M>(&mut documented.as_slice()).unwrap().unwrap();
    assert_eq!((decoded.header.seq, decoded.header.device_time_us), (seq, device_time_us));
    assert_eq!(decoded.message, message);
}

#[test]
fn every_dump_equals_the_encoders_output() {
    let start = ToDevice::Start(Start { streams: Streams::CODES, mains_hz: 50 });
    let sync_time = ToDevice::SyncTime { host_time_us: 1_700_000_000_000_000 };
    let commands = [
        ("identify", (0, 0), ToDevice::Identify),
        ("start", (1, 0), start),
        ("stop", (2, 0), ToDevice::Stop),
        ("ping", (3, 0), ToDevice::Ping),
        ("self-test-command", (4, 0), ToDevice::SelfTest),
        ("sync-time", (5, 0), sync_time),
        ("reset", (6, 0), ToDevice::Reset(ResetInto::Bootloader)),
        ("set-rate", (7, 0), ToDevice::SetRate { rate: 6 }),
        ("set-exclusion", (8, 0), ToDevice::SetExclusion(POLICY)),
        ("model-begin", (9, 0), ToDevice::ModelBegin(MODEL)),
        ("model-chunk", (10, 0), ToDevice::ModelChunk(CHUNK)),
        ("model-end", (11, 0), ToDevice::ModelEnd),
        ("set-features", (12, 0), ToDevice::SetFeatures(FILTERS)),
        ("set-impedance", (13, 0), ToDevice::SetImpedance { on: true }),
    ];
    let messages = messages::all();
    let compared = commands.len() + messages.len();
    for command in commands {
        check(&mut Decoder::new(), command);
    }
    for message in messages {
        check(&mut Decoder::new(), message);
    }
    assert_eq!(dumps().len(), compared, "a dump that no test compares");
}

/// Asserts that docs/wire-format.md contains `words`.
fn assert_documented(words: &str) {
    assert!(DOCUMENT.contains(words), "{words}");
}

#[test]
fn the_document_states_the_size_of_a_code_frame() {
    let length = |message| {
        let ToHost::Code(code) = message else { panic!() };
        let day = Code { window: 16 * 86_400, first_sample: 512 * 86_400, saturated: 0, ..code };
        frame(16 * 86_400, 86_400_000_000, &ToHost::Code(day)).len()
    };
    let words = format!(
        "{} bytes after a day of streaming, {} with an exponent, {} in 16 bits",
        length(code()),
        length(code_with_exponent()),
        length(code_of_16_bits())
    );
    assert_documented(&words);
}

#[test]
fn the_document_states_the_size_of_a_packed_code_frame() {
    let ToHost::PackedCode(code) = packed_code() else { panic!() };
    // The block is as long as the mean block at quantiser rate 4, which has 195 bits
    // (docs/packed.md).
    let block = [1; 24];
    let day = ToHost::PackedCode(PackedCode {
        block: 16 * 86_400,
        flags: Flags::empty(),
        clipped: 0,
        saturated: 0,
        bytes: &block,
        ..code
    });
    let bytes = frame(16 * 86_400, 86_400_000_000, &day).len();
    let words = format!(
        "takes {} bytes and its block after a day of streaming: {bytes} with the default model at rate 4, \
         0.{} kB/s",
        bytes - block.len(),
        (16 * bytes).div_ceil(10)
    );
    assert_documented(&words);
}

#[test]
fn the_document_states_the_size_of_a_quality_frame() {
    let ToHost::Quality(quality) = quality() else { panic!() };
    let length = |electrode| {
        let day = Quality {
            first_sample: 512 * 86_400,
            electrodes: core::iter::repeat_n(quality.electrodes[electrode], 61).collect(),
            ..quality
        };
        frame(16 * 86_400, 86_400_000_000, &ToHost::Quality(day)).len()
    };
    let words = format!("{} to {} bytes for 61 electrodes, every second", length(0), length(1));
    assert_documented(&words);
}

#[test]
fn the_document_states_the_size_of_a_timing_frame() {
    let stage = |stage, per_second: u32| StageTiming {
        stage,
        deadline_ns: 1_000_000_000 / per_second,
        worst_ns: u32::MAX,
        // An upper bound of the counts: every element counts all durations of a day.
        histogram: [86_400 * per_second; 9],
    };
    let stages = [
        stage(Stage::Acquire, 512),
        stage(Stage::Step, 128),
        stage(Stage::Code, 16),
        stage(Stage::Send, 16),
    ];
    let timing =
        Timing { stages: stages.into_iter().collect(), stack_used: 5_120, stack_size: 16_384 };
    let bytes = frame(16 * 86_400, 86_400_000_000, &ToHost::Timing(timing)).len();
    let words = format!("A timing frame takes at most {bytes} bytes for four stages after a day");
    assert_documented(&words);
}

#[test]
fn every_stage_is_in_the_document() {
    for number in 0..=u8::MAX {
        let stage = Stage::from(number);
        let row = format!("| {number} | {stage} |");
        let is_newer = matches!(stage, Stage::Newer(_));
        assert!(is_newer || DOCUMENT.contains(&row), "{row}");
    }
}

#[test]
fn every_flag_is_in_the_document() {
    for (flag, name) in Flags::NAMES {
        let row = format!("| {} | {name} |", flag.bits().trailing_zeros());
        assert!(DOCUMENT.contains(&row), "{row}");
    }
}

#[test]
fn the_document_states_the_sizes_of_raw_and_filtered_frames() {
    let counts = [1; 64 * RAW_SAMPLES * COUNT_BYTES];
    let raw = ToHost::Raw(Raw {
        first_sample: 512 * 86_400,
        channels: 64,
        flags: Flags::empty(),
        counts: &counts,
    });
    let values = [1; 61 * FILTERED_STEPS * VALUE_BYTES];
    let filtered = ToHost::Filtered(Filtered {
        first_step: 128 * 86_400,
        electrodes: 61,
        fraction_bits: 5,
        flags: Flags::empty(),
        values: &values,
    });
    let compressed = |bytes| {
        ToHost::CompressedRaw(CompressedRaw {
            first_sample: 512 * 86_400,
            channels: 64,
            flags: Flags::empty(),
            form: BlockForm::Verbatim,
            samples: 8,
            bytes,
        })
    };
    let bytes = |message| frame(64 * 86_400, 86_400_000_000, &message).len();
    let longest = bytes(compressed(&counts));
    let [raw, filtered] = [raw, filtered].map(bytes);
    // Mean length, in bytes, of compressed raw frames with host-sim's synthetic EEG; a test of
    // host-sim measures it.
    let mean = 723;
    let per_second = |bytes: usize, frames: usize| (bytes * frames).div_ceil(1_000);
    let words = format!(
        "a raw frame {raw} bytes, 64 times a second ({} kB/s); a compressed raw frame at most {longest}, \
         with synthetic EEG {mean} in the mean ({} kB/s); a filtered frame {filtered}, 32 times \
         ({} kB/s)",
        per_second(raw, 64),
        per_second(mean, 64),
        per_second(filtered, 32)
    );
    assert_documented(&words);
}

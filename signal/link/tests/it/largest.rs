//! Every message fits the buffers, even with its largest content.

use link::{
    Ack, AckResult, Audit, BlockForm, COUNT_BYTES, Capabilities, ChannelFault, ChannelTest,
    ChipTest, Code, CodeFormat, CodeValues, CompressedRaw, Converters, Decoder, ElectrodeQuality,
    Encoder, FILTERED_STEPS, Filtered, Flags, Hello, MAX_BODY, MAX_CHIPS, MAX_CHUNK_BYTES,
    MAX_ELECTRODES, MAX_FRAME, MAX_LABELS_BYTES, MAX_NUMBERS, MAX_STAGES, MAX_TEXT_BYTES, Message,
    ModelChunk, PackedCode, Quality, RAW_SAMPLES, Raw, ResetCause, SelfTest, Stage, StageTiming,
    Start, Stats, Streams, Timing, ToDevice, ToHost, VALUE_BYTES,
};

/// Returns the length in bytes of the message's body, with the largest header.
fn body_bytes<'m, M: Message<'m>>(message: &M) -> usize {
    let mut buffer = [0; MAX_FRAME];
    let mut encoder = Encoder::starting_at(u32::MAX);
    let frame = encoder.encode(u64::MAX, message, &mut buffer).unwrap();
    let mut body = frame[1..frame.len() - 1].to_vec();
    cobs::decode_in_place(&mut body).unwrap()
}

fn capabilities<'a>(labels: &'a str, filters: &'a str) -> ToHost<'a> {
    ToHost::Capabilities(Capabilities {
        adc_rate_hz: u16::MAX,
        step_rate_hz: u16::MAX,
        window_steps: u8::MAX,
        hop_steps: u8::MAX,
        channels: u8::MAX,
        lsb_nv: f32::MAX,
        mains_hz: u8::MAX,
        group_delay_us: u32::MAX,
        labels,
        filters,
        code_format: CodeFormat::Newer(u8::MAX),
        code_scale: heapless::Vec::from_array([f32::MAX; MAX_NUMBERS]),
        code_zero_point: heapless::Vec::from_array([-1; MAX_NUMBERS]),
    })
}

#[test]
fn the_largest_frame_fits() {
    let labels = "x".repeat(MAX_LABELS_BYTES);
    let text = "x".repeat(MAX_TEXT_BYTES);
    let largest = body_bytes(&capabilities(&labels, &text));
    // Sum in bytes: 16 header (1 + 5 + 10), 1 message number, 3 + 3 rates, 3 dimensions, 4 LSB, 1
    // mains, 5 delay, 2 + 512 labels, 2 + 256 filters, 1 format, 2 + 1024 scales, 2 + 256 zero
    // points, 4 CRC.
    assert_eq!(largest, 2097);
    assert!(largest <= MAX_BODY);

    let hello = ToHost::Hello(Hello {
        firmware: &text,
        board: &text,
        chip_uid: [255; 12],
        model_id: [255; 8],
        session_id: u32::MAX,
        reset_cause: ResetCause::Newer(255),
        fault: &text,
    });
    let code = ToHost::Code(Code {
        model_id: [255; 8],
        window: u32::MAX,
        first_sample: u64::MAX,
        flags: Flags::from_bits(u16::MAX),
        clipped: u16::MAX,
        clipped_values: u8::MAX,
        saturated: u64::MAX,
        values: CodeValues::int16(&[255; 2 * MAX_NUMBERS]),
    });
    let stats = ToHost::Stats(Stats {
        streams: Streams::from_bits(u16::MAX),
        next_window: u32::MAX,
        codes_made: u32::MAX,
        frames_dropped: u32::MAX,
        samples: u64::MAX,
        overruns: u32::MAX,
        adc_status_bad: u32::MAX,
        clipped: u32::MAX,
        clipped_values: u32::MAX,
        commands: u32::MAX,
        input_bad: u32::MAX,
    });
    let ack = ToHost::Ack(Ack { of: u32::MAX, result: AckResult::Newer(255) });
    let quality = ToHost::Quality(Quality {
        first_sample: u64::MAX,
        settling: true,
        electrodes: heapless::Vec::from_array(
            [ElectrodeQuality {
                rms_uv: f32::MAX,
                mains_uv: f32::MAX,
                mains_residual_uv: f32::MAX,
                samples_at_rail: u16::MAX,
                flat: true,
            }; MAX_ELECTRODES],
        ),
    });
    let timing = ToHost::Timing(Timing {
        stages: heapless::Vec::from_array(
            [StageTiming {
                stage: Stage::Newer(255),
                deadline_ns: u32::MAX,
                worst_ns: u32::MAX,
                histogram: [u32::MAX; 9],
            }; MAX_STAGES],
        ),
        stack_used: u32::MAX,
        stack_size: u32::MAX,
    });
    let packed = ToHost::PackedCode(PackedCode {
        block: u32::MAX,
        rate: u8::MAX,
        flags: Flags::from_bits(u16::MAX),
        clipped: u16::MAX,
        saturated: u64::MAX,
        bytes: &[255; 118],
    });
    for other in [hello, code, stats, ack, quality, timing, packed] {
        assert!(body_bytes(&other) < largest, "{other:?}");
    }
    let start = Start { streams: Streams::from_bits(u16::MAX), mains_hz: 255 };
    assert!(body_bytes(&ToDevice::Start(start)) < 32);
    let chunk = |length: usize| {
        ToDevice::ModelChunk(ModelChunk {
            offset: u32::MAX,
            bytes: &[255; MAX_CHUNK_BYTES + 1][..length],
        })
    };
    // 21 bytes of header, message number and CRC, then offset and bytes.
    assert_eq!(body_bytes(&chunk(MAX_CHUNK_BYTES)), 21 + 5 + MAX_CHUNK_BYTES);
    for length in [0, 1, MAX_CHUNK_BYTES, MAX_CHUNK_BYTES + 1] {
        let mut buffer = [0; MAX_FRAME];
        let frame = Encoder::default().encode(0, &chunk(length), &mut buffer);
        let mut decoder = Decoder::<MAX_FRAME>::new();
        let read = decoder.next::<ToDevice>(&mut frame.unwrap()).unwrap();
        let is_allowed = (1..=MAX_CHUNK_BYTES).contains(&length);
        assert_eq!(read.is_ok(), is_allowed, "{length}");
    }
}

#[test]
fn samples_windows_and_self_tests_fit_a_frame() {
    let text = "x".repeat(MAX_TEXT_BYTES);
    let bytes = [0xff; 64 * RAW_SAMPLES * COUNT_BYTES];
    // Planes of the largest model: 32 steps of a grid of 12 x 12 cells.
    let cells = [0xff; 32 * 12 * 12];
    let raw = ToHost::Raw(Raw {
        first_sample: u64::MAX,
        channels: 64,
        flags: Flags::from_bits(u16::MAX),
        counts: &bytes,
    });
    let compressed = ToHost::CompressedRaw(CompressedRaw {
        first_sample: u64::MAX,
        channels: 64,
        flags: Flags::from_bits(u16::MAX),
        form: BlockForm::Newer(255),
        samples: 8,
        bytes: &bytes,
    });
    let filtered = ToHost::Filtered(Filtered {
        first_step: u64::MAX,
        electrodes: 64,
        fraction_bits: u8::MAX,
        flags: Flags::from_bits(u16::MAX),
        values: &bytes[..64 * FILTERED_STEPS * VALUE_BYTES],
    });
    let audit = ToHost::Audit(Audit {
        model_id: [255; 8],
        window: u32::MAX,
        planes: &cells,
        values: CodeValues::int16(&[255; 2 * MAX_NUMBERS]),
    });
    let converters = ToHost::Converters(Converters {
        fault: text.as_str().try_into().unwrap(),
        drdy_millihertz: u32::MAX,
        off_positive: u64::MAX,
        off_negative: u64::MAX,
        frames_bad: heapless::Vec::from_array([u32::MAX; MAX_CHIPS]),
    });
    let chip = ChipTest {
        id: u8::MAX,
        registers_wrong: u8::MAX,
        first_wrong: u8::MAX,
        frames_bad: u32::MAX,
    };
    let channel = ChannelTest { fault: ChannelFault::Newer(255), ..ChannelTest::default() };
    let self_test = ToHost::SelfTest(SelfTest {
        fault: text.as_str().try_into().unwrap(),
        drdy_millihertz: u32::MAX,
        expected_millihertz: u32::MAX,
        drdy_early: u32::MAX,
        drdy_missed: u32::MAX,
        chips: heapless::Vec::from_array([chip; MAX_CHIPS]),
        channels: heapless::Vec::from_array([channel; MAX_ELECTRODES]),
    });
    let [raw, compressed, filtered, audit, converters, self_test] =
        [raw, compressed, filtered, audit, converters, self_test]
            .map(|message| body_bytes(&message));
    // Each sum starts with the 21 bytes of header (16), message number (1) and CRC (4); the lengths
    // of the fields follow in their order.
    assert_eq!(raw, 21 + 10 + 1 + 3 + 2 + 1536);
    assert_eq!(compressed, 21 + 10 + 1 + 3 + 1 + 1 + 2 + 1536);
    assert_eq!(filtered, 21 + 10 + 1 + 1 + 3 + 2 + 1024);
    assert_eq!(audit, 21 + 8 + 5 + 2 + 4608 + 1 + 512);
    assert_eq!(converters, 21 + 2 + 256 + 5 + 10 + 10 + 1 + 8 * 5);
    assert_eq!(self_test, 21 + 2 + 256 + 4 * 5 + 1 + 8 * 8 + 1 + 64 * 17);
    for body in [raw, compressed, filtered, audit, converters, self_test] {
        assert!(body <= MAX_BODY, "{body}");
    }
}

#[test]
fn a_body_of_the_maximum_length_fits_the_longest_frame() {
    // COBS lengthens a body without zeros the most. The only zero in this body is the message
    // number of `Hello`, unless the CRC contains a zero by chance.
    let text = "x".repeat(MAX_BODY);
    let mut frame = [0; MAX_FRAME];
    let mut longest = 0;
    for length in 0..MAX_BODY {
        let hello = ToHost::Hello(Hello {
            firmware: &text[..length],
            board: "b",
            chip_uid: [255; 12],
            model_id: [255; 8],
            session_id: u32::MAX,
            reset_cause: ResetCause::PowerOn,
            fault: "f",
        });
        match Encoder::starting_at(u32::MAX).encode(u64::MAX, &hello, &mut frame) {
            Ok(frame) => longest = frame.len(),
            Err(error) => {
                assert!(error.to_string().contains("5376"));
                assert!(longest > MAX_BODY && longest <= MAX_FRAME, "{longest}");
                return;
            }
        }
    }
    panic!("a body beyond the limit was accepted");
}

#[test]
fn a_short_buffer_is_refused_and_uses_up_the_number() {
    let mut encoder = Encoder::default();
    for length in 0..8 {
        assert!(encoder.encode(0, &ToDevice::Ping, &mut vec![0; length]).is_err(), "{length}");
    }
    encoder.skip();
    assert_eq!(encoder.next_seq(), 9);
    let mut buffer = [0; MAX_FRAME];
    let mut input = encoder.encode(0, &ToDevice::Ping, &mut buffer).unwrap();
    let mut decoder = Decoder::<64>::new();
    let frame = decoder.next::<ToDevice>(&mut input).unwrap().unwrap();
    assert_eq!(frame.header.seq, 9);
}

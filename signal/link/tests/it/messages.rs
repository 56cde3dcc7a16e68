//! One message of each kind, with the contents of the dumps in `docs/wire-format.md`.

use link::{
    Ack, AckResult, Audit, BandPass, BlockForm, Capabilities, ChannelFault, ChannelTest, ChipTest,
    ClockReading, Code, CodeFormat, CodeValues, CompressedRaw, Converters, ElectrodeQuality, Event,
    EventKind, Exclusion, ExclusionPolicy, FeatureFilters, Features, Filtered, Flags, Hello,
    Impedance, ModelBegin, ModelChunk, ModelReceived, PackedCode, Quality, Raw, ResetCause,
    SelfTest, Stage, StageTiming, Stats, Streams, Substitutes, Timing, ToHost,
};

/// Announcement of a model of 300 bytes, and the part of it from byte 256 on.
pub(crate) const MODEL: ModelBegin = ModelBegin {
    id: [0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88],
    bytes: 300,
    crc: 0xDEAD_BEEF,
};
pub(crate) const CHUNK: ModelChunk<'_> = ModelChunk { offset: 256, bytes: &[0, 1, 2, 0xFF, 0x80] };

/// Two filters of two electrodes, and a band-pass of 8 to 30 Hz.
pub(crate) const FILTERS: FeatureFilters<'_> = FeatureFilters {
    id: 0xC0DE_F17E,
    first: BandPass { gain: 1_732_880_386, a1: 6_412_710_145, a2: -2_805_971_273 },
    second: BandPass { gain: 1_732_880_386, a1: 1_285_160_498, a2: -1_524_016_507 },
    weights: &[127, 0x81, 64, 64],
};

fn features() -> ToHost<'static> {
    ToHost::Features(Features {
        id: FILTERS.id,
        hop: 301,
        flags: Flags::SUBSTITUTED,
        saturated: 1 << 20,
        levels: &[151, 96],
    })
}

/// Impedances of two electrodes: 4.2 kOhm, and a disconnected electrode.
fn impedance() -> ToHost<'static> {
    ToHost::Impedance(Impedance { ohms: &[0x68, 0x10, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF] })
}

fn model_received() -> ToHost<'static> {
    ToHost::ModelReceived(ModelReceived { crc: MODEL.crc, bytes: 256 })
}

fn hello() -> ToHost<'static> {
    ToHost::Hello(Hello {
        firmware: "0.1.0",
        board: "host-sim",
        chip_uid: *b"0123456789ab",
        model_id: [0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88],
        session_id: 0xC0DE_0001,
        reset_cause: ResetCause::PowerOn,
        fault: "",
    })
}

/// `Capabilities` of a board with two electrodes and two code values, to keep the dump short.
fn capabilities() -> ToHost<'static> {
    ToHost::Capabilities(Capabilities {
        adc_rate_hz: 512,
        step_rate_hz: 128,
        window_steps: 16,
        hop_steps: 8,
        channels: 64,
        lsb_nv: 22.351_742,
        mains_hz: 50,
        group_delay_us: 16_000,
        labels: "F3 F1",
        filters: "notch 50 Hz",
        code_format: CodeFormat::Int8,
        code_scale: [0.5, 0.25].into_iter().collect(),
        code_zero_point: [0, -3].into_iter().collect(),
    })
}

/// Code values of the dumps: -64 to 63, one byte each.
const RAMP: [u8; 128] = {
    let mut ramp = [192_u8; 128];
    let mut index = 1;
    while index < ramp.len() {
        ramp[index] = ramp[index - 1].wrapping_add(1);
        index += 1;
    }
    ramp
};

/// The values of [`RAMP`] times 256, as 16-bit integers.
const WIDE_RAMP: [u8; 256] = {
    let mut ramp = [0; 256];
    let mut index = 0;
    while index < RAMP.len() {
        ramp[2 * index + 1] = RAMP[index];
        index += 1;
    }
    ramp
};

pub(crate) fn code() -> ToHost<'static> {
    ToHost::Code(code_in(CodeValues::int8(&RAMP)))
}

/// Returns the code of [`code`] with other values, as a device sends it whose model has another
/// code format.
pub(crate) fn code_in(values: CodeValues<'_>) -> Code<'_> {
    Code {
        model_id: [0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88],
        window: 300,
        first_sample: 9600,
        flags: Flags::SATURATED | Flags::SETTLING | Flags::CLIPPED | Flags::CODE_CLIPPED,
        clipped: 2,
        clipped_values: 1,
        saturated: 1 << 20,
        values,
    }
}

pub(crate) fn code_with_exponent() -> ToHost<'static> {
    ToHost::Code(code_in(CodeValues::int8_exponent(3, &RAMP)))
}

pub(crate) fn code_of_16_bits() -> ToHost<'static> {
    ToHost::Code(code_in(CodeValues::int16(&WIDE_RAMP)))
}

fn stats() -> ToHost<'static> {
    ToHost::Stats(Stats {
        streams: Streams::CODES,
        next_window: 301,
        codes_made: 301,
        frames_dropped: 0,
        samples: 9661,
        overruns: 0,
        adc_status_bad: 0,
        clipped: 2,
        clipped_values: 1,
        commands: 2,
        input_bad: 0,
    })
}

/// Signal quality of two electrodes; the second electrode has no contact.
pub(crate) fn quality() -> ToHost<'static> {
    let good = ElectrodeQuality {
        rms_uv: 12.5,
        mains_uv: 40.0,
        mains_residual_uv: 0.25,
        samples_at_rail: 0,
        flat: false,
    };
    let off = ElectrodeQuality { mains_uv: 3000.0, samples_at_rail: 300, ..good };
    ToHost::Quality(Quality {
        first_sample: 8704,
        settling: false,
        electrodes: [good, off].into_iter().collect(),
    })
}

/// Durations of two stages, measured for 19 s; one code was late.
fn timing() -> ToHost<'static> {
    let acquire = StageTiming {
        stage: Stage::Acquire,
        deadline_ns: 1_953_125,
        worst_ns: 260_000,
        histogram: [9_660, 1, 0, 0, 0, 0, 0, 0, 0],
    };
    let code = StageTiming {
        stage: Stage::Code,
        deadline_ns: 62_500_000,
        worst_ns: 63_000_000,
        histogram: [0, 0, 298, 2, 0, 0, 0, 0, 1],
    };
    ToHost::Timing(Timing {
        stages: [acquire, code].into_iter().collect(),
        stack_used: 5_120,
        stack_size: 16_384,
    })
}

/// Two samples of two channels; the second channel is at the rail in both samples.
fn raw() -> ToHost<'static> {
    ToHost::Raw(Raw {
        first_sample: 9_656,
        channels: 2,
        flags: Flags::LEAD_OFF,
        counts: &[1, 0, 0, 0xff, 0xff, 0x7f, 0xfe, 0xff, 0xff, 0, 0, 0x80],
    })
}

/// One step of two electrodes: 25 and -25 counts.
fn filtered() -> ToHost<'static> {
    ToHost::Filtered(Filtered {
        first_step: 2_412,
        electrodes: 2,
        fraction_bits: 5,
        flags: Flags::empty(),
        values: &[0x20, 3, 0, 0, 0xe0, 0xfc, 0xff, 0xff],
    })
}

/// Audit of a window of two planes with two cells each, to keep the dump short.
fn audit() -> ToHost<'static> {
    ToHost::Audit(Audit {
        model_id: [0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88],
        window: 300,
        planes: &[0, 0x7f, 0x80, 0xff],
        values: CodeValues::int8_exponent(3, &RAMP),
    })
}

fn event() -> ToHost<'static> {
    ToHost::Event(Event { kind: EventKind::TriggerRise, number: 12, sample: 9_660 })
}

/// Status of two chips; the second chip has delivered three bad frames and has a disconnected
/// electrode.
fn converters() -> ToHost<'static> {
    ToHost::Converters(Converters {
        fault: heapless::String::new(),
        drdy_millihertz: 512_003,
        off_positive: 1 << 9,
        off_negative: 0,
        frames_bad: [0, 3].into_iter().collect(),
    })
}

/// Self-test result of a chip with two channels, to keep the dump short; the second is dead.
fn self_test() -> ToHost<'static> {
    let good = ChannelTest {
        gain_error: 0.015_625,
        offset_uv: -12.5,
        noise_uv: 0.25,
        shorted_noise_uv: 0.25,
        fault: ChannelFault::None,
    };
    let dead = ChannelTest {
        gain_error: -1.0,
        offset_uv: 0.0,
        noise_uv: 0.0,
        shorted_noise_uv: 0.0,
        fault: ChannelFault::Gain,
    };
    let chip = ChipTest { id: 0x3e, ..ChipTest::default() };
    ToHost::SelfTest(SelfTest {
        fault: "chip 0, channel 2".try_into().unwrap(),
        drdy_millihertz: 512_000,
        expected_millihertz: 512_000,
        drdy_early: 0,
        drdy_missed: 0,
        chips: [chip].into_iter().collect(),
        channels: [good, dead].into_iter().collect(),
    })
}

fn clock_reading() -> ToHost<'static> {
    ToHost::ClockReading(ClockReading {
        host_time_us: 1_700_000_000_000_000,
        received_us: 19_900_250,
    })
}

fn substitutes() -> ToHost<'static> {
    ToHost::Substitutes(Substitutes { interpolated: 0b1_0000_0010, zero: 1 << 60 })
}

/// Key block of eight samples of two channels, to keep the dump short;
/// `kernels/lossless/tests/reference.py` has computed its bytes.
fn compressed_key() -> ToHost<'static> {
    ToHost::CompressedRaw(CompressedRaw {
        first_sample: 9_656,
        channels: 2,
        flags: Flags::empty(),
        form: BlockForm::Key,
        samples: 8,
        bytes: &[
            0x84, 0xdd, 0x00, 0x00, 0x64, 0x82, 0x2d, 0x2d, 0x7f, 0xfb, 0x9b, 0x10, 0x81, 0x1d,
            0x9c, 0x8b, 0x40,
        ],
    })
}

/// Block of the eight samples after [`compressed_key`], with a jump in the second channel.
fn compressed_continuing() -> ToHost<'static> {
    ToHost::CompressedRaw(CompressedRaw {
        first_sample: 9_664,
        channels: 2,
        flags: Flags::empty(),
        form: BlockForm::Continuing,
        samples: 8,
        bytes: &[
            0x48, 0xe9, 0xd2, 0x6a, 0x4c, 0x85, 0x00, 0xff, 0xe8, 0x90, 0x00, 0xff, 0xe8, 0x9a,
            0xab, 0x48,
        ],
    })
}

/// Policy of a host that always excludes electrode 3 and never excludes electrode 60.
pub(crate) const POLICY: ExclusionPolicy =
    ExclusionPolicy { always: 1 << 3, never: 1 << 60, automatic: true };

fn exclusion() -> ToHost<'static> {
    ToHost::Exclusion(Exclusion { first_step: 2_496, excluded: 1 << 3 | 1 << 20, policy: POLICY })
}

pub(crate) fn packed_code() -> ToHost<'static> {
    ToHost::PackedCode(PackedCode {
        block: 301,
        rate: 4,
        flags: Flags::SATURATED | Flags::CLIPPED | Flags::MISFIT,
        clipped: 3,
        saturated: 1 << 20,
        bytes: &[
            0x5b, 0x12, 0x00, 0xc4, 0x9e, 0x3f, 0xa1, 0x00, 0x77, 0xe8, 0x2d, 0x60, 0xb3, 0x4f,
            0x91, 0x08, 0xd6, 0x7a, 0x35, 0xec, 0x19, 0x82, 0x40,
        ],
    })
}

/// Returns each message with the name of its dump, and with seq and device time of its frame.
pub(crate) fn all() -> Vec<(&'static str, (u32, u64), ToHost<'static>)> {
    let ack = ToHost::Ack(Ack { of: 1, result: AckResult::Done });
    let code_at = (304, 19_871_093);
    let second = (316, 19_916_015);
    vec![
        ("hello", (0, 1_000_000), hello()),
        ("capabilities", (1, 1_000_100), capabilities()),
        ("ack", (3, 1_002_000), ack),
        ("code", code_at, code()),
        ("code-int8-exponent", code_at, code_with_exponent()),
        ("code-int16", code_at, code_of_16_bits()),
        ("stats", (305, 19_900_000), stats()),
        ("quality", (306, 19_900_100), quality()),
        ("timing", (307, 19_900_200), timing()),
        ("raw", (308, 19_900_390), raw()),
        ("filtered", (309, 19_906_250), filtered()),
        ("audit", (310, 19_871_093), audit()),
        ("event", (311, 19_907_777), event()),
        ("converters", (312, 19_910_000), converters()),
        ("self-test", (313, 24_500_000), self_test()),
        ("clock-reading", (314, 24_600_000), clock_reading()),
        ("substitutes", (1, 1_000), substitutes()),
        ("compressed-raw-key", (315, 19_900_390), compressed_key()),
        ("compressed-raw-continuing", second, compressed_continuing()),
        ("packed-code", (317, 19_929_687), packed_code()),
        ("exclusion", (318, 19_937_500), exclusion()),
        ("model-received", (4, 1_004_000), model_received()),
        ("features", (319, 19_937_500), features()),
        ("impedance", (320, 19_998_046), impedance()),
    ]
}

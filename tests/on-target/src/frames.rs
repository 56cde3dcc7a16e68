//! Frames: the dumps of `docs/wire-format.md`, made and read.

use link::{
    CODE_LEN, Code, CodeValues, Decoder, Encoder, Flags, MAX_FRAME, Message, Start, Streams,
    ToDevice, ToHost,
};

use crate::{Mismatch, golden, mismatch::same};

/// Number and device time of the dumped code, microseconds.
const CODE_AT: (u32, u64) = (304, 19_871_093);
/// Those of the dumped command.
const START_AT: (u32, u64) = (1, 0);

/// A code to the host.
pub(crate) fn check_code() -> Result<(), Mismatch> {
    check(&mut Decoder::new(), &golden::CODE_FRAME, CODE_AT, &code())
}

/// A command to the device.
pub(crate) fn check_command() -> Result<(), Mismatch> {
    let start = ToDevice::Start(Start {
        streams: Streams::CODES,
        mains_hz: 50,
    });
    check(&mut Decoder::new(), &golden::START_FRAME, START_AT, &start)
}

/// The document's code.
fn code() -> ToHost<'static> {
    let value = |index: usize| i8::try_from(index).unwrap_or(0) - 64;
    ToHost::Code(Code {
        model_id: [0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88],
        window: 300,
        first_sample: 9600,
        flags: Flags::SATURATED | Flags::SETTLING | Flags::CLIPPED | Flags::CODE_CLIPPED,
        clipped: 2,
        clipped_values: 1,
        saturated: 1 << 20,
        values: CodeValues::Int8(core::array::from_fn::<_, CODE_LEN, _>(value)),
    })
}

/// The message makes the dump's bytes; these, behind rubbish, are read, and make themselves again.
fn check<'d, M: Message<'d>>(
    decoder: &'d mut Decoder,
    dump: &[u8],
    (seq, time_us): (u32, u64),
    message: &M,
) -> Result<(), Mismatch> {
    let mut buffer = [0; MAX_FRAME];
    let made = Encoder::starting_at(seq).encode(time_us, message, &mut buffer);
    same("byte made", dump, made.unwrap_or_default())?;
    let rubbish = [3, 1, 4, 1, 5, 9, 2, 6, 0];
    let refused = decoder.next::<ToDevice>(&mut &rubbish[..]);
    let is_refused = refused.is_some_and(|frame| frame.is_err());
    same("rubbish refused", &[1], &[i32::from(is_refused)])?;
    let mut again: &[u8] = &[];
    if let Some(Ok(frame)) = decoder.next::<M>(&mut &dump[..]) {
        let made = link::encode(&frame.header, &frame.message, &mut buffer);
        again = made.unwrap_or_default();
    }
    same("byte read", dump, again)
}

/// The dumped code with each of its bits turned over, one at a time: none passes for sound.
pub(crate) fn check_damaged() -> Result<(), Mismatch> {
    let mut decoder = Decoder::<MAX_FRAME>::new();
    let mut dump = golden::CODE_FRAME;
    // Between the two zeros.
    for bit in 8..8 * (dump.len() - 1) {
        let mask = 1 << (bit % 8);
        dump[bit / 8] ^= mask;
        let mut input: &[u8] = &dump;
        while decoder.next::<ToHost<'_>>(&mut input).is_some() {}
        dump[bit / 8] ^= mask;
    }
    let counters = decoder.counters();
    same("damaged frames taken", &[0], &[counters.frames])?;
    // Every stretch of them ended at a zero, so that the next frame is whole.
    let mut input: &[u8] = &dump;
    let sound = decoder.next::<ToHost<'_>>(&mut input);
    let is_sound = sound.is_some_and(|frame| frame.is_ok());
    same("frame behind them read", &[1], &[i32::from(is_sound)])
}

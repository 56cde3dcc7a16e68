//! Encodes and decodes the frames that `docs/wire-format.md` shows as hex dumps.

use link::{
    Code, CodeValues, Decoder, Encoder, Flags, MAX_FRAME, Message, Start, Streams, ToDevice, ToHost,
};

use crate::{
    golden,
    mismatch::{Mismatch, expect_equal},
};

/// Sequence number and device time (us) of the frame with a code in `docs/wire-format.md`.
const CODE_AT: (u32, u64) = (304, 19_871_093);
/// Sequence number and device time (us) of the frame with a command in `docs/wire-format.md`.
const START_AT: (u32, u64) = (1, 0);

/// Checks the encoding and decoding of a frame with a code, which the device sends.
pub(crate) fn check_code() -> Result<(), Mismatch> {
    check(&mut Decoder::new(), &golden::CODE_FRAME, CODE_AT, &code())
}

/// Checks the encoding and decoding of a frame with a command, which the device receives.
pub(crate) fn check_command() -> Result<(), Mismatch> {
    let start = ToDevice::Start(Start { streams: Streams::CODES, mains_hz: 50 });
    check(&mut Decoder::new(), &golden::START_FRAME, START_AT, &start)
}

/// Returns the code whose frame `docs/wire-format.md` shows as a hex dump.
fn code() -> ToHost<'static> {
    /// The values of the code, -64 to 63, as bytes.
    const RAMP: [u8; 128] = {
        let mut ramp = [0; 128];
        let mut index = 0;
        while index < ramp.len() {
            #[expect(clippy::cast_possible_truncation, reason = "below 128")]
            let byte = (index as u8).wrapping_sub(64);
            ramp[index] = byte;
            index += 1;
        }
        ramp
    };
    ToHost::Code(Code {
        model_id: [0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88],
        window: 300,
        first_sample: 9600,
        flags: Flags::SATURATED | Flags::SETTLING | Flags::CLIPPED | Flags::CODE_CLIPPED,
        clipped: 2,
        clipped_values: 1,
        saturated: 1 << 20,
        values: CodeValues::int8(&RAMP),
    })
}

/// Checks that `message` encodes to `dump`, and that the decoder refuses garbage and then decodes
/// `dump` to a message that encodes to `dump` again.
fn check<'d, M: Message<'d>>(
    decoder: &'d mut Decoder,
    dump: &[u8],
    (seq, time_us): (u32, u64),
    message: &M,
) -> Result<(), Mismatch> {
    let mut buffer = [0; MAX_FRAME];
    let made = Encoder::starting_at(seq).encode(time_us, message, &mut buffer);
    expect_equal("encoded byte", dump, made.unwrap_or_default())?;
    let garbage = [3, 1, 4, 1, 5, 9, 2, 6, 0];
    let refused = decoder.next::<ToDevice>(&mut &garbage[..]);
    let is_refused = refused.is_some_and(|frame| frame.is_err());
    expect_equal("garbage refused", &[1], &[i32::from(is_refused)])?;
    let mut again: &[u8] = &[];
    if let Some(Ok(frame)) = decoder.next::<M>(&mut &dump[..]) {
        let made = link::encode(&frame.header, &frame.message, &mut buffer);
        again = made.unwrap_or_default();
    }
    expect_equal("decoded byte", dump, again)
}

/// Inverts each bit of the dumped frame, one at a time. Checks that every damaged frame is refused,
/// and that an undamaged frame is accepted after all of them.
pub(crate) fn check_damaged() -> Result<(), Mismatch> {
    let mut decoder = Decoder::<MAX_FRAME>::new();
    let mut dump = golden::CODE_FRAME;
    // Invert only bits between the two zero bytes that delimit the frame.
    for bit in 8..8 * (dump.len() - 1) {
        let mask = 1 << (bit % 8);
        dump[bit / 8] ^= mask;
        let mut input: &[u8] = &dump;
        while decoder.next::<ToHost<'_>>(&mut input).is_some() {}
        dump[bit / 8] ^= mask;
    }
    let counters = decoder.counters();
    expect_equal("damaged frames accepted", &[0], &[counters.frames])?;
    // The last damaged frame ended with a zero byte, so the decoder starts a new frame here.
    let mut input: &[u8] = &dump;
    let sound = decoder.next::<ToHost<'_>>(&mut input);
    let is_sound = sound.is_some_and(|frame| frame.is_ok());
    expect_equal("frame after them read", &[1], &[i32::from(is_sound)])
}

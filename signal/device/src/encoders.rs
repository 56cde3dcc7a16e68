//! Encoders of a device: the network, the packed code, or both.

use core::hint::black_box;

use link::Streams;
use model::{
    HAS_NETWORK, NETWORK, NETWORK_CHECKSUM, Network, PACKED, PACKED_CHECKSUM, Packed, SUBSTITUTION,
    SUBSTITUTION_CHECKSUM,
};
use pipeline::{Code, EncoderMemory, PackedCode, PackedMemory, Rate, Step};

/// The encoders that a device has. A firmware image contains the weights of these encoders only.
///
/// An implementing type holds the state and scratch memory of the encoders. A board keeps it in a
/// `static`, which takes no flash because it is initially all zeros.
pub trait Encoders {
    /// Streams that these encoders feed.
    const STREAMS: Streams;

    /// Resets the encoders in place: the next step is the first of a run.
    fn restart(&mut self);

    /// Encodes a step with the network; returns a code if the step completes a window. The network
    /// is `uploaded`, or the built-in network if that is `None`.
    fn encode_window(&mut self, step: &Step, uploaded: Option<&Network<'_>>) -> Option<Code>;

    /// Encodes a step with the packed code; returns a block at `rate` if the step completes a hop.
    /// The model is `uploaded`, or the built-in model if that is `None`.
    fn encode_block(
        &mut self,
        step: &Step,
        rate: Rate,
        uploaded: Option<&Packed<'_>>,
    ) -> Option<PackedCode>;

    /// Returns whether the weights in flash match their checksums. Reading all weights takes some
    /// milliseconds.
    fn model_is_sound() -> bool;
}

/// Returns the streams of a device with the encoders `E`: the streams that `E` feeds, and every
/// stream that needs no encoder.
pub const fn streams_with<E: Encoders>() -> Streams {
    let need_an_encoder = Streams::CODES.bits() | Streams::AUDIT.bits() | Streams::PACKED.bits();
    let need_none = Streams::ALL.without(Streams::from_bits(need_an_encoder));
    Streams::from_bits(need_none.bits() | E::STREAMS.bits())
}

/// Encoder of a device that has only the network.
impl Encoders for EncoderMemory {
    const STREAMS: Streams = if HAS_NETWORK {
        Streams::from_bits(Streams::CODES.bits() | Streams::AUDIT.bits())
    } else {
        Streams::empty()
    };

    fn restart(&mut self) {
        Self::restart(self);
    }

    fn encode_window(&mut self, step: &Step, uploaded: Option<&Network<'_>>) -> Option<Code> {
        match uploaded {
            Some(network) => self.encode_step_with(step, network),
            None => self.encode_step(step),
        }
    }

    fn encode_block(&mut self, _: &Step, _: Rate, _: Option<&Packed<'_>>) -> Option<PackedCode> {
        None
    }

    fn model_is_sound() -> bool {
        // Without `black_box`, the compiler would evaluate the comparison at build time.
        black_box(&NETWORK).checksum() == NETWORK_CHECKSUM && table_is_sound()
    }
}

/// Returns whether the table of substitutions, if there is one, matches its checksum.
fn table_is_sound() -> bool {
    let table = black_box(&SUBSTITUTION).as_ref();
    table.map(model::Substitution::checksum) == SUBSTITUTION_CHECKSUM
}

/// Encoder of a device that has only the packed code; the device's audits contain no code.
impl Encoders for PackedMemory {
    const STREAMS: Streams = match PACKED {
        Some(_) => Streams::from_bits(Streams::PACKED.bits() | Streams::AUDIT.bits()),
        None => Streams::empty(),
    };

    fn restart(&mut self) {
        Self::restart(self);
    }

    fn encode_window(&mut self, _: &Step, _: Option<&Network<'_>>) -> Option<Code> {
        None
    }

    fn encode_block(
        &mut self,
        step: &Step,
        rate: Rate,
        uploaded: Option<&Packed<'_>>,
    ) -> Option<PackedCode> {
        match uploaded {
            Some(packed) => self.encode_step_with(step, rate, packed),
            None => self.encode_step(step, rate),
        }
    }

    fn model_is_sound() -> bool {
        let packed = black_box(&PACKED).as_ref();
        packed.map(model::Packed::checksum) == PACKED_CHECKSUM && table_is_sound()
    }
}

/// Encoders of a device that has both the network and the packed code.
#[derive(Clone, Debug)]
pub struct BothEncoders {
    network: EncoderMemory,
    packed: PackedMemory,
}

impl BothEncoders {
    /// Memory before the first step, all zeros.
    pub const EMPTY: Self = Self { network: EncoderMemory::EMPTY, packed: PackedMemory::EMPTY };
}

impl Encoders for BothEncoders {
    const STREAMS: Streams =
        Streams::from_bits(EncoderMemory::STREAMS.bits() | PackedMemory::STREAMS.bits());

    fn restart(&mut self) {
        self.network.restart();
        self.packed.restart();
    }

    fn encode_window(&mut self, step: &Step, uploaded: Option<&Network<'_>>) -> Option<Code> {
        self.network.encode_window(step, uploaded)
    }

    fn encode_block(
        &mut self,
        step: &Step,
        rate: Rate,
        uploaded: Option<&Packed<'_>>,
    ) -> Option<PackedCode> {
        self.packed.encode_block(step, rate, uploaded)
    }

    fn model_is_sound() -> bool {
        EncoderMemory::model_is_sound() && PackedMemory::model_is_sound()
    }
}

impl<E: Encoders> Encoders for &mut E {
    const STREAMS: Streams = E::STREAMS;

    fn restart(&mut self) {
        (**self).restart();
    }

    fn encode_window(&mut self, step: &Step, uploaded: Option<&Network<'_>>) -> Option<Code> {
        (**self).encode_window(step, uploaded)
    }

    fn encode_block(
        &mut self,
        step: &Step,
        rate: Rate,
        uploaded: Option<&Packed<'_>>,
    ) -> Option<PackedCode> {
        (**self).encode_block(step, rate, uploaded)
    }

    fn model_is_sound() -> bool {
        E::model_is_sound()
    }
}

//! Memory for a model that the host uploads, and the trait through which tasks access it.

use int8_nn::Linear;
use int8_nn::Pair;
use link::{AckResult, MAX_CHUNK_BYTES, ModelBegin, ModelChunk, ModelReceived, Streams, model_crc};
use model::{
    CODE, CODE_FORMAT, CODE_SCALE, CODE_ZERO_POINT, CodeFormat, ELECTRODE_PAIRS, ELECTRODES,
    HAS_SHORTCUT, HOP, INPUT_MULTIPLIER, NETWORK, NETWORK_ID, Network, PACKED, PACKED_COEFFICIENTS,
    PACKED_INPUT_PAIRS, Packed, SHORTCUT_PAIRS, SHORTCUT_STEPS, STEPS, Slice,
};
use packed::{Costs, Starts, Tables};
use zerocopy::little_endian::I64;
use zerocopy::{FromBytes, FromZeros, Immutable, IntoBytes, KnownLayout};

/// Version of the layout of an uploaded model.
const LAYOUT: u32 = 2;
/// Numbers of pairs in the packed weights of the analysis and of the prediction.
const ANALYSIS_PAIRS: usize = PACKED_INPUT_PAIRS * PACKED_COEFFICIENTS / 2;
const PREDICTION_PAIRS: usize = PACKED_COEFFICIENTS * PACKED_COEFFICIENTS / 4;
/// Numbers of electrodes, steps of a block, pairs of input values and coefficients in the built-in
/// packed model; an upload must have the same numbers.
#[expect(
    clippy::cast_possible_truncation,
    reason = "at most 64 electrodes, 64 steps, 256 coefficients"
)]
const SHAPE: [u16; 4] =
    [ELECTRODES as u16, HOP as u16, PACKED_INPUT_PAIRS as u16, PACKED_COEFFICIENTS as u16];
/// Largest permitted magnitude of `misfit_energy`; with it, no sum that includes `misfit_energy`
/// overflows.
const MAX_MISFIT: i64 = 1 << 48;
/// Numbers of steps of a window, pairs of electrodes and values of a code in the built-in model,
/// and the format of its codes; a linear code must have the same numbers and the same format.
#[expect(clippy::cast_possible_truncation, reason = "at most 32 steps, 32 pairs, 256 numbers")]
const LINEAR_SHAPE: [u16; 4] = [
    STEPS as u16,
    ELECTRODE_PAIRS as u16,
    CODE as u16,
    match CODE_FORMAT {
        CodeFormat::Int8 => 0,
        CodeFormat::Int8Exponent => 1,
        CodeFormat::Int16 => 2,
    },
];

/// An uploaded model in the byte layout of `docs/wire-format.md`, as `model_gen` writes it. A
/// linear code takes the place of the network's shortcut, so a firmware whose network has no
/// shortcut has no memory for a linear code.
#[derive(Clone, Debug, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
struct Content {
    packed: PackedContent,
    linear: [LinearContent; HAS_SHORTCUT as usize],
}

/// The packed model of an upload.
#[derive(Clone, Debug, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
struct PackedContent {
    layout: u32,
    shape: [u16; 4],
    network: [u8; 8],
    input_multiplier: i32,
    misfit_energy: I64,
    input_limit: i32,
    /// 1 if a linear code follows, otherwise 0.
    has_linear: u32,
    analysis: [Pair; ANALYSIS_PAIRS],
    prediction: [Pair; PREDICTION_PAIRS],
    analysis_factors: [i32; PACKED_COEFFICIENTS],
    prediction_factors: [i32; PACKED_COEFFICIENTS],
    starts: Starts,
    costs: Costs,
    predicted_levels: [u8; PACKED_COEFFICIENTS],
    reset_levels: [u8; PACKED_COEFFICIENTS],
}

/// The linear code of an upload, which replaces the whole network.
#[derive(Clone, Debug, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
struct LinearContent {
    shape: [u16; 4],
    input_multiplier: i32,
    scales: CodeScales,
    multipliers: [i32; CODE],
    weights: [[Pair; SHORTCUT_PAIRS]; SHORTCUT_STEPS],
}

/// Scale and zero point of each value of a code, with which a host dequantises the code.
#[derive(Clone, Copy, Debug, PartialEq, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub(crate) struct CodeScales {
    pub(crate) scale: [f32; CODE],
    pub(crate) zero_point: [i8; CODE],
}

impl CodeScales {
    /// Scales of the codes that the built-in network computes.
    pub(crate) const BUILT_IN: &Self = &Self { scale: CODE_SCALE, zero_point: CODE_ZERO_POINT };
}

const _: () = assert!(
    cfg!(target_endian = "little"),
    "an uploaded model is used as the host has sent it: least significant bytes first"
);

/// Memory for one uploaded model: a packed model, alone or with a linear code. A board can create
/// the slot in place: all bytes of an empty slot are 0 (`FromZeros`).
///
/// Chunks must arrive in order. A chunk after a missing one is refused, and a repeated chunk
/// changes nothing. A model is used only if its length and CRC are right and its contents are in
/// range. Its weights cannot make the encoder panic, because sums wrap.
#[derive(Clone, Debug, FromZeros)]
pub struct ModelSlot {
    content: Content,
    /// Id, length and CRC of the announced model; zeros if none is announced.
    id: [u8; 8],
    bytes: u32,
    crc: u32,
    /// Number of bytes at the start of the model that have arrived.
    received: u32,
    /// Whether the model has been checked and is in use.
    is_complete: bool,
}

/// Outcome of a command about an uploaded model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct UploadOutcome {
    pub(crate) result: AckResult,
    /// How much of the announced model the slot holds.
    pub(crate) received: ModelReceived,
    /// The model in the slot, if it can be used.
    pub(crate) model: Option<UploadedModel>,
}

/// An uploaded model that a device can use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct UploadedModel {
    pub(crate) id: [u8; 8],
    /// Scales of the codes that the device computes while it uses this model. `None` if the model
    /// has no linear code and names another network than the device's: a host with this model could
    /// not decode the codes of the device's network.
    pub(crate) code_scales: Option<CodeScales>,
}

/// Weights, factors and tables of an uploaded model, for the encoders.
#[derive(Clone, Copy, Debug)]
pub struct UploadedWeights<'m> {
    /// Matrices, factors, levels and tables of the packed model.
    pub packed: Packed<'m>,
    /// The network that computes the codes; `None` for the built-in network. In an uploaded network
    /// only the shortcut contributes.
    pub network: Option<Network<'m>>,
}

impl ModelSlot {
    /// Creates an empty slot, all of whose bytes are 0.
    pub fn empty() -> Self {
        Self::new_zeroed()
    }

    /// Returns the announcement of the model that the slot holds or is receiving.
    const fn announced(&self) -> ModelBegin {
        ModelBegin { id: self.id, bytes: self.bytes, crc: self.crc }
    }

    fn announce(&mut self, ModelBegin { id, bytes, crc }: ModelBegin) {
        (self.id, self.bytes, self.crc) = (id, bytes, crc);
        self.received = 0;
        self.is_complete = false;
    }

    /// Announces a model. If the slot holds this model, or has begun to receive it, the received
    /// bytes are kept; otherwise the slot is emptied. `abilities` are the streams that the device
    /// has; a model is refused if it would change none of them.
    pub(crate) fn begin(&mut self, begin: ModelBegin, abilities: Streams) -> UploadOutcome {
        const PACKED_ALONE: usize = size_of::<PackedContent>();
        let bytes = usize::try_from(begin.bytes).unwrap_or(usize::MAX);
        let takes = if bytes > PACKED_ALONE {
            HAS_SHORTCUT && abilities.contains(Streams::CODES)
        } else {
            abilities.contains(Streams::PACKED)
        };
        if PACKED.is_none() || !takes {
            return self.outcome(AckResult::NotSupported);
        }
        if bytes != PACKED_ALONE && bytes != size_of::<Content>() {
            return self.outcome(AckResult::BadArgument);
        }
        if begin != self.announced() {
            self.announce(begin);
        }
        self.outcome(AckResult::Done)
    }

    /// Stores a chunk, which must begin at or before the end of the received bytes.
    pub(crate) fn store(&mut self, chunk: ModelChunk<'_>) -> UploadOutcome {
        let ModelChunk { offset, bytes } = chunk;
        let first = usize::try_from(offset).unwrap_or(usize::MAX);
        let place = first.checked_add(bytes.len()).and_then(|end| {
            let is_next = offset <= self.received && end <= self.bytes as usize;
            let end = u32::try_from(end).ok().filter(|_| is_next)?;
            Some((self.content.as_mut_bytes().get_mut(first..)?, end))
        });
        let Some((place, end)) = place.filter(|_| bytes.len() <= MAX_CHUNK_BYTES) else {
            return self.outcome(AckResult::BadArgument);
        };
        // A repeated chunk is not stored: its bytes may differ, and must not change a model in use.
        if end > self.received {
            for (place, byte) in place.iter_mut().zip(bytes) {
                *place = *byte;
            }
            self.received = end;
        }
        self.outcome(AckResult::Done)
    }

    /// Uses the announced model if it is complete and sound. A model that is complete but not sound
    /// is forgotten.
    pub(crate) fn end(&mut self) -> UploadOutcome {
        if self.bytes == 0 || self.received < self.bytes {
            return self.outcome(AckResult::BadArgument);
        }
        self.is_complete = self.content.is_sound(self.bytes, self.crc);
        if !self.is_complete {
            self.announce(ModelBegin::default());
            return self.outcome(AckResult::Failed);
        }
        self.outcome(AckResult::Done)
    }

    fn outcome(&self, result: AckResult) -> UploadOutcome {
        let built_in =
            || (self.content.packed.network == NETWORK_ID).then_some(*CodeScales::BUILT_IN);
        let linear = self.content.linear().map(|linear| linear.scales);
        let model = UploadedModel { id: self.id, code_scales: linear.or_else(built_in) };
        UploadOutcome {
            result,
            received: ModelReceived { crc: self.crc, bytes: self.received },
            model: self.is_complete.then_some(model),
        }
    }

    /// Returns the uploaded model; `None` if the slot has none that is complete and sound.
    pub fn weights(&self) -> Option<UploadedWeights<'_>> {
        let content = &self.content.packed;
        let packed = PACKED.as_ref().filter(|_| self.is_complete)?;
        // The shapes equal those of the built-in model, so every slice fits. A slice that did not
        // fit would get no weights and be skipped.
        let weights = |first: usize, inputs: usize| {
            let range = first * PACKED_COEFFICIENTS / 2..(first + inputs) * PACKED_COEFFICIENTS / 2;
            content.analysis.get(range).unwrap_or_default()
        };
        let slice = |slice: Slice<'static>| Slice {
            first: slice.first,
            matrix: Linear { weights: weights(slice.first, slice.matrix.inputs), ..slice.matrix },
        };
        let packed = Packed {
            analysis: packed.analysis.map(slice),
            analysis_factors: &content.analysis_factors,
            prediction: Linear { weights: &content.prediction, ..packed.prediction },
            prediction_factors: &content.prediction_factors,
            predicted_levels: &content.predicted_levels,
            reset_levels: &content.reset_levels,
            tables: Tables { starts: &content.starts, costs: &content.costs },
            input_multiplier: content.input_multiplier,
            input_limit: content.input_limit,
            misfit_energy: content.misfit_energy.get(),
            rate: packed.rate,
        };
        Some(UploadedWeights { packed, network: self.content.linear().map(LinearContent::network) })
    }
}

impl Content {
    /// Returns the linear code; `None` if the model has none.
    fn linear(&self) -> Option<&LinearContent> {
        self.linear.first().filter(|_| self.packed.has_linear != 0)
    }

    /// Returns whether the first `bytes` bytes have this CRC, and are a model with which the
    /// encoder does not overflow and the range coder never meets an empty range.
    fn is_sound(&self, bytes: u32, crc: u32) -> bool {
        let content = usize::try_from(bytes).ok().and_then(|bytes| self.as_bytes().get(..bytes));
        let has_linear = content.is_some_and(|content| content.len() > size_of::<PackedContent>());
        content.is_some_and(|content| model_crc(content) == crc)
            && self.packed.is_sound()
            && self.packed.has_linear == u32::from(has_linear)
            && self.linear().is_none_or(LinearContent::is_sound)
    }
}

impl PackedContent {
    fn is_sound(&self) -> bool {
        let tables = Tables { starts: &self.starts, costs: &self.costs };
        self.layout == LAYOUT
            && self.shape == SHAPE
            && (1..=i32::from(i16::MAX)).contains(&self.input_limit)
            && (-MAX_MISFIT..=MAX_MISFIT).contains(&self.misfit_energy.get())
            && tables.is_consistent()
    }
}

impl LinearContent {
    /// Returns whether the linear code fits the input and the code format of the built-in model.
    /// Weights and factors need no check, because none can make a sum overflow: a sum over 32 steps
    /// of 64 inputs is below 2^26.
    fn is_sound(&self) -> bool {
        let is_scale = |scale: &f32| scale.is_finite() && *scale > 0.0;
        self.shape == LINEAR_SHAPE
            && self.input_multiplier == INPUT_MULTIPLIER
            && self.scales.scale.iter().all(is_scale)
    }

    /// Returns the built-in network with the linear code's weights as its shortcut. The
    /// convolutions contribute nothing, because the fully connected layer's factors are 0.
    fn network(&self) -> Network<'_> {
        const ZEROS: &[i32; CODE] = &[0; CODE];
        Network {
            fc_bias: ZEROS,
            fc_multipliers: ZEROS,
            shortcut: self.weights.each_ref(),
            shortcut_multipliers: &self.multipliers,
            code_zero_point: &self.scales.zero_point,
            ..NETWORK
        }
    }
}

/// A device's access to its model slot, which it may have to share with other tasks.
pub trait Slot {
    /// Whether the device has a slot.
    const EXISTS: bool = true;

    /// Calls `access` with the slot; returns `None` if there is none, or if another task uses it.
    fn with<T>(&mut self, access: impl FnOnce(&mut ModelSlot) -> T) -> Option<T>;
}

impl Slot for ModelSlot {
    fn with<T>(&mut self, access: impl FnOnce(&mut ModelSlot) -> T) -> Option<T> {
        Some(access(self))
    }
}

/// Slot of a device that has no memory for an uploaded model.
#[derive(Clone, Copy, Debug)]
pub struct NoSlot;

impl Slot for NoSlot {
    const EXISTS: bool = false;

    fn with<T>(&mut self, _: impl FnOnce(&mut ModelSlot) -> T) -> Option<T> {
        None
    }
}

#[cfg(test)]
pub(crate) mod tests;

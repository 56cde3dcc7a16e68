//! Wire messages, built from the types of pipeline and model.

use link::{
    Capabilities, Code as CodeMessage, CodeFormat, CodeValues, ElectrodeQuality,
    Features as FeaturesMessage, Flags, MAX_ELECTRODES, MAX_LABELS_BYTES, MAX_RATE, MAX_TEXT_BYTES,
    PackedCode as PackedMessage, Quality as QualityMessage,
};
use pipeline::{Code, Features, Mains, PackedCode, Quality, Rate};

use crate::acquired_sample::Marks;
use crate::chunk::narrow;
use crate::converters::LSB_NV;
use crate::model_slot::CodeScales;

const _: () = {
    assert!(model::ELECTRODES <= MAX_ELECTRODES);
    assert!(model::LABELS.len() <= MAX_LABELS_BYTES);
    assert!(model::MAINS_50.description.len() <= MAX_TEXT_BYTES);
    assert!(model::MAINS_60.description.len() <= MAX_TEXT_BYTES);
    assert!(Rate::new(MAX_RATE).is_some() && Rate::new(MAX_RATE + 1).is_none());
};

/// Wire format of the codes, from the model that this program was built with.
pub const CODE_FORMAT: CodeFormat = match model::CODE_FORMAT {
    model::CodeFormat::Int8 => CodeFormat::Int8,
    model::CodeFormat::Int8Exponent => CodeFormat::Int8Exponent,
    model::CodeFormat::Int16 => CodeFormat::Int16,
};

pub(crate) fn capabilities(mains: Mains, scales: &CodeScales) -> Capabilities<'static> {
    let filter = mains.filter();
    Capabilities {
        adc_rate_hz: model::ADC_RATE_HZ,
        step_rate_hz: model::STEP_RATE_HZ,
        window_steps: const { narrow(model::STEPS) },
        hop_steps: const { narrow(model::HOP) },
        channels: const { narrow(model::CHANNELS) },
        lsb_nv: LSB_NV,
        mains_hz: filter.mains_hz,
        group_delay_us: filter.group_delay_us,
        labels: model::LABELS,
        filters: filter.description,
        code_format: CODE_FORMAT,
        code_scale: scales.scale.into(),
        code_zero_point: scales.zero_point.into(),
    }
}

/// Buffer for the values of a code as bytes; a wire message borrows it.
pub(crate) type ValueBytes = [u8; pipeline::CodeValues::MAX_BYTES];

pub(crate) fn code<'b>(
    model_id: [u8; 8],
    code: &Code,
    marks: Marks,
    bytes: &'b mut ValueBytes,
) -> CodeMessage<'b> {
    let flags = with_flags(
        marks,
        [
            (code.saturated != 0, Flags::SATURATED),
            (code.settling, Flags::SETTLING),
            (code.clipped > 0, Flags::CLIPPED),
            (code.clipped_values > 0, Flags::CODE_CLIPPED),
        ],
    );
    CodeMessage {
        model_id,
        window: code.window,
        first_sample: code.first_sample,
        flags,
        clipped: code.clipped,
        clipped_values: code.clipped_values,
        saturated: code.saturated,
        values: values(&code.values, bytes),
    }
}

pub(crate) fn packed_code(code: &PackedCode, marks: Marks) -> PackedMessage<'_> {
    let flags = with_flags(
        marks,
        [
            (code.saturated != 0, Flags::SATURATED),
            (code.settling, Flags::SETTLING),
            (code.clipped > 0, Flags::CLIPPED),
            (code.is_misfit, Flags::MISFIT),
            (code.is_blank, Flags::BLANK),
        ],
    );
    PackedMessage {
        block: code.block,
        rate: code.rate,
        flags,
        clipped: code.clipped,
        saturated: code.saturated,
        bytes: code.bytes(),
    }
}

const _: () = assert!(pipeline::MAX_FEATURES == link::MAX_FEATURES);

pub(crate) fn features(features: &Features, marks: Marks) -> FeaturesMessage<'_> {
    let flags = with_flags(
        marks,
        [(features.saturated != 0, Flags::SATURATED), (features.settling, Flags::SETTLING)],
    );
    FeaturesMessage {
        id: features.id,
        hop: features.hop,
        flags,
        saturated: features.saturated,
        levels: features.levels(),
    }
}

/// Returns the flags of `marks`, and each flag of `conditions` whose condition is true.
fn with_flags<const N: usize>(marks: Marks, conditions: [(bool, Flags); N]) -> Flags {
    conditions
        .into_iter()
        .filter(|(is_set, _)| *is_set)
        .fold(marks.flags(), |flags, (_, flag)| flags | flag)
}

/// The code values that a device without a network sends: an empty code in the model's format.
pub(crate) const NO_VALUES: CodeValues<'static> = match CODE_FORMAT {
    CodeFormat::Int8Exponent => CodeValues::int8_exponent(0, &[]),
    CodeFormat::Int16 => CodeValues::int16(&[]),
    _ => CodeValues::int8(&[]),
};

pub(crate) fn values<'b>(
    values: &pipeline::CodeValues,
    bytes: &'b mut ValueBytes,
) -> CodeValues<'b> {
    let bytes = values.value_bytes(bytes);
    match *values {
        pipeline::CodeValues::Int8(_) => CodeValues::int8(bytes),
        pipeline::CodeValues::Int8Exponent { exponent, .. } => {
            CodeValues::int8_exponent(exponent, bytes)
        }
        pipeline::CodeValues::Int16(_) => CodeValues::int16(bytes),
    }
}

pub(crate) fn quality(quality: &Quality) -> QualityMessage {
    let electrodes = quality.electrodes.iter();
    QualityMessage {
        first_sample: quality.first_sample,
        settling: quality.settling,
        electrodes: electrodes
            .map(|electrode| ElectrodeQuality {
                rms_uv: electrode.rms_uv,
                mains_uv: electrode.mains_uv,
                mains_residual_uv: electrode.mains_residual_uv,
                samples_at_rail: electrode.samples_at_rail,
                flat: electrode.flat,
            })
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use std::boxed::Box;

    use model::HOP;
    use pipeline::{MAX_PACKED_BYTES, PackedEncoder, Step};

    use super::*;

    #[test]
    fn the_message_carries_the_blocks_status_and_its_bytes() {
        let step = Step {
            electrodes: [i32::MAX; model::ELECTRODES],
            saturated: 1 << 9,
            settling: true,
            ..Step::SILENCE
        };
        let mut encoder = Box::new(PackedEncoder::new());
        let mut blocks = (0..HOP).filter_map(|_| encoder.encode_step(&step));
        let code = blocks.next().expect("a block");
        let message = packed_code(&code, Marks::NONE);
        let flags = [Flags::SATURATED, Flags::SETTLING, Flags::CLIPPED, Flags::MISFIT];
        assert!(flags.into_iter().all(|flag| message.flags.contains(flag)));
        assert!(!message.flags.contains(Flags::OVERRUN));
        assert_eq!((message.saturated, message.block), (1 << 9, 0));
        assert_eq!(usize::from(message.clipped), HOP * model::ELECTRODES, "every value");
        assert!(message.bytes == code.bytes() && message.bytes.len() <= MAX_PACKED_BYTES);
    }
}

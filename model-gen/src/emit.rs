//! Writes the generated source files of the crate `model`: documented constants and statics.

mod chain;
mod encoder;
mod packed;
mod source;
mod substitution;

use artifact::{
    AdcClock, AdcControl, AdcWiring, CONV1_CHANNELS, CONV2_CHANNELS, Description, Padding,
};

use crate::{
    device_model::DeviceModel,
    headroom::GUARD_BITS,
    pack::{self, ConvKernel},
    packed::PackedIntegers,
};
use source::{Source, float, separated};

/// Returns the generated files of the `model` crate: names and Rust sources.
///
/// The first file holds the constants and uses no type of `model`, so that the types of `model` can
/// use the constants.
pub fn rust_files(model: &DeviceModel) -> [(&'static str, String); 2] {
    let mut statics = Source::default();
    statics.array(
        "Cell of the scalp grid, `row * COLUMNS + column`, of each electrode.",
        "pub static GRID_CELL: [u8; ELECTRODES]",
        &model.integers.cells,
    );
    statics.resampler(&model.resampler);
    for filter in &model.filters {
        statics.mains_filter(filter);
    }
    statics.convolutions(model);
    statics.linear(model);
    statics.codes(model);
    statics.network(model);
    statics.packed(model);
    statics.substitution(model);
    [("constants.rs", constants(model)), ("statics.rs", statics.text)]
}

fn constants(model: &DeviceModel) -> String {
    let Description { adc, window, montage, grid, mode, network, .. } = &model.description;
    let (resampler, packed) = (&model.resampler, model.packed.as_ref());
    // Padding and pool mean nothing in a network without convolutions, so neutral values are
    // written.
    let (padding, pool) = if mode.has_convolutions() {
        (network.padding, network.pool)
    } else {
        (Padding::None, [1, 1, 1])
    };
    let (kernel, fields) = match ConvKernel::select(&model.integers) {
        ConvKernel::Winograd => ("Winograd", "tile_rows: pooled.rows, outputs: pooled.channels"),
        ConvKernel::Direct => ("Direct", "pool: [POOL[1], POOL[2]], pooled"),
    };
    format!(
        "\
/// Id of the model: first 8 bytes of the SHA-256 over the artifact.
pub const MODEL_ID: [u8; 8] = {id:?};

/// Id of the model's network: first 8 bytes of the SHA-256 over the artifact without packed model
/// and table of substitutions.
pub const NETWORK_ID: [u8; 8] = {network_id:?};

/// Sampling rate of the ADC, Hz.
pub const ADC_RATE_HZ: u16 = {rate_hz};

/// Channels of the ADC chain; a sample has one count for each.
pub const CHANNELS: usize = {channels};

/// Whether every chip's data output is at MISO, rather than in a daisy chain.
pub const IS_CASCADED: bool = {is_cascaded};

/// Whether the clock of the chips is the oscillator inside one of them, rather than an external
/// one.
pub const HAS_INTERNAL_CLOCK: bool = {has_internal_clock};

/// Whether the chips are reset and started by opcodes, rather than by pins.
pub const HAS_COMMANDS_ONLY: bool = {has_commands_only};

/// Gain of the amplifier before the ADC.
pub const GAIN: u32 = {gain};

/// Nanovolts of one ADC count: 2 * reference / gain / 2^24.
pub const LSB_NV: f32 = {lsb_nv};

/// Rate of the encoder's time steps, Hz.
pub const STEP_RATE_HZ: u16 = {step_rate_hz};

/// Time steps from the start of one window to the start of the next.
pub const HOP: usize = {hop};

/// Time from the middle of a window to its last step, microseconds.
pub const WINDOW_CENTRE_US: u32 = {window_centre_us};

/// Fraction bits of a filtered sample, below one ADC count.
pub const GUARD_BITS: u32 = {GUARD_BITS};

/// Factor, Q0.32, from a filtered sample (counts, Q27.5) to a level of the int8 input.
pub const INPUT_MULTIPLIER: i32 = {input_multiplier};

/// Microvolts of one level of the int8 input.
pub const INPUT_SCALE_UV: f32 = {input_scale_uv};

/// Number of sections of each filter cascade.
pub const SECTIONS: usize = {sections};

/// Phases of the resampler: number of outputs for every `RESAMPLER.down` input samples.
pub const PHASES: usize = {phases};

/// Taps of each phase: samples from which an output is computed.
pub const TAPS: usize = {taps};

/// Electrode labels, separated by blanks; the index is the ADC channel.
pub const LABELS: &str = {labels:?};

/// Electrodes of the montage; electrode `e` is wired to ADC channel `e`.
pub const ELECTRODES: usize = {electrodes};

/// Rows of the scalp grid, front to back.
pub const ROWS: usize = {rows};

/// Columns of the scalp grid, left to right.
pub const COLUMNS: usize = {columns};

/// Time steps of a window.
pub const STEPS: usize = {steps};

/// Numbers in a code; 0 in a model without a network.
pub const CODE: usize = {code};

/// Output channels of the first convolution.
pub const CONV1_CHANNELS: usize = {CONV1_CHANNELS};

/// Output channels of the second convolution.
pub const CONV2_CHANNELS: usize = {CONV2_CHANNELS};

/// Whether the network has convolutions.
pub const HAS_CONVOLUTIONS: bool = {has_convolutions};

/// Whether the network has a linear shortcut.
pub const HAS_SHORTCUT: bool = {has_shortcut};

/// Whether the convolutions pad rows and columns.
pub const PADS_SPACE: bool = {pads_space};

/// Whether the convolutions pad steps.
pub const PADS_TIME: bool = {pads_time};

/// Steps, rows and columns of the max-pool.
pub const POOL: [usize; 3] = {pool:?};

/// Number of matrices into which the fully connected layer's weights for one pooled plane are
/// split.
pub const FC_PIECES: usize = {fc_pieces};

/// Kernel of the second convolution, for pairs of input channels and columns of the input.
pub type ConvKernel<'w, const PAIRS: usize, const COLUMNS: usize> = int8_nn::{kernel}<'w, PAIRS, COLUMNS>;

/// Returns the kernel of the second convolution, whose planes have the shape `pooled` after the
/// max-pool.
pub(crate) const fn conv_kernel<const PAIRS: usize, const COLUMNS: usize>(
    pooled: PlaneShape,
    weights: &[Pair],
) -> ConvKernel<'_, PAIRS, COLUMNS> {{
    int8_nn::{kernel} {{ {fields}, weights }}
}}
/// Coefficients of a packed block; 0 if the model has no packed model.
pub const PACKED_COEFFICIENTS: usize = {packed_coefficients};

/// Pairs of input values of a packed block, zeros at its end included.
pub const PACKED_INPUT_PAIRS: usize = {packed_input_pairs};

",
        id = model.id.0,
        network_id = model.network_id.0,
        rate_hz = adc.rate_hz,
        channels = adc.channels,
        is_cascaded = adc.wiring == AdcWiring::Cascaded,
        has_internal_clock = adc.clock == AdcClock::Internal,
        has_commands_only = adc.control == AdcControl::Commands,
        gain = adc.gain,
        lsb_nv = float(model.lsb_nv()),
        step_rate_hz = window.rate_hz,
        hop = window.hop,
        window_centre_us = separated(model.window_centre_us()),
        input_multiplier = separated(model.input_multiplier),
        input_scale_uv = float(model.integers.input_scale_uv),
        sections = model.filters[0].sections.len(),
        phases = resampler.phases(),
        taps = resampler.taps_per_phase(),
        labels = montage.electrodes.join(" "),
        electrodes = montage.electrodes.len(),
        rows = grid.rows,
        columns = grid.columns,
        steps = window.steps,
        code = model.integers.code_scale.len(),
        has_convolutions = mode.has_convolutions(),
        has_shortcut = mode.has_shortcut(),
        pads_space = padding.pads_space(),
        pads_time = padding.pads_time(),
        fc_pieces = pack::fc_pieces(&model.integers),
        packed_coefficients = packed.map_or(0, |packed| packed.model.coefficients()),
        packed_input_pairs = packed.map_or(0, PackedIntegers::input_pairs),
    )
}

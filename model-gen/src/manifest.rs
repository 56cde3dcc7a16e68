//! Writes `signal/model/manifest.txt`, the summary of a model for human readers.

use std::fmt::Write as _;

use artifact::{CONV1_CHANNELS, CONV2_CHANNELS, Geometry, SubstitutionTable};

use int8_nn::Pair;

use crate::{
    device_model::{DeviceModel, MainsFilter},
    headroom::{GAIN_LIMIT, GUARD_BITS},
    integer_model::IntegerModel,
    memory::{self, Part},
    pack,
    packed::PackedIntegers,
};

/// Returns the manifest of a model: its id, shapes, scales, ranges and sizes in bytes.
pub fn manifest(model: &DeviceModel) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = describe(&mut out, model);
    out
}

fn describe(out: &mut String, model: &DeviceModel) -> std::fmt::Result {
    let (description, resampler) = (&model.description, &model.resampler);
    let (window, adc) = (&description.window, &description.adc);
    writeln!(
        out,
        "\
model id              {}
mode                  {}
window                {} steps at {} Hz, hop {}
adc                   {} channels at {} Hz, {:.6} nV per count
input                 {:.6} uV per level, int8, multiplier {} / 2^32
resampler             {phases} x {} taps, {phases}/{} of the ADC's rate, accumulator {:.4} of 2^63
window's middle       {} us before its last step",
        model.id,
        description.mode,
        window.steps,
        window.rate_hz,
        window.hop,
        adc.channels,
        adc.rate_hz,
        model.lsb_nv(),
        model.integers.input_scale_uv,
        model.input_multiplier,
        resampler.taps_per_phase(),
        resampler.down,
        resampler.largest_accumulator(),
        model.window_centre_us(),
        phases = resampler.phases(),
    )?;
    for filter in &model.filters {
        mains_filter(out, filter)?;
    }
    if description.mode.has_network() {
        network(out, model)?;
    }
    if let Some(packed) = &model.packed {
        packed_model(out, packed)?;
    }
    match &model.substitution {
        Some(table) => substitution(out, table),
        None => Ok(()),
    }
}

/// Writes the network's layers, the format of its codes, and its flash and RAM sizes.
fn network(out: &mut String, model: &DeviceModel) -> std::fmt::Result {
    let (description, integers) = (&model.description, &model.integers);
    writeln!(out, "\nlayers                weights      worst accumulator")?;
    layers(out, integers)?;
    let (smallest, largest) = integers
        .code_scale
        .iter()
        .fold((f32::INFINITY, 0.0_f32), |(low, high), &s| (low.min(s), high.max(s)));
    writeln!(
        out,
        "\ncode                  {} x {}, scales {smallest:.6} .. {largest:.6}",
        description.code.numbers, integers.code_format
    )?;
    memory(out, &memory::parts(integers, description.window.hop))
}

/// Writes the dimensions, the units and the flash size of the packed model.
fn packed_model(out: &mut String, packed: &PackedIntegers) -> std::fmt::Result {
    let description = &packed.model.description;
    let analysis = packed.analysis();
    let pairs: usize = analysis.iter().map(|(_, weights)| weights.len()).sum();
    writeln!(
        out,
        "
packed code           {} coefficients of {} values, rate {}
  input               {} uV per unit, up to +-{}, multiplier {} / 2^32
  matrices            {} B",
        description.coefficients,
        packed.model.analysis.inputs(),
        description.rate,
        description.unit_uv,
        description.input_limit,
        packed.input_multiplier,
        size_of::<Pair>() * (pairs + packed.prediction().len()),
    )
}

/// Writes the shape, the flash size and the range of innovations of the table of substitutions.
fn substitution(out: &mut String, table: &SubstitutionTable) -> std::fmt::Result {
    let electrodes = table.innovation.len();
    let rms_uv = |value: Option<&i32>| value.map_or(0.0, |&value| f64::from(value).sqrt() / 16.0);
    writeln!(
        out,
        "
substitution          {electrodes} electrodes, each from the others, {} B
  innovation          {:.2} .. {:.2} uV rms",
        size_of::<Pair>() * pack::substitution(table).len() + size_of_val(&*table.innovation),
        rms_uv(table.innovation.iter().min()),
        rms_uv(table.innovation.iter().max()),
    )
}

/// Writes the flash and RAM sizes of each part of the encoder, and their sums.
fn memory(out: &mut String, parts: &[Part]) -> std::fmt::Result {
    writeln!(out, "\nmemory                               flash        RAM")?;
    for part in parts {
        let Part { name, flash_bytes, ram_bytes } = part;
        writeln!(out, "  {name:<34}{flash_bytes:>7} B  {ram_bytes:>7} B")?;
    }
    let flash: usize = parts.iter().map(|part| part.flash_bytes).sum();
    let ram: usize = parts.iter().map(|part| part.ram_bytes).sum();
    writeln!(out, "  {:<34}{flash:>7} B  {ram:>7} B", "encoder")
}

fn mains_filter(out: &mut String, filter: &MainsFilter) -> std::fmt::Result {
    let integer_bits = 32 - GUARD_BITS;
    writeln!(
        out,
        "
filters for {} Hz mains
  chain               {}
  group delay         {} us at 10 Hz
  scalp delay         {} us, from the middle of a window to the code's time
  settling            {} samples to 1e-4
  worst-case gains (below {GAIN_LIMIT} for full scale in Q{integer_bits}.{GUARD_BITS})",
        filter.mains_hz,
        filter.description,
        filter.group_delay_us,
        filter.scalp_delay_us,
        filter.settling_samples,
    )?;
    for node in &filter.gains {
        writeln!(out, "    {:<24}{:>8.4}", node.node, node.gain)?;
    }
    Ok(())
}

/// Writes one line for each layer of the network, with the layer's shape.
fn layers(out: &mut String, integers: &IntegerModel) -> std::fmt::Result {
    let IntegerModel { conv1, conv2, .. } = integers;
    let dimensions = &integers.geometry.dimensions;
    let numbers = dimensions.numbers;
    if integers.mode.has_convolutions() {
        let Geometry { padding, pool, .. } = integers.geometry;
        layer(
            out,
            &format!("conv1   1x3x3x3 -> {CONV1_CHANNELS}"),
            &conv1.weights,
            &conv1.bias,
            128,
        )?;
        let hidden = integers.largest_hidden().into();
        layer(
            out,
            &format!("conv2  {CONV1_CHANNELS}x3x3x3 -> {CONV2_CHANNELS}"),
            &conv2.weights,
            &conv2.bias,
            hidden,
        )?;
        writeln!(out, "  padding {padding:?}, max-pool {pool:?}")?;
        let name = format!("fc       {:>6} -> {numbers}", integers.geometry.flat());
        layer(out, &name, &integers.fc.weights, &integers.fc.bias, 255)?;
    }
    if integers.mode.has_shortcut() {
        let weights = &integers.shortcut.weights;
        let window = dimensions.window_electrodes();
        let name = format!("shortcut {window:>6} -> {numbers}");
        layer(out, &name, weights, &vec![0; numbers], 128)?;
    }
    Ok(())
}

/// Writes a line with the size of a layer's weights and its largest possible accumulator value.
fn layer(
    out: &mut String,
    name: &str,
    weights: &[i8],
    bias: &[i32],
    largest_input: i64,
) -> std::fmt::Result {
    let worst = weights
        .chunks_exact(weights.len() / bias.len())
        .zip(bias)
        .map(|(weights, &bias)| {
            let sum: i64 = weights.iter().map(|&w| i64::from(w).abs()).sum();
            sum * largest_input + i64::from(bias).abs()
        })
        .max()
        .unwrap_or(0);
    writeln!(out, "  {name:<22}{:>7} B  {worst:>12}  of 2147483647", weights.len())
}

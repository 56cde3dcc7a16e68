//! Writes the golden vectors' expected outputs, and passes the board's memory map to the linker.
#![forbid(unsafe_code)]

use std::{
    env,
    error::Error,
    fmt::Write,
    fs,
    path::{Path, PathBuf},
};

use artifact::{Decimation, Golden};
use fixed_dsp::{Cascade, Resampler};
use model_gen::{FilterSpec, ResamplerTable};
use pipeline::{Acquisition, Encoder, FeatureExtractor, Mains, PackedEncoder, Rate};

#[path = "src/chain.rs"]
mod chain;
#[path = "src/kernels.rs"]
mod kernels;
#[path = "src/signal.rs"]
mod signal;

/// Environment variable that names the folder of a model other than the checked-in one, as in
/// `signal/model/build.rs`.
const ARTIFACT: &str = "CORTICODE_ARTIFACT";
/// File with filter outputs from scipy; `scipy_rates.py` in the same folder writes it.
const SCIPY: &str = "../../signal/pipeline/tests/it/front_end/scipy_rates.csv";
/// Document with frames as hex dumps; `signal/link/tests/it/wire_format.rs` checks that the frame
/// encoder produces these dumps.
const WIRE_FORMAT: &str = "../../docs/wire-format.md";
/// Largest number of golden windows whose codes the image compares.
const WINDOWS: usize = 6;
/// Number of codes that the image compares for each mains frequency.
const CODES: usize = 12;
/// Number of hops whose features the image compares.
const HOPS: usize = 24;
/// Number of packed blocks that the image compares: enough to contain two blocks without prediction
/// and all blocks between them.
const BLOCKS: u8 = 70;

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed=build.rs");
    let out = PathBuf::from(env::var_os("OUT_DIR").ok_or("cargo sets OUT_DIR")?);
    let mut golden = String::new();
    filters(&mut golden)?;
    let (count, digests) = (kernels::NETWORKS, kernels::digests());
    writeln!(golden, "pub(crate) const KERNELS: [u32; {count}] = {digests:?};")?;
    windows(&mut golden)?;
    codes(&mut golden, "CODES_50", Mains::Hz50)?;
    codes(&mut golden, "CODES_60", Mains::Hz60)?;
    features(&mut golden)?;
    if !has_feature("F446") {
        blocks(&mut golden)?;
    }
    frame(&mut golden, "CODE_FRAME", "code")?;
    frame(&mut golden, "START_FRAME", "start")?;
    fs::write(out.join("golden.rs"), golden)?;
    link(&out)
}

/// Writes the filters that model-gen designs for three test cases, each with the outputs from scipy
/// and from this PC.
fn filters(golden: &mut String) -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed={SCIPY}");
    let scipy = fs::read_to_string(SCIPY)?;
    let cases = [
        ("HZ_512_MAINS_50", "512,50,literal,"),
        ("HZ_512_MAINS_60", "512,60,literal,"),
        ("HZ_500_FIR", "500,60,fir,"),
    ];
    for (name, key) in cases {
        let mut lines = scipy.lines();
        let line = lines.find_map(|line| line.strip_prefix(key));
        let line = line.ok_or_else(|| format!("{SCIPY} has no line {key}"))?;
        let expected = line.split(',').map(str::parse::<f64>);
        let expected: Vec<f64> = expected.collect::<Result<_, _>>()?;
        let mut words = key.split(',');
        let mut number = || words.next().unwrap_or_default().parse::<u32>();
        let (rate_hz, mains_hz) = (number()?, number()?);
        // Use the same specification as `signal/pipeline/tests/it/front_end.rs`.
        let sections = model_gen::cascade(&FilterSpec {
            rate_hz: rate_hz.into(),
            mains_hz: mains_hz.into(),
            harmonics: 0,
            notch_q: 30.0,
            band_hz: [0.5, 60.0],
            order: 5,
        })?;
        let sections: [_; 6] = sections.try_into().map_err(|_| "not six sections")?;
        let decimation = match words.next() {
            Some("literal") => Decimation::Literal,
            _ => Decimation::Fir,
        };
        let table = ResamplerTable::new(decimation, rate_hz, 128, 61)?;
        let cascade = Cascade { sections };
        match (table.phases(), table.taps_per_phase()) {
            (1, 1) => filtered::<1, 1>(golden, name, &cascade, &table, &expected)?,
            (32, 64) => filtered::<32, 64>(golden, name, &cascade, &table, &expected)?,
            (phases, taps) => Err(format!("{key}: {phases} phases and {taps} taps"))?,
        }
    }
    Ok(())
}

fn filtered<const PHASES: usize, const TAPS: usize>(
    golden: &mut String,
    name: &str,
    cascade: &Cascade<6>,
    table: &ResamplerTable,
    scipy: &[f64],
) -> Result<(), Box<dyn Error>> {
    let phases = table.taps.iter().map(|taps| taps.as_slice().try_into());
    let phases: Vec<[i32; TAPS]> = phases.collect::<Result<_, _>>()?;
    let resampler: Resampler<PHASES, TAPS> = Resampler {
        down: table.down,
        taps: phases.try_into().map_err(|_| "another number of phases")?,
    };
    let bits = chain::outputs(cascade, &resampler, signal::counts(), false);
    let steps = f64::from(1 << chain::GUARD_BITS);
    #[expect(clippy::cast_possible_truncation, reason = "24 bits of counts, x 2^5")]
    let scipy: Vec<i32> = scipy.iter().map(|y| (y * steps).round() as i32).collect();
    let sections = format!("{:?}", cascade.sections);
    let shapes = ["Notch", "HighPass", "BandPass", "LowPass"];
    let sections = shapes.iter().fold(sections, |text, shape| {
        text.replace(&format!("{shape} {{"), &format!("Section::{shape} {{"))
    });
    writeln!(
        golden,
        "pub(crate) static {name}: Filtered<6, {PHASES}, {TAPS}> = Filtered {{\n\
         cascade: Cascade {{ sections: {sections} }},\n\
         resampler: {resampler:?},\nscipy: {scipy:?},\nbits: {bits:?},\n}};"
    )?;
    Ok(())
}

/// Writes up to [`WINDOWS`] of the artifact's golden windows, evenly spaced, with their codes from
/// model-gen's batch reference.
fn windows(golden: &mut String) -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-env-changed={ARTIFACT}");
    let folder = env::var_os(ARTIFACT).map_or("../../signal/model/artifact".into(), PathBuf::from);
    println!("cargo::rerun-if-changed={}", folder.display());
    let all = Golden::read(&folder)?;
    let every = all.windows.len().div_ceil(WINDOWS).max(1);
    let windows: Vec<_> = all.windows.iter().step_by(every).collect();
    let [_, cells] = all.window_shape;
    let planes = |window: &Vec<i8>| window.chunks_exact(cells).map(<[i8]>::to_vec).collect();
    let windows: Vec<Vec<Vec<i8>>> = windows.into_iter().map(planes).collect();
    let codes = all.codes.iter().step_by(every);
    let codes: Vec<_> = codes.map(artifact::IntegerCode::levels).collect();
    let count = windows.len();
    writeln!(
        golden,
        "pub(crate) const WINDOWS_IN_ALL: u32 = {count};\n\
         pub(crate) static WINDOWS: [[[i8; CELLS]; STEPS]; {count}] = {windows:?};\n\
         pub(crate) static WINDOW_CODES: [[i32; CODE]; {count}] = {codes:?};"
    )?;
    Ok(())
}

/// Writes the first [`CODES`] codes that this PC computes for [`signal::samples`], as array `name`.
fn codes(golden: &mut String, name: &str, mains: Mains) -> Result<(), Box<dyn Error>> {
    let (mut acquisition, mut encoder) = (Acquisition::new(mains), Encoder::new());
    let codes = signal::samples()
        .filter_map(|sample| encoder.encode_step(&acquisition.process_sample(&sample)?));
    let codes: Vec<_> = codes.take(CODES).collect();
    let codes = format!("{codes:?}").replace("values: Int", "values: CodeValues::Int");
    writeln!(golden, "pub(crate) static {name}: [Code; {CODES}] = {codes};")?;
    Ok(())
}

/// Writes the first [`HOPS`] features that this PC computes for [`signal::samples`].
fn features(golden: &mut String) -> Result<(), Box<dyn Error>> {
    let (mut acquisition, mut extractor) = (Acquisition::new(Mains::Hz50), FeatureExtractor::NEW);
    extractor.set_filters(signal::filters());
    let hops = signal::samples()
        .filter_map(|sample| extractor.add_step(&acquisition.process_sample(&sample)?));
    let rows: Vec<Vec<u8>> = hops.take(HOPS).map(|features| features.levels().to_vec()).collect();
    writeln!(
        golden,
        "pub(crate) static FEATURES: [[u8; {}]; {HOPS}] = {rows:?};",
        pipeline::MAX_FEATURES
    )?;
    Ok(())
}

/// Writes the first [`BLOCKS`] packed blocks that this PC computes from [`signal::samples`], with
/// the rates 0 to 15 in turn, and the encoder's state after them.
fn blocks(golden: &mut String) -> Result<(), Box<dyn Error>> {
    let mut acquisition = Acquisition::new(Mains::Hz50);
    let mut encoder = Box::new(PackedEncoder::new());
    let mut samples = signal::samples();
    let mut blocks = Vec::new();
    // If the model has no packed code, the state is empty, and no step completes a block.
    let count = if encoder.state().is_empty() { 0 } else { BLOCKS };
    for block in 0..count {
        encoder.set_rate(Rate::new(block % 16).ok_or("16 rates")?);
        let block =
            samples.find_map(|sample| encoder.encode_step(&acquisition.process_sample(&sample)?));
        blocks.extend(block.map(|block| block.bytes().to_vec()));
    }
    let rows: Vec<String> = blocks.iter().map(|bytes| format!("&{bytes:?}")).collect();
    let (count, rows) = (blocks.len(), rows.join(", "));
    let state = encoder.state();
    let coefficients = state.len();
    writeln!(
        golden,
        "pub(crate) static BLOCKS: [&[u8]; {count}] = [{rows}];\n\
         pub(crate) static PACKED_STATE: [i16; {coefficients}] = {state:?};"
    )?;
    Ok(())
}

/// Writes the bytes of a hex dump in [`WIRE_FORMAT`]: the block that opens with
/// ```` ```hex NAME ````, where NAME is the value of `dump`.
fn frame(golden: &mut String, name: &str, dump: &str) -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed={WIRE_FORMAT}");
    let document = fs::read_to_string(WIRE_FORMAT)?;
    let open = format!("```hex {dump}\n");
    let (_, block) = document.split_once(&open).ok_or(open)?;
    let (block, _) = block.split_once("```").ok_or("a block has an end")?;
    let bytes = block.split_whitespace().map(|byte| u8::from_str_radix(byte, 16));
    let bytes: Vec<u8> = bytes.collect::<Result<_, _>>()?;
    let length = bytes.len();
    writeln!(golden, "pub(crate) const {name}: [u8; {length}] = {bytes:?};")?;
    Ok(())
}

fn has_feature(feature: &str) -> bool {
    env::var_os(format!("CARGO_FEATURE_{feature}")).is_some()
}

/// Passes the memory map of the selected board to the linker. Does nothing in a build for the PC.
fn link(out: &Path) -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed=../../memory.x");
    let map = match (has_feature("H743"), has_feature("F446")) {
        (false, false) => "../../firmware/board-qemu/mps2.x",
        (true, false) => "../../firmware/board-h743/stm32h743.x",
        (false, true) => "../../firmware/board-f446/stm32f446.x",
        (true, true) => Err("an image is for one board: feature h743 or f446")?,
    };
    println!("cargo::rerun-if-changed={map}");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return Ok(());
    }
    // `memory.x` in the workspace's root includes `board.x`.
    fs::copy(map, out.join("board.x"))?;
    println!("cargo::rustc-link-search={}", out.display());
    for argument in ["-Tlink.x", "--nmagic"] {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
    Ok(())
}

//! The integer encoder against the float one, on networks in which every layer and every sign of
//! batch norm matters.

use std::path::Path;

use artifact::{
    Artifact, CELLS, CODE, FloatEncoder, Geometry, Mode, NetworkShape, STEPS, ScalpGrid, Tensors,
    WINDOW_CELLS, WINDOW_ELECTRODES,
};
use model_gen::{IntegerModel, Plane, quantise};

/// Pseudo-random numbers in [-1, 1) (a linear congruential generator, Numerical Recipes).
struct Noise(u32);

impl Noise {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f32::from(i16::try_from(self.0.cast_signed() >> 16).expect("16 bits")) / 32_768.0
    }

    fn fill(&mut self, length: usize, scale: f32) -> Vec<f32> {
        (0..length).map(|_| self.next() * scale).collect()
    }
}

fn checked_in() -> Artifact {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model/artifact");
    Artifact::read(&folder).expect("the checked-in artifact is readable")
}

/// Dense random weights; batch norms with negative, zero and positive factors; some offsets.
fn dense_weights(noise: &mut Noise, mode: Mode, network: &NetworkShape) -> Tensors {
    let geometry = Geometry::new(network);
    let mut weights = Tensors::for_weights();
    for (name, shape) in artifact::weight_shapes(mode, &geometry) {
        let length = shape.iter().product();
        let inputs: usize = shape[1..].iter().product();
        #[expect(
            clippy::cast_precision_loss,
            reason = "layers have about a thousand inputs"
        )]
        let scale = match name {
            _ if name.ends_with("running_var") => 0.0,
            _ if name.contains("norm") => 1.0,
            _ if name.ends_with("bias") => 0.3,
            _ => 1.7 / (inputs as f32).sqrt(),
        };
        let mut values = noise.fill(length, scale);
        if name.ends_with("running_var") {
            values = noise.fill(length, 0.4).iter().map(|v| v + 0.7).collect();
        }
        if name.contains("norm") && name.ends_with(".weight") {
            values[1] = 0.0;
        }
        weights.insert(name, &shape, values);
    }
    weights
}

/// Smooth random windows on the grid, uV over the input's SD.
fn windows(noise: &mut Noise, grid: &ScalpGrid) -> Vec<Box<[f32; WINDOW_CELLS]>> {
    (0..40)
        .map(|_| {
            let mut last = [0.0_f32; 61];
            let mut window = [0.0; WINDOW_ELECTRODES];
            for step in window.chunks_exact_mut(61) {
                for (value, last) in step.iter_mut().zip(&mut last) {
                    *last = 0.8 * *last + 0.9 * noise.next();
                    *value = *last;
                }
            }
            grid.scatter(&window)
        })
        .collect()
}

/// A calibrated artifact of random weights with windows and their float codes.
struct Case {
    artifact: Artifact,
    windows: Vec<Box<[f32; WINDOW_CELLS]>>,
    codes: Vec<[f32; CODE]>,
}

fn calibrated(mode: Mode, seed: u32) -> Case {
    let mut noise = Noise(seed);
    let mut artifact = checked_in();
    artifact.description.mode = mode;
    artifact.weights = dense_weights(&mut noise, mode, &artifact.description.network);
    let windows = windows(&mut noise, &ScalpGrid::new(&artifact.description));
    let encoder = FloatEncoder::new(&artifact).expect("a complete network");
    let traced: Vec<_> = windows
        .iter()
        .map(|window| encoder.encode_traced(window))
        .collect();

    let mut calibration = Tensors::for_calibration();
    let largest = |values: &mut dyn Iterator<Item = f32>| values.fold(0.0, f32::max);
    #[expect(clippy::cast_possible_truncation, reason = "a scale")]
    let sd_uv = artifact.description.input.sd_uv as f32;
    let input = largest(
        &mut windows
            .iter()
            .flat_map(|w| w.iter().map(|x| x.abs() * sd_uv)),
    );
    calibration.insert("input.max_abs", &[1], vec![input]);
    if mode.has_convolutions() {
        let first = largest(&mut traced.iter().map(|t| t.activation1_max));
        let second = largest(&mut traced.iter().map(|t| t.activation2_max));
        calibration.insert("activation1.max", &[1], vec![first]);
        calibration.insert("activation2.max", &[1], vec![second]);
    }
    let fold = |f: fn(f32, f32) -> f32, start: f32| -> Vec<f32> {
        (0..CODE)
            .map(|j| traced.iter().fold(start, |m, t| f(m, t.code[j])))
            .collect()
    };
    calibration.insert("code.min", &[CODE], fold(f32::min, f32::INFINITY));
    calibration.insert("code.max", &[CODE], fold(f32::max, f32::NEG_INFINITY));
    artifact.calibration = calibration;
    let codes = traced.iter().map(|t| t.code).collect();
    Case {
        artifact,
        windows,
        codes,
    }
}

/// What the integer encoder makes of a float window, dequantised.
fn integer_code(model: &IntegerModel, sd_uv: f32, window: &[f32; WINDOW_CELLS]) -> [f32; CODE] {
    #[expect(clippy::cast_possible_truncation, reason = "clamped to 8 bits")]
    let quantised: Vec<i8> = window
        .iter()
        .map(|x| {
            (x * sd_uv / model.input_scale_uv)
                .round()
                .clamp(-128.0, 127.0) as i8
        })
        .collect();
    let planes: Vec<Plane> = quantised
        .chunks_exact(CELLS)
        .map(|p| p.try_into().expect("90 cells"))
        .collect();
    let planes: &[Plane; STEPS] = planes[..].try_into().expect("16 steps");
    let code = model.encode_window(planes);
    std::array::from_fn(|j| {
        f32::from(i16::from(code[j]) - i16::from(model.code_zero_point[j])) * model.code_scale[j]
    })
}

/// Signal over quantisation noise of all codes, dB, means removed per dimension.
fn sqnr_db(float: &[[f32; CODE]], integer: &[[f32; CODE]]) -> f32 {
    let (mut signal, mut noise) = (0.0, 0.0);
    for j in 0..CODE {
        #[expect(clippy::cast_precision_loss, reason = "40 windows")]
        let mean = float.iter().map(|z| z[j]).sum::<f32>() / float.len() as f32;
        for (a, b) in float.iter().zip(integer) {
            signal += (a[j] - mean).powi(2);
            noise += (a[j] - b[j]).powi(2);
        }
    }
    10.0 * (signal / noise).log10()
}

#[test]
fn integer_codes_follow_the_float_codes_in_every_mode() {
    for (mode, floor_db) in [
        // Measured 37.0, 25.9, 25.9 and 37.7 dB at least.
        (Mode::Shortcut, 34.0),
        (Mode::PaperCodeOnly, 23.0),
        (Mode::Paper, 23.0),
        (Mode::Pca, 34.0),
    ] {
        for seed in [1, 2] {
            let Case {
                artifact,
                windows,
                codes,
            } = calibrated(mode, seed);
            let model = quantise(&artifact).expect("a quantisable network");
            #[expect(clippy::cast_possible_truncation, reason = "a scale")]
            let sd_uv = artifact.description.input.sd_uv as f32;
            let integer: Vec<_> = windows
                .iter()
                .map(|window| integer_code(&model, sd_uv, window))
                .collect();
            let sqnr = sqnr_db(&codes, &integer);
            eprintln!("{mode:?} seed {seed}: {sqnr:.1} dB");
            assert!(sqnr > floor_db, "{mode:?}, seed {seed}: {sqnr:.1} dB");
        }
    }
}

#[test]
fn a_dimension_that_never_comes_near_zero_keeps_its_resolution() {
    let Case { mut artifact, .. } = calibrated(Mode::Shortcut, 4);
    let raise = |name: &str, by: f32| {
        let values = artifact
            .calibration
            .tensor(name, &[CODE])
            .expect("calibrated");
        values.iter().map(|v| v + by).collect::<Vec<f32>>()
    };
    let (low, high) = (raise("code.min", 100.0), raise("code.max", 100.0));
    artifact.calibration.insert("code.min", &[CODE], low);
    artifact
        .calibration
        .insert("code.max", &[CODE], high.clone());
    let model = quantise(&artifact).expect("a quantisable network");
    for (j, high) in high.iter().enumerate() {
        let q = high / model.code_scale[j] + f32::from(model.code_zero_point[j]);
        assert!(q <= 127.0, "dimension {j}: {q}");
    }
}

//! Tests that a packed model reads back from its files unchanged, and that invalid models are
//! refused.

use crate::description::Mode;
use crate::error::{ArtifactError, TensorProblem};
use crate::float_decoder::FloatDecoder;
use crate::float_encoder::FloatEncoder;
use crate::folder::Artifact;
use crate::packed::{
    ErrorWeight, IntegerMatrix, PackedDescription, PackedModel, PackedTraining, Smoother,
};
use crate::testing;
use packed::{LEVELS, MAGNITUDES, RATES};

const COEFFICIENTS: usize = 16;

/// Returns a packed model for 61 electrodes and 8 steps, with small pseudo-random weights.
fn packed() -> PackedModel {
    let values = 61 * 8;
    let mut state = 7_u32;
    let mut weights = |count: usize| -> Vec<i8> {
        let draw = |_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            i8::try_from(state >> 28).unwrap() - 8
        };
        (0..count).map(draw).collect()
    };
    let starts: [u16; MAGNITUDES] = std::array::from_fn(|m| 2048 * u16::try_from(m).unwrap());
    PackedModel {
        description: PackedDescription {
            format: 1,
            coefficients: COEFFICIENTS,
            rate: 4,
            unit_uv: 0.5,
            input_limit: 4095,
            misfit_uv2: 20.0,
            weight: None,
            training: PackedTraining::default(),
        },
        analysis: IntegerMatrix {
            weights: weights(COEFFICIENTS * values),
            factors: vec![1 << 24; COEFFICIENTS],
        },
        prediction: IntegerMatrix {
            weights: weights(COEFFICIENTS * COEFFICIENTS),
            factors: vec![1 << 26; COEFFICIENTS],
        },
        predicted_levels: vec![30; COEFFICIENTS],
        reset_levels: vec![63; COEFFICIENTS],
        starts: Box::new([[starts; LEVELS]; 2]),
        smoother: Smoother {
            weights: weights(RATES * COEFFICIENTS * COEFFICIENTS),
            scales: vec![0.001; RATES * COEFFICIENTS],
        },
        synthesis: None,
    }
}

fn with(change: impl Fn(&mut PackedModel)) -> Result<Artifact, ArtifactError> {
    let mut model = packed();
    change(&mut model);
    testing::pca().with_packed(Some(model))
}

#[test]
fn a_packed_model_reads_back_with_the_same_id_which_covers_it() {
    let folder = tempfile::tempdir().unwrap();
    let artifact = with(|_| ()).unwrap();
    assert_ne!(artifact.id, testing::pca().id);
    assert_eq!(artifact.write(folder.path()).unwrap(), artifact.id);
    assert_eq!(Artifact::read(folder.path()).unwrap(), artifact);
    let other = with(|model| model.reset_levels[3] = 5).unwrap();
    assert_ne!(other.id, artifact.id);
    // Removing the packed model removes its files. The id of the model is then the id of the
    // network.
    let plain = artifact.with_packed(None).unwrap();
    assert_eq!(plain.id, testing::pca().id);
    plain.write(folder.path()).unwrap();
    assert_eq!(Artifact::read(folder.path()).unwrap(), plain);
}

/// Gives a model an error weight, and a synthesis of `values` numbers.
fn weigh(model: &mut PackedModel, values: usize) {
    model.description.weight = Some(ErrorWeight { band_hz: [8.0, 30.0], strength: 3.0 });
    model.synthesis = Some(vec![0.25; values]);
}

#[test]
fn a_weighted_model_reads_back_with_its_synthesis_which_decodes() {
    let folder = tempfile::tempdir().unwrap();
    let values = COEFFICIENTS * 61 * 8;
    let artifact = with(|model| weigh(model, values)).unwrap();
    artifact.write(folder.path()).unwrap();
    let read = Artifact::read(folder.path()).unwrap();
    assert_eq!(read, artifact);
    let synthesis = crate::reconstruction::synthesis(&read.packed.unwrap());
    assert_eq!(synthesis, vec![0.25; values]);
    // A weight without a synthesis is refused, and so is a synthesis without a weight.
    for (change, expected) in [
        ((|model| model.description.weight = None) as fn(&mut PackedModel), TensorProblem::Unknown),
        (|model| model.synthesis = None, TensorProblem::Missing),
    ] {
        let error = with(|model| {
            weigh(model, values);
            change(model);
        });
        let ArtifactError::Tensor { name, problem, .. } = error.unwrap_err() else {
            panic!("another error")
        };
        assert_eq!((name.as_str(), problem), ("synthesis", expected));
    }
}

/// Returns a model of mode `packed`: the packed model without a network.
fn alone() -> Result<Artifact, ArtifactError> {
    let mut description = testing::description();
    description.mode = Mode::Packed;
    description.code.numbers = 0;
    Artifact::without_network(description, 640.0, packed())
}

#[test]
fn a_packed_model_alone_has_no_files_of_a_network() {
    let folder = tempfile::tempdir().unwrap();
    let name = |name: &str| folder.path().join(name);
    with(|_| ()).unwrap().write(folder.path()).unwrap();
    std::fs::write(name("golden.safetensors"), "of the network").unwrap();
    std::fs::write(name("pca.safetensors"), "of the network").unwrap();
    let artifact = alone().unwrap();
    assert_eq!(artifact.write(folder.path()).unwrap(), artifact.id);
    assert_eq!(Artifact::read(folder.path()).unwrap(), artifact);
    let mut names: Vec<_> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|file| file.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    let expected = ["calibration.safetensors", "model.toml", "packed.safetensors", "packed.toml"];
    assert_eq!(names, expected);
    assert!((artifact.input_scale_uv().unwrap() - 640.0 * 1.25 / 127.0).abs() < 1e-9);
}

#[test]
fn codes_of_a_packed_model_alone_have_no_numbers() {
    let artifact = alone().unwrap();
    let dimensions = artifact.description.dimensions();
    let encoder = FloatEncoder::new(&artifact).unwrap();
    assert!(encoder.encode(&vec![1.0; dimensions.window_cells()]).is_empty());
    let decoder = FloatDecoder::new(&artifact).unwrap();
    let silence = vec![0.0; dimensions.window_electrodes()];
    assert_eq!(decoder.decode(&[]), silence);
}

#[test]
fn a_model_with_neither_network_nor_packed_model_is_refused() {
    let error = alone().unwrap().with_packed(None).unwrap_err();
    assert!(matches!(error, ArtifactError::Empty), "{error}");
    let folder = tempfile::tempdir().unwrap();
    alone().unwrap().write(folder.path()).unwrap();
    for name in ["packed.toml", "packed.safetensors"] {
        std::fs::remove_file(folder.path().join(name)).unwrap();
    }
    let error = Artifact::read(folder.path()).unwrap_err();
    assert!(matches!(error, ArtifactError::Empty), "{error}");
}

#[test]
fn a_part_of_another_length_is_refused_by_name() {
    type Change = fn(&mut PackedModel);
    let cases: [(Change, &str); 4] = [
        (|m| weigh(m, COEFFICIENTS * 487), "synthesis"),
        (|m| m.analysis.weights.truncate(COEFFICIENTS * 487), "analysis.weight"),
        (|m| m.reset_levels.push(0), "levels.reset"),
        (|m| m.smoother.scales.clear(), "smoother.scale"),
    ];
    for (change, expected) in cases {
        let error = with(change).unwrap_err();
        let ArtifactError::Tensor { ref name, problem: TensorProblem::Shape(..), .. } = error
        else {
            panic!("{error}")
        };
        assert_eq!(name, expected);
    }
}

#[test]
fn a_tensor_that_no_packed_model_has_is_refused_by_name() {
    let [(_, toml), (_, mut tensors)] = packed().to_files().unwrap();
    // The new name is as long as the old one, so the tensors keep their offsets in the file.
    let at = tensors.windows(6).position(|name| name == b"starts").unwrap();
    tensors[at..][..6].copy_from_slice(b"startz");
    let error = PackedModel::parse(&toml, &tensors, &testing::description()).unwrap_err();
    assert!(error.to_string().contains("startz"), "{error}");
}

#[test]
fn numbers_of_a_code_without_a_network_are_refused() {
    let mut description = testing::description();
    description.mode = Mode::Packed;
    let error = Artifact::without_network(description, 640.0, packed()).unwrap_err();
    assert!(error.to_string().contains("code.numbers is 128"), "{error}");
}

#[test]
fn a_model_whose_sums_could_leave_their_range_is_refused_by_name() {
    type Change = fn(&mut PackedModel);
    let cases: [(Change, &str, usize); 9] = [
        (
            |m| {
                weigh(m, COEFFICIENTS * 488);
                m.synthesis.as_mut().unwrap()[9] = f32::INFINITY;
            },
            "synthesis",
            9,
        ),
        // Fills 40 weights of row 2's first slice with 127: 40 * 127 * 4095 exceeds 23 bits.
        (|m| m.analysis.weights[2 * 488..][..40].fill(127), "analysis", 2),
        (|m| m.analysis.weights[9] = -128, "analysis", 0),
        (|m| m.prediction.weights[16..].fill(-128), "prediction", 1),
        (|m| m.prediction.factors[4] = -1, "prediction", 4),
        (|m| m.analysis.factors[3] = i32::MAX, "analysis", 3),
        (|m| m.reset_levels[1] = 64, "levels", COEFFICIENTS + 1),
        (|m| m.starts[1][5][3] = m.starts[1][5][2], "starts", 0),
        (|m| m.smoother.scales[7] = f32::NAN, "smoother.scale", 7),
    ];
    for (change, expected, at) in cases {
        let error = with(change).unwrap_err();
        let ArtifactError::Tensor { file, ref name, problem: TensorProblem::Range(index, _) } =
            error
        else {
            panic!("{error}")
        };
        assert_eq!((file, name.as_str(), index), ("packed.safetensors", expected, at));
    }
    // The largest possible sum of the prediction, 16 * 127 * 4096, still fits 23 bits.
    with(|m| m.prediction.weights.fill(127)).unwrap();
}

#[test]
fn the_error_of_an_invalid_field_names_it_and_what_it_may_be() {
    type Change = fn(&mut PackedModel);
    let cases: [(Change, &str); 9] = [
        (|m| m.description.format = 2, "packed.toml: format is 2, but must be 1"),
        (
            |m| m.description.coefficients = 24,
            "coefficients is 24, but must be a multiple of 16 up to 256",
        ),
        (|m| m.description.coefficients = 272, "coefficients is 272"),
        (|m| m.description.rate = 16, "rate is 16, but must be 0 to 15"),
        (|m| m.description.input_limit = 100, "input_limit is 100"),
        (|m| m.description.unit_uv = 0.0, "unit_uv is 0, but must be above 0"),
        (|m| m.description.misfit_uv2 = f64::NAN, "misfit_uv2 is NaN"),
        (|m| m.description.misfit_uv2 = 4.2e6, "but must be at most 4192256.25"),
        (|m| m.description.coefficients = 0, "coefficients is 0"),
    ];
    for (change, expected) in cases {
        let error = with(change).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn damaged_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    with(|_| ()).unwrap().write(folder.path()).unwrap();
    let error = || Artifact::read(folder.path()).unwrap_err().to_string();
    let tensors = folder.path().join("packed.safetensors");
    let bytes = std::fs::read(&tensors).unwrap();
    std::fs::write(&tensors, &bytes[..bytes.len() - 1]).unwrap();
    assert!(error().starts_with("packed.safetensors is damaged"), "{}", error());
    std::fs::write(&tensors, &bytes).unwrap();
    let toml = folder.path().join("packed.toml");
    let text = std::fs::read_to_string(&toml).unwrap();
    std::fs::write(&toml, text.replace("coefficients = 16", "coefficients = 32")).unwrap();
    assert!(
        error().contains("tensor smoother.weight has shape [16, 16, 16], expected [16, 32, 32]"),
        "{}",
        error()
    );
    std::fs::write(&toml, text.replace("unit_uv", "unit_mv")).unwrap();
    assert!(error().starts_with("packed.toml cannot be understood"), "{}", error());
}

#[test]
fn every_round_of_inputs_is_added_as_soon_as_it_is_complete() {
    // After the steps, 61, 122, .. 488 inputs have arrived, rounded down to multiples of 16.
    assert_eq!(super::slice_ends(61, 8), [48, 112, 176, 240, 304, 352, 416, 488]);
    assert_eq!(super::slice_ends(8, 4), [0, 16, 16, 32]);
}

#[test]
fn one_of_the_two_files_alone_is_refused_with_the_remedy() {
    for (removed, other) in
        [("packed.toml", "packed.safetensors"), ("packed.safetensors", "packed.toml")]
    {
        for artifact in [alone().unwrap(), with(|_| ()).unwrap()] {
            let folder = tempfile::tempdir().unwrap();
            artifact.write(folder.path()).unwrap();
            std::fs::remove_file(folder.path().join(removed)).unwrap();
            let error = Artifact::read(folder.path()).unwrap_err().to_string();
            let parts = [removed, other, "is missing", "trainer packed"];
            assert!(parts.iter().all(|part| error.contains(part)), "{error}");
        }
    }
}

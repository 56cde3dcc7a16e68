//! Tests of the table of substitutions in the generated constants of a model.

use std::path::Path;

use artifact::{Artifact, SubstitutionDescription, SubstitutionTable};
use int8_nn::{Linear, Pair};
use model_gen::{DeviceModel, manifest, pack, rust_files};

const ELECTRODES: usize = 61;

/// Returns a table whose weights differ and reach both ends of their range. Only every fifth weight
/// in a row is not 0, because the sum of the magnitudes in a row is limited.
fn table() -> SubstitutionTable {
    let weight = |index: usize| {
        let (e, other) = (index / ELECTRODES, index % ELECTRODES);
        let weight = i16::try_from((e * 7 + other * 13) % 255).expect("small") - 127;
        let is_zero = e == other || (e + other) % 5 != 0;
        i8::try_from(if is_zero { 0 } else { weight }).expect("8 bits")
    };
    SubstitutionTable {
        description: SubstitutionDescription { format: 1, ..SubstitutionDescription::default() },
        weights: (0..ELECTRODES * ELECTRODES).map(weight).collect(),
        innovation: (0..61).map(|e| 16 * 16 + e).collect(),
    }
}

#[test]
fn the_packed_matrix_predicts_each_electrode_from_the_others() {
    let table = table();
    let (inputs, outputs, weights) = (32, 64, &*pack::substitution(&table));
    let matrix = Linear { inputs, outputs, weights };
    assert!(matrix.is_consistent(inputs, outputs));
    let step: Vec<i16> = (0..61).map(|e| e * e % 256 - 100).collect();
    let mut pairs = [Pair::ZERO; 32];
    Pair::fill(&mut pairs, step.iter().copied());
    let mut sums = [0; 64];
    matrix.accumulate(&pairs, &mut sums);
    for (e, row) in table.weights.chunks_exact(ELECTRODES).enumerate() {
        let products = row.iter().zip(&step);
        let expected: i32 = products.map(|(&w, &x)| i32::from(w) * i32::from(x)).sum();
        assert_eq!(sums[e], expected, "electrode {e}");
        assert!(
            (0..ELECTRODES).all(|other| {
                matrix.weights_from(other / 2, e).get()[other % 2] == i16::from(row[other])
            }),
            "{e}"
        );
    }
    assert_eq!(sums[61..], [0; 3]);
}

#[test]
fn constants_and_manifest_state_the_table_only_if_there_is_one() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../signal/model/paper");
    let artifact = Artifact::read(&folder).expect("the checked-in artifact is readable");
    let texts = |artifact: &Artifact| {
        let model = DeviceModel::new(artifact).expect("a usable model");
        let [(_, constants), (_, statics)] = rust_files(&model);
        // The first item, the model id, always differs.
        let constants = constants[constants.find(";\n").expect("an id")..].to_owned();
        (constants, statics, manifest(&model))
    };
    let (constants, statics, without) = texts(&artifact);
    assert!(statics.ends_with("SUBSTITUTION: Option<Substitution<'static>> = None;\n"));
    let artifact = artifact.with_substitution(Some(table()));
    let (same_constants, statics, with) = texts(&artifact.expect("a valid table"));
    assert_eq!(same_constants, constants);
    for expected in [
        "static SUBSTITUTION_WEIGHTS: [Pair; 1_024] = [",
        "static SUBSTITUTION_INNOVATION: [i32; ELECTRODES] = [\n    256, 257,",
        "SUBSTITUTION: Option<Substitution<'static>> = Some(Substitution {",
    ] {
        assert!(statics.contains(expected), "no `{expected}`");
    }
    // The weights take 4,096 bytes; the innovations take 244 and are sqrt(256..316) / 16 uV.
    let lines = "
substitution          61 electrodes, each from the others, 4340 B
  innovation          1.00 .. 1.11 uV rms
";
    assert!(with.ends_with(lines) && !without.contains("substitution"), "{with}");
}

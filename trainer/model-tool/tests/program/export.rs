//! Files as a training framework exports them.

use artifact::{Artifact, FloatDecoder, FloatEncoder, ScalpGrid, Tensors};
use safetensors::{Dtype, tensor::TensorView};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A specification for the built-in model's shape.
pub(crate) const SPEC: &str = r#"
montage = "MONTAGES/ten-ten-61.toml"
mode = "shortcut"
sd_uv = 47.5
mains_hz = 60
dataset = "random"
"#;

/// A tensor of a file.
#[derive(Clone)]
pub(crate) struct Exported {
    pub(crate) dtype: Dtype,
    pub(crate) shape: Vec<usize>,
    pub(crate) bytes: Vec<u8>,
}

impl Exported {
    pub(crate) fn f32(shape: &[usize], values: &[f32]) -> Self {
        Self {
            dtype: Dtype::F32,
            shape: shape.to_vec(),
            bytes: values
                .iter()
                .flat_map(|value| value.to_le_bytes())
                .collect(),
        }
    }
}

/// Tensors of a file by name.
pub(crate) type File = BTreeMap<String, Exported>;

/// Number of windows to calibrate with, and to compare with.
pub(crate) const WINDOWS: usize = 24;

/// Returns what a framework would export for a model: its weights with the usual counters, windows to calibrate with,
/// and windows with codes and reconstructions to compare with.
pub(crate) fn export(model: &Artifact) -> File {
    let mut file = File::new();
    insert_all(&mut file, "", &model.weights);
    for norm in ["encoder.norm1", "encoder.norm2", "decoder.norm1"] {
        let counter = Exported {
            dtype: Dtype::I64,
            shape: Vec::new(),
            bytes: 7_i64.to_le_bytes().to_vec(),
        };
        file.insert(format!("{norm}.num_batches_tracked"), counter);
    }
    let dimensions = model.description.dimensions();
    let shape = [
        WINDOWS,
        1,
        dimensions.steps,
        dimensions.rows,
        dimensions.columns,
    ];
    let calibration = any_model::windows(1, model, WINDOWS).concat();
    file.insert(
        "calibration.windows".to_owned(),
        Exported::f32(&shape, &calibration),
    );
    let windows = any_model::windows(2, model, WINDOWS);
    let encoder = FloatEncoder::new(model).expect("an encoder");
    let codes: Vec<Vec<f32>> = windows
        .iter()
        .map(|window| encoder.encode(window))
        .collect();
    file.insert(
        "reference.windows".to_owned(),
        Exported::f32(&shape, &windows.concat()),
    );
    let code_shape = [WINDOWS, dimensions.numbers];
    file.insert(
        "reference.codes".to_owned(),
        Exported::f32(&code_shape, &codes.concat()),
    );
    let decoder = FloatDecoder::new(model).expect("a decoder");
    let grid = ScalpGrid::new(&model.description);
    let on_grid = |code: &Vec<f32>| grid.scatter(&decoder.decode(code));
    let reconstructions = codes.iter().map(on_grid).collect::<Vec<_>>().concat();
    file.insert(
        "reference.reconstructions".to_owned(),
        Exported::f32(&shape, &reconstructions),
    );
    file
}

/// Inserts all tensors of a set.
pub(crate) fn insert_all(file: &mut File, prefix: &str, tensors: &Tensors) {
    for (name, shape) in tensors.shapes() {
        let values = tensors.tensor(name, shape).expect("its own shape");
        file.insert(format!("{prefix}{name}"), Exported::f32(shape, values));
    }
}

/// Writes tensors and a specification into a folder; returns their paths.
pub(crate) fn write(folder: &Path, file: &File, spec: &str) -> [PathBuf; 2] {
    let views = file.iter().map(|(name, tensor)| {
        let view = TensorView::new(tensor.dtype, tensor.shape.clone(), &tensor.bytes);
        (name, view.expect("a shape that its elements fill"))
    });
    let bytes = safetensors::serialize(views, None).expect("a file");
    let paths = ["network.safetensors", "network.toml"].map(|name| folder.join(name));
    std::fs::write(&paths[0], bytes).expect("a new file");
    std::fs::write(&paths[1], spec.replace("MONTAGES", any_model::MONTAGES)).expect("a new file");
    paths
}

//! Writes files as a training framework exports them, for tests of the import.

use super::Folder;
use artifact::{Artifact, FloatDecoder, FloatEncoder, ScalpGrid, Tensors};
use safetensors::{Dtype, tensor::TensorView};
use std::collections::BTreeMap;

/// Specification for importing a network with the shape of the built-in model.
pub(crate) const SPEC: &str = r#"
montage = "MONTAGES/ten-ten-61.toml"
mode = "shortcut"
sd_uv = 47.5
mains_hz = 60
dataset = "random"
"#;

/// A tensor of an exported file.
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
            bytes: values.iter().flat_map(|value| value.to_le_bytes()).collect(),
        }
    }
}

/// Tensors of an exported file by name.
pub(crate) type File = BTreeMap<String, Exported>;

/// Number of calibration windows, and also of reference windows.
pub(crate) const WINDOWS: usize = 24;

/// Returns the export of a model as a framework writes it: the weights with the counters of
/// PyTorch's batch norm, calibration windows, and reference windows with codes and reconstructions.
pub(crate) fn export(model: &Artifact) -> File {
    let mut file = File::new();
    insert_all(&mut file, "", &model.weights);
    for norm in ["encoder.norm1", "encoder.norm2", "decoder.norm1"] {
        let counter =
            Exported { dtype: Dtype::I64, shape: Vec::new(), bytes: 7_i64.to_le_bytes().to_vec() };
        file.insert(format!("{norm}.num_batches_tracked"), counter);
    }
    let dimensions = model.description.dimensions();
    let window = [1, dimensions.steps, dimensions.rows, dimensions.columns];
    let windows = any_model::windows(2, model, WINDOWS);
    let encoder = FloatEncoder::new(model).expect("an encoder");
    let codes: Vec<_> = windows.iter().map(|window| encoder.encode(window)).collect();
    let decoder = FloatDecoder::new(model).expect("a decoder");
    let grid = ScalpGrid::new(&model.description);
    let on_grid = |code: &Vec<f32>| grid.scatter(&decoder.decode(code));
    let reconstructions: Vec<_> = codes.iter().map(on_grid).collect();
    let calibration = any_model::windows(1, model, WINDOWS);
    for (name, rows, row) in [
        ("calibration.windows", calibration, &window[..]),
        ("reference.windows", windows, &window),
        ("reference.codes", codes, &[dimensions.numbers]),
        ("reference.reconstructions", reconstructions, &window),
    ] {
        let shape = [&[WINDOWS], row].concat();
        file.insert(name.to_owned(), Exported::f32(&shape, &rows.concat()));
    }
    file
}

/// Inserts all tensors of a set into a file, with `prefix` before their names.
pub(crate) fn insert_all(file: &mut File, prefix: &str, tensors: &Tensors) {
    for (name, shape) in tensors.shapes() {
        let values = tensors.tensor(name, shape).expect("its own shape");
        file.insert(format!("{prefix}{name}"), Exported::f32(shape, values));
    }
}

/// Writes a file's tensors to `network.safetensors` and its specification to `network.toml`.
pub(crate) fn write(folder: &Folder, file: &File, spec: &str) {
    let views = file.iter().map(|(name, tensor)| {
        let view = TensorView::new(tensor.dtype, tensor.shape.clone(), &tensor.bytes);
        (name, view.expect("a shape that its elements fill"))
    });
    let bytes = safetensors::serialize(views, None).expect("a file");
    std::fs::write(folder.path("network.safetensors"), bytes).expect("a new file");
    folder.write("network.toml", &spec.replace("MONTAGES", any_model::MONTAGES));
}

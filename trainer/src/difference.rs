//! Compares two models and lists their differences.

use crate::error::TrainerError;
use artifact::{Artifact, ArtifactError, Golden, Tensors};
use serde::Serialize;
use serde_json::{Value as Json, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::io::ErrorKind;
use std::path::Path;

/// All differences between two models; the field names are the keys in JSON.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Difference {
    /// Ids of both models.
    pub(crate) models: [String; 2],
    /// Fields of `model.toml` that differ.
    pub(crate) fields: Vec<FieldDifference>,
    /// Tensors that differ.
    pub(crate) tensors: Vec<TensorDifference>,
    /// Parts whose contents differ: packed models, tables of substitutions, golden codes.
    pub(crate) parts: Vec<&'static str>,
}

/// A field of `model.toml` that differs between two models.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct FieldDifference {
    /// Names of the field's tables and of the field, separated by dots.
    pub(crate) field: String,
    /// Value in each model; `None` if the model lacks the field.
    pub(crate) values: [Option<String>; 2],
}

/// A tensor that differs between two models.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct TensorDifference {
    /// Name of the tensor's file, a colon, and the tensor's name.
    pub(crate) tensor: String,
    #[serde(flatten)]
    pub(crate) kind: Kind,
}

/// Difference between two tensors of the same name.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub(crate) enum Kind {
    /// The shapes differ.
    Shapes {
        /// Shape in each model; `None` if the model lacks the tensor.
        shapes: [Option<Vec<usize>>; 2],
    },
    /// The shape is the same, and elements differ.
    Values {
        /// Number of elements that differ.
        differ: usize,
        elements: usize,
        /// Largest magnitude of the difference between two elements.
        largest: f32,
        /// Root mean square of the difference, relative to the root mean square of the first
        /// model's tensor.
        relative_rms: f64,
    },
}

impl Difference {
    /// Compares the models in two folders.
    ///
    /// # Errors
    /// If a folder holds no usable model, or its golden codes cannot be read.
    pub(crate) fn read(folders: [&Path; 2]) -> Result<Self, TrainerError> {
        let read = |folder: &Path| Artifact::read(folder).map_err(TrainerError::no_model(folder));
        let [one, other] = [read(folders[0])?, read(folders[1])?];
        let golden_differ = read_golden(folders[0])? != read_golden(folders[1])?;
        Ok(Self::new(&one, &other, golden_differ))
    }

    fn new(one: &Artifact, other: &Artifact, golden_differ: bool) -> Self {
        let mut tensors = compare("weights", &one.weights, &other.weights);
        tensors.extend(compare("calibration", &one.calibration, &other.calibration));
        let packed = [one, other].map(|model| {
            let packed = model.packed.as_ref()?;
            let levels = [&packed.predicted_levels, &packed.reset_levels];
            let matrices = [&packed.analysis, &packed.prediction];
            let decoder = (&packed.smoother, &packed.synthesis);
            Some((matrices, levels, &packed.starts, decoder))
        });
        let substitution = [one, other].map(|model| {
            let table = model.substitution.as_ref()?;
            Some((&table.weights, &table.innovation))
        });
        let parts = [
            ("packed models", packed[0] != packed[1]),
            ("tables of substitutions", substitution[0] != substitution[1]),
            ("golden codes", golden_differ),
        ];
        let parts = parts.into_iter().filter(|(_, differ)| *differ);
        Self {
            models: [one.id.to_string(), other.id.to_string()],
            fields: compare_fields(&fields(one), &fields(other)),
            tensors,
            parts: parts.map(|(part, _)| part).collect(),
        }
    }

    /// Returns whether the models are equal, golden codes included.
    pub(crate) fn is_empty(&self) -> bool {
        self.fields.is_empty() && self.tensors.is_empty() && self.parts.is_empty()
    }

    /// Returns the differences as a JSON object; its key `equal` states whether there are none.
    pub(crate) fn to_json(&self) -> Json {
        let mut object = json!(self);
        object["equal"] = json!(self.is_empty());
        object
    }
}

/// Reads the golden codes in a folder; `None` if the folder has none.
fn read_golden(folder: &Path) -> Result<Option<Golden>, TrainerError> {
    match Golden::read(folder) {
        Ok(golden) => Ok(Some(golden)),
        Err(ArtifactError::File { source, .. }) if source.kind() == ErrorKind::NotFound => Ok(None),
        Err(source) => Err(TrainerError::no_model(folder)(source)),
    }
}

/// Returns the fields of a model's description as text. A key consists of the names of the field's
/// tables and of the field, separated by dots.
fn fields(artifact: &Artifact) -> BTreeMap<String, String> {
    let mut fields = BTreeMap::new();
    // Conversion to JSON cannot fail: a description has only string keys and finite numbers.
    if let Ok(Json::Object(description)) = serde_json::to_value(&artifact.description) {
        for (name, value) in description {
            flatten(&name, &value, &mut fields);
        }
    }
    let packed = artifact.packed.as_ref();
    let packed = packed.map(|packed| serde_json::to_value(&packed.description));
    let substitution = artifact.substitution.as_ref();
    let substitution = substitution.map(|table| serde_json::to_value(&table.description));
    for (name, part) in [("packed", packed), ("substitution", substitution)] {
        if let Some(Ok(part)) = part {
            flatten(name, &part, &mut fields);
        }
    }
    fields
}

fn flatten(name: &str, value: &Json, fields: &mut BTreeMap<String, String>) {
    match value {
        Json::Object(table) => {
            for (key, value) in table {
                flatten(&format!("{name}.{key}"), value, fields);
            }
        }
        Json::Null => {}
        value => {
            fields.insert(name.to_owned(), value.to_string());
        }
    }
}

fn compare_fields(
    one: &BTreeMap<String, String>,
    other: &BTreeMap<String, String>,
) -> Vec<FieldDifference> {
    let names: BTreeSet<&String> = one.keys().chain(other.keys()).collect();
    let fields = names.into_iter().map(|name| FieldDifference {
        field: name.clone(),
        values: [one, other].map(|fields| fields.get(name).cloned()),
    });
    fields.filter(|field| field.values[0] != field.values[1]).collect()
}

fn compare(file: &str, one: &Tensors, other: &Tensors) -> Vec<TensorDifference> {
    let shapes = |tensors: &Tensors| -> BTreeMap<String, Vec<usize>> {
        let shapes = tensors.shapes();
        shapes.map(|(name, shape)| (name.to_owned(), shape.to_vec())).collect()
    };
    let (ones, others) = (shapes(one), shapes(other));
    let names: BTreeSet<&String> = ones.keys().chain(others.keys()).collect();
    let kind = |name: &String| {
        let shapes = [ones.get(name).cloned(), others.get(name).cloned()];
        match &shapes {
            [Some(shape), Some(same)] if shape == same => {
                values(one.tensor(name, shape).ok()?, other.tensor(name, shape).ok()?)
            }
            _ => Some(Kind::Shapes { shapes }),
        }
    };
    names
        .into_iter()
        .filter_map(|name| {
            Some(TensorDifference { tensor: format!("{file}: {name}"), kind: kind(name)? })
        })
        .collect()
}

/// Returns how the elements of two tensors of the same shape differ; `None` if all are equal.
fn values(one: &[f32], other: &[f32]) -> Option<Kind> {
    let differences = || {
        let pairs = one.iter().zip(other);
        pairs.map(|(one, other)| (one - other).abs())
    };
    let differ = differences().filter(|difference| *difference > 0.0).count();
    let energy = |values: &mut dyn Iterator<Item = f32>| -> f64 {
        values.map(|value| f64::from(value).powi(2)).sum()
    };
    (differ > 0).then(|| Kind::Values {
        differ,
        elements: one.len(),
        largest: differences().fold(0.0, f32::max),
        relative_rms: (energy(&mut differences()) / energy(&mut one.iter().copied())).sqrt(),
    })
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [one, other] = &self.models;
        if self.is_empty() {
            return writeln!(f, "the models are equal: {one}");
        }
        writeln!(f, "{one} -> {other}")?;
        for FieldDifference { field, values } in &self.fields {
            let [one, other] = values.each_ref().map(|value| value.as_deref().unwrap_or("-"));
            writeln!(f, "{field}: {one} -> {other}")?;
        }
        for TensorDifference { tensor, kind } in &self.tensors {
            match kind {
                Kind::Shapes { shapes } => {
                    let [one, other] = shapes.each_ref().map(|shape| {
                        let shape = shape.as_ref().map(|shape| {
                            let lengths: Vec<_> = shape.iter().map(usize::to_string).collect();
                            lengths.join(" x ")
                        });
                        shape.unwrap_or_else(|| "-".to_owned())
                    });
                    writeln!(f, "{tensor}: {one} -> {other}")?;
                }
                Kind::Values { differ, elements, largest, relative_rms } => writeln!(
                    f,
                    "{tensor}: {differ} of {elements} elements differ, by at most {largest:.3e}, RMS {:.3} %",
                    100.0 * relative_rms
                )?,
            }
        }
        let mut parts = self.parts.iter();
        parts.try_for_each(|part| writeln!(f, "{part} differ"))
    }
}

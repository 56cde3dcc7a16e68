//! Differences between two models.

use crate::error::TrainerError;
use artifact::{Artifact, ArtifactError, Golden, PackedModel, Tensors};
use serde_json::{Value as Json, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::io::ErrorKind;
use std::path::Path;

/// All differences between two models.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Ids of both models.
    pub ids: [String; 2],
    /// Fields of `model.toml` that differ: name, and value in each model, if it has the field.
    pub fields: Vec<(String, [Option<String>; 2])>,
    /// Tensors that differ.
    pub tensors: Vec<TensorDifference>,
    /// Whether the integers of the packed models differ; `None` if neither model has one.
    pub packed: Option<bool>,
    /// Whether the golden windows or codes differ; `None` if neither folder has any.
    pub golden: Option<bool>,
}

/// A tensor that differs.
#[derive(Clone, Debug, PartialEq)]
pub struct TensorDifference {
    /// Name of the file and of the tensor.
    pub name: String,
    /// Kind of the difference.
    pub kind: Kind,
}

/// Difference between two tensors of the same name.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// Shape in each model; `None` where it is missing.
    Shapes([Option<Vec<usize>>; 2]),
    /// Elements differ.
    Values {
        /// Number of elements that differ.
        count: usize,
        /// Number of elements.
        of: usize,
        /// Largest difference.
        largest: f32,
        /// Root mean square of the difference, relative to that of the first model's tensor.
        relative_rms: f64,
    },
}

impl Difference {
    /// Compares the models in two folders.
    ///
    /// # Errors
    /// If a folder holds no usable model, or its golden codes cannot be read.
    pub fn read(folders: [&Path; 2]) -> Result<Self, TrainerError> {
        let read = |folder: &Path| Artifact::read(folder).map_err(TrainerError::no_model(folder));
        let [one, other] = [read(folders[0])?, read(folders[1])?];
        let golden = match [read_golden(folders[0])?, read_golden(folders[1])?] {
            [None, None] => None,
            [one, other] => Some(one != other),
        };
        Ok(Self::new(&one, &other, golden))
    }

    fn new(one: &Artifact, other: &Artifact, golden: Option<bool>) -> Self {
        let mut tensors = compare("weights", &one.weights, &other.weights);
        tensors.extend(compare("calibration", &one.calibration, &other.calibration));
        Self {
            ids: [one.id.to_string(), other.id.to_string()],
            fields: compare_fields(&fields(one), &fields(other)),
            tensors,
            packed: match (&one.packed, &other.packed) {
                (None, None) => None,
                (one, other) => Some(!have_same_integers(one.as_ref(), other.as_ref())),
            },
            golden,
        }
    }

    /// Returns whether the models are equal, golden codes included.
    pub fn is_empty(&self) -> bool {
        self.fields.is_empty()
            && self.tensors.is_empty()
            && self.packed != Some(true)
            && self.golden != Some(true)
    }

    /// Returns the differences as a JSON object.
    pub fn to_json(&self) -> Json {
        let fields = self.fields.iter();
        let tensors = self.tensors.iter().map(|tensor| match &tensor.kind {
            Kind::Shapes(shapes) => json!({ "tensor": tensor.name, "shapes": shapes }),
            Kind::Values {
                count,
                of,
                largest,
                relative_rms,
            } => json!({
                "tensor": tensor.name,
                "differ": count,
                "elements": of,
                "largest": largest,
                "relative_rms": relative_rms,
            }),
        });
        json!({
            "equal": self.is_empty(),
            "models": self.ids,
            "fields": fields.map(|(name, values)| json!({ "field": name, "values": values })).collect::<Vec<_>>(),
            "tensors": tensors.collect::<Vec<_>>(),
            "packed_differ": self.packed,
            "golden_differ": self.golden,
        })
    }
}

/// Returns whether two packed models have the same matrices and tables.
fn have_same_integers(one: Option<&PackedModel>, other: Option<&PackedModel>) -> bool {
    let (Some(one), Some(other)) = (one, other) else {
        return false;
    };
    let mut same = one.clone();
    same.description.clone_from(&other.description);
    same == *other
}

/// Reads the golden codes in a folder; `None` if it has no such file.
fn read_golden(folder: &Path) -> Result<Option<Golden>, TrainerError> {
    match Golden::read(folder) {
        Ok(golden) => Ok(Some(golden)),
        Err(ArtifactError::File { source, .. }) if source.kind() == ErrorKind::NotFound => Ok(None),
        Err(source) => Err(TrainerError::no_model(folder)(source)),
    }
}

/// Returns the fields of a description as text, by their names with dots.
fn fields(artifact: &Artifact) -> BTreeMap<String, String> {
    let mut fields = BTreeMap::new();
    // A description always has a form as JSON: its keys are texts and its numbers finite.
    if let Ok(Json::Object(description)) = serde_json::to_value(&artifact.description) {
        for (name, value) in description {
            flatten(&name, &value, &mut fields);
        }
    }
    let packed = artifact.packed.as_ref();
    if let Some(Ok(packed)) = packed.map(|packed| serde_json::to_value(&packed.description)) {
        flatten("packed", &packed, &mut fields);
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
) -> Vec<(String, [Option<String>; 2])> {
    let names: BTreeSet<&String> = one.keys().chain(other.keys()).collect();
    let values = |name: &String| [one.get(name).cloned(), other.get(name).cloned()];
    names
        .into_iter()
        .map(|name| (name.clone(), values(name)))
        .filter(|(_, [one, other])| one != other)
        .collect()
}

fn compare(file: &str, one: &Tensors, other: &Tensors) -> Vec<TensorDifference> {
    let shapes = |tensors: &Tensors| -> BTreeMap<String, Vec<usize>> {
        let shapes = tensors.shapes();
        shapes
            .map(|(name, shape)| (name.to_owned(), shape.to_vec()))
            .collect()
    };
    let (ones, others) = (shapes(one), shapes(other));
    let names: BTreeSet<&String> = ones.keys().chain(others.keys()).collect();
    let kind = |name: &String| {
        let shapes = [ones.get(name).cloned(), others.get(name).cloned()];
        match &shapes {
            [Some(shape), Some(same)] if shape == same => values(
                one.tensor(name, shape).ok()?,
                other.tensor(name, shape).ok()?,
            ),
            _ => Some(Kind::Shapes(shapes)),
        }
    };
    names
        .into_iter()
        .filter_map(|name| {
            Some(TensorDifference {
                name: format!("{file}: {name}"),
                kind: kind(name)?,
            })
        })
        .collect()
}

/// Returns how elements differ; `None` if they are equal.
fn values(one: &[f32], other: &[f32]) -> Option<Kind> {
    let differences = || {
        let pairs = one.iter().zip(other);
        pairs.map(|(one, other)| (one - other).abs())
    };
    let count = differences().filter(|difference| *difference > 0.0).count();
    let energy = |values: &mut dyn Iterator<Item = f32>| -> f64 {
        values.map(|value| f64::from(value).powi(2)).sum()
    };
    (count > 0).then(|| Kind::Values {
        count,
        of: one.len(),
        largest: differences().fold(0.0, f32::max),
        relative_rms: (energy(&mut differences()) / energy(&mut one.iter().copied())).sqrt(),
    })
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [one, other] = &self.ids;
        if self.is_empty() {
            return writeln!(f, "the models are equal: {one}");
        }
        writeln!(f, "{one} -> {other}")?;
        for (name, [one, other]) in &self.fields {
            let text = |value: &Option<String>| value.clone().unwrap_or_else(|| "-".to_owned());
            writeln!(f, "{name}: {} -> {}", text(one), text(other))?;
        }
        for TensorDifference { name, kind } in &self.tensors {
            match kind {
                Kind::Shapes([one, other]) => {
                    let text = |shape: &Option<Vec<usize>>| {
                        let lengths = shape.iter().flatten().map(usize::to_string);
                        let lengths = lengths.collect::<Vec<_>>().join(" x ");
                        shape.as_ref().map_or("-".to_owned(), |_| lengths)
                    };
                    writeln!(f, "{name}: {} -> {}", text(one), text(other))?;
                }
                Kind::Values {
                    count,
                    of,
                    largest,
                    relative_rms,
                } => writeln!(
                    f,
                    "{name}: {count} of {of} elements differ, by at most {largest:.3e}, RMS {:.3} %",
                    100.0 * relative_rms
                )?,
            }
        }
        if self.packed == Some(true) {
            writeln!(f, "packed models differ")?;
        }
        match self.golden {
            Some(true) => writeln!(f, "golden codes differ"),
            _ => Ok(()),
        }
    }
}

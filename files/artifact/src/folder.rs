//! A trained model, read from its folder, and written to it.

use crate::description::Description;
use crate::error::ArtifactError;
use crate::golden::GOLDEN;
use crate::model_id::ModelId;
use crate::packed::{PACKED_DESCRIPTION, PACKED_TENSORS, PackedModel, check_packed};
use crate::shapes::INPUT_RANGE;
use crate::substitution::{self, SubstitutionTable};
use crate::tensors::{CALIBRATION, PCA, Tensors, WEIGHTS};
use crate::validation;
use std::fmt::Write as _;
use std::io::ErrorKind;
use std::path::Path;

/// Name of the file that holds the model's description.
pub(crate) const DESCRIPTION: &str = "model.toml";

/// Names of the two files of a packed model, and the trainer command that writes both.
const PACKED: Pair = ([PACKED_DESCRIPTION, PACKED_TENSORS], "packed");
/// Names of the two files of a table of substitutions, and the trainer command that writes both.
const SUBSTITUTION: Pair = ([substitution::DESCRIPTION, substitution::TENSORS], "substitution");

/// Names of two files, of which a model has both or none, and the trainer command that writes both.
type Pair = ([&'static str; 2], &'static str);

/// Factor by which the int8 range of input and activations exceeds the range measured in
/// calibration. This margin is useful because clipping costs far more accuracy than coarse
/// resolution.
pub const HEAD_ROOM: f64 = 1.25;

/// A trained model: a network (weights and their calibration), a packed model, or both, with their
/// description.
///
/// Every constructor checks the parts: all tensors of the mode have the right shapes, all numbers
/// are finite, and the montage fits the grid. A model of mode `packed` has no network, and so no
/// weights.
#[derive(Clone, Debug, PartialEq)]
pub struct Artifact {
    /// Everything that training decided except the weights.
    pub description: Description,
    /// Weights of encoder and decoder as f32; empty in mode `packed`.
    pub weights: Tensors,
    /// Ranges measured in calibration, f32; model-gen derives the int8 scales from them.
    pub calibration: Tensors,
    /// Model of the packed code for the same montage and hop, if there is one; mode `packed` needs
    /// it.
    pub packed: Option<PackedModel>,
    /// Table with which a device predicts bad electrodes from the others, if there is one.
    pub substitution: Option<SubstitutionTable>,
    /// Hash over the files of all the parts above, which identifies the model.
    pub id: ModelId,
}

impl Artifact {
    /// Creates a model with a network from its parts. Its id is the hash of the files that
    /// [`Artifact::write`] would write.
    ///
    /// # Errors
    /// If the parts are not a valid model.
    pub fn new(
        description: Description,
        weights: Tensors,
        calibration: Tensors,
    ) -> Result<Self, ArtifactError> {
        Self::from_parts(description, weights, calibration, None)
    }

    /// Creates a model of mode `packed`, which has no network. `largest_uv` is the largest
    /// magnitude in the training data, microvolts. The id is the hash of the files that
    /// [`Artifact::write`] would write.
    ///
    /// # Errors
    /// If the parts are not a valid model.
    pub fn without_network(
        description: Description,
        largest_uv: f32,
        packed: PackedModel,
    ) -> Result<Self, ArtifactError> {
        let mut calibration = Tensors::for_calibration();
        calibration.insert(INPUT_RANGE, &[1], vec![largest_uv]);
        Self::from_parts(description, Tensors::for_weights(), calibration, Some(packed))
    }

    fn from_parts(
        description: Description,
        weights: Tensors,
        calibration: Tensors,
        packed: Option<PackedModel>,
    ) -> Result<Self, ArtifactError> {
        let artifact = Self {
            description,
            weights,
            calibration,
            packed,
            substitution: None,
            id: ModelId([0; 8]),
        };
        artifact.identified()
    }

    /// Checks the parts, and sets the id to the hash of their files.
    fn identified(mut self) -> Result<Self, ArtifactError> {
        self.check()?;
        self.id = ModelId::from_files(&self.to_files()?);
        Ok(self)
    }

    /// Returns the model with its packed model replaced by `packed`, or removed if `packed` is
    /// `None`. The new id is the hash of the files that [`Artifact::write`] would write.
    ///
    /// # Errors
    /// If the packed model does not fit the montage and the hop, or the model is left without any
    /// code.
    pub fn with_packed(mut self, packed: Option<PackedModel>) -> Result<Self, ArtifactError> {
        self.packed = packed;
        self.identified()
    }

    /// Returns the model with its table of substitutions replaced by `substitution`, or removed if
    /// `substitution` is `None`. The new id is the hash of the files that [`Artifact::write`] would
    /// write.
    ///
    /// # Errors
    /// If the table does not fit the montage, or a number is outside its range.
    pub fn with_substitution(
        mut self,
        substitution: Option<SubstitutionTable>,
    ) -> Result<Self, ArtifactError> {
        self.substitution = substitution;
        self.identified()
    }

    /// Names of the files that the model id covers, in the order in which they are hashed. Not
    /// every model has all of them.
    pub const FILES: [&str; 7] = [
        DESCRIPTION,
        WEIGHTS,
        CALIBRATION,
        PACKED_DESCRIPTION,
        PACKED_TENSORS,
        substitution::DESCRIPTION,
        substitution::TENSORS,
    ];

    /// Reads a model from its folder.
    ///
    /// # Errors
    /// If a file cannot be read or the files are not a valid model.
    pub fn read(folder: &Path) -> Result<Self, ArtifactError> {
        let mut files = Vec::new();
        for name in Self::FILES {
            let path = folder.join(name);
            match std::fs::read(&path) {
                Err(error) if error.kind() == ErrorKind::NotFound => {}
                read => files.push((name, read.map_err(ArtifactError::file(&path))?)),
            }
        }
        let files: Vec<_> = files.iter().map(|(name, file)| (*name, &**file)).collect();
        Self::from_files(&files).map_err(|error| error.in_folder(folder))
    }

    /// Parses a model from the names and contents of its files, for programs that embed them. Files
    /// with other names, and weights in mode `packed`, are ignored.
    ///
    /// # Errors
    /// If the contents are not a valid model.
    pub fn from_files(files: &[(&str, &[u8])]) -> Result<Self, ArtifactError> {
        let find = |name| files.iter().find(|(known, _)| *known == name);
        let find = |name| find(name).map(|(_, contents)| *contents);
        let require = |name| {
            let missing = || ArtifactError::file(Path::new(name))(ErrorKind::NotFound.into());
            find(name).ok_or_else(missing)
        };
        let both = |([toml, tensors], command): Pair| match [toml, tensors].map(find) {
            [None, None] => Ok(None),
            [Some(text), Some(bytes)] => Ok(Some((text, bytes))),
            [text, _] => {
                let (missing, other) =
                    if text.is_some() { (tensors, toml) } else { (toml, tensors) };
                let missing = missing.into();
                Err(ArtifactError::Half { missing, other, command })
            }
        };
        let description = parse_description(require(DESCRIPTION)?)?;
        let has_network = description.mode.has_network();
        let weights = if has_network {
            Tensors::from_bytes(WEIGHTS, require(WEIGHTS)?)?
        } else {
            Tensors::for_weights()
        };
        let calibration = Tensors::from_bytes(CALIBRATION, require(CALIBRATION)?)?;
        let packed =
            both(PACKED)?.map(|(toml, tensors)| PackedModel::parse(toml, tensors, &description));
        let substitution = both(SUBSTITUTION)?
            .map(|(toml, tensors)| SubstitutionTable::parse(toml, tensors, &description));
        let hashed = Self::FILES.into_iter().filter(|&name| has_network || name != WEIGHTS);
        let hashed: Vec<_> = hashed.filter_map(|name| Some((name, find(name)?))).collect();
        let artifact = Self {
            weights,
            calibration,
            packed: packed.transpose()?,
            substitution: substitution.transpose()?,
            id: ModelId::from_files(&hashed),
            description,
        };
        artifact.check()?;
        Ok(artifact)
    }

    /// Writes the files that the model id covers into a folder, which is created if necessary, and
    /// returns the id of the written files. Removes files of an earlier model that this model does
    /// not have. The returned id equals `self.id`, unless a part was changed after the model was
    /// created, or the model was read from a hand-written `model.toml`.
    ///
    /// # Errors
    /// If the parts are not a valid model or a file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<ModelId, ArtifactError> {
        self.check()?;
        let files = self.to_files()?;
        std::fs::create_dir_all(folder).map_err(ArtifactError::file(folder))?;
        for (name, content) in &files {
            let path = folder.join(name);
            std::fs::write(&path, content).map_err(ArtifactError::file(&path))?;
        }
        if self.packed.is_none() {
            remove(folder, &PACKED.0)?;
        }
        if self.substitution.is_none() {
            remove(folder, &SUBSTITUTION.0)?;
        }
        if !self.description.mode.has_network() {
            remove(folder, &[WEIGHTS, GOLDEN, PCA])?;
        }
        Ok(ModelId::from_files(&files))
    }

    /// Returns the id of the model without its packed model and table of substitutions: the hash of
    /// the remaining files that [`Artifact::write`] would write. Models with the same network id
    /// have the same network, scalp grid, montage and filters.
    ///
    /// # Errors
    /// If a part cannot be written as a file.
    pub fn network_id(&self) -> Result<ModelId, ArtifactError> {
        Ok(ModelId::from_files(&self.network_files()?))
    }

    /// Returns the size in microvolts of one level of the encoder's int8 input, whose zero point is
    /// 0.
    ///
    /// # Errors
    /// If the calibration has no `input.max_abs`; impossible after [`Artifact::read`].
    pub fn input_scale_uv(&self) -> Result<f64, ArtifactError> {
        Ok(f64::from(self.largest_input_uv()?) * HEAD_ROOM / 127.0)
    }

    /// Returns the largest magnitude of the training data, microvolts, from which the scale of the
    /// encoder's input is derived.
    ///
    /// # Errors
    /// If the calibration has no `input.max_abs`; impossible after [`Artifact::read`].
    pub fn largest_input_uv(&self) -> Result<f32, ArtifactError> {
        Ok(self.calibration.tensor(INPUT_RANGE, &[1])?[0])
    }

    fn check(&self) -> Result<(), ArtifactError> {
        validation::check_description(&self.description)?;
        validation::check_weights(&self.description, &self.weights)?;
        validation::check_calibration(&self.description, &self.calibration)?;
        if let Some(substitution) = &self.substitution {
            substitution.check(&self.description)?;
        }
        match &self.packed {
            Some(packed) => check_packed(packed, &self.description),
            None if self.description.mode.has_network() => Ok(()),
            None => Err(ArtifactError::Empty),
        }
    }

    /// Returns names and contents of the files that the model id covers, in the order in which the
    /// id hashes them.
    fn to_files(&self) -> Result<Vec<(&'static str, Vec<u8>)>, ArtifactError> {
        let mut files = self.network_files()?;
        if let Some(packed) = &self.packed {
            files.extend(packed.to_files()?);
        }
        if let Some(substitution) = &self.substitution {
            files.extend(substitution.to_files()?);
        }
        Ok(files)
    }

    /// Returns the files that depend neither on the packed model nor on the table of substitutions.
    fn network_files(&self) -> Result<Vec<(&'static str, Vec<u8>)>, ArtifactError> {
        // Puts each row of the grid on a line of its own, so that people can read the file.
        let description = toml::to_string(&self.description)?
            .replace("[[\"", "[\n    [\"")
            .replace("], [", "],\n    [")
            .replace("\"]]", "\"],\n]");
        let mut files = vec![(DESCRIPTION, description.into_bytes())];
        if self.description.mode.has_network() {
            files.push((WEIGHTS, self.weights.to_bytes()?));
        }
        files.push((CALIBRATION, self.calibration.to_bytes()?));
        Ok(files)
    }
}

/// Parses and checks the contents of `model.toml`.
fn parse_description(model_toml: &[u8]) -> Result<Description, ArtifactError> {
    let description = toml::from_slice(model_toml).map_err(ArtifactError::toml(DESCRIPTION))?;
    validation::check_description(&description)?;
    Ok(description)
}

/// Removes the named files that exist in the folder.
fn remove(folder: &Path, names: &[&str]) -> Result<(), ArtifactError> {
    for name in names {
        let path = folder.join(name);
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            removed => removed.map_err(ArtifactError::file(&path))?,
        }
    }
    Ok(())
}

/// Returns a Rust expression of type `&[(&str, &[u8])]` that embeds the files of the model in
/// `folder`, for build scripts. The program passes the value to [`Artifact::from_files`]. A
/// relative `folder` is relative to the source file that contains the expression.
pub fn embedding(folder: &Path) -> String {
    let mut list = String::from("&[\n");
    for name in Artifact::FILES {
        let path = folder.join(name);
        if path.exists() {
            let path = path.display().to_string();
            // Writing to a String cannot fail.
            let _ = writeln!(list, "    ({name:?}, include_bytes!({path:?})),");
        }
    }
    list + "]\n"
}

#[cfg(test)]
mod tests;

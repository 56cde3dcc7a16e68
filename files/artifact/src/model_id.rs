//! The id of a model: a hash over the files of its artifact.

use sha2::{Digest, Sha256};
use std::fmt;

/// Identifies a model. Every frame carries this id, and the bridge decodes only frames that carry
/// the id of the model it has loaded.
///
/// The id is the first 8 bytes of a SHA-256 over the files in
/// [`Artifact::FILES`](crate::Artifact::FILES), in this order, skipping files that the model lacks.
/// For each file, the hash covers the name, the length as little-endian u64, and the contents.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ModelId(pub [u8; 8]);

impl ModelId {
    /// Hashes the names and contents of the files, in the order documented at [`ModelId`].
    pub(crate) fn from_files(files: &[(&str, impl AsRef<[u8]>)]) -> Self {
        let mut hash = Sha256::new();
        for (name, bytes) in files {
            let bytes = bytes.as_ref();
            hash.update(name.as_bytes());
            hash.update((bytes.len() as u64).to_le_bytes());
            hash.update(bytes);
        }
        let digest = hash.finalize();
        let mut id = [0; 8];
        id.copy_from_slice(&digest[..8]);
        Self(id)
    }
}

impl fmt::Display for ModelId {
    /// Writes the id as 16 lower-case hexadecimal digits.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_id_is_the_start_of_the_documented_hash() {
        let id = ModelId::from_files(&[("a", "xy"), ("b", ""), ("c", "z")]);
        // The expected id is the first 8 bytes of what this prints in python3:
        // hashlib.sha256(b"a"+pack("<Q",2)+b"xy"+b"b"+pack("<Q",0)+b"c"+pack("<Q",1)+b"z")
        assert_eq!(id.to_string(), "301a42a801ffdce3");
    }
}

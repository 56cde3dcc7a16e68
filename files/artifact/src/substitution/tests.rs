//! Tests that a table reads back from its files unchanged, and that invalid tables are refused.

use super::*;
use crate::folder::Artifact;
use crate::testing;

/// Returns a model with a table that `change` has altered. In the table, each electrode predicts
/// the next one.
fn with(change: impl Fn(&mut SubstitutionTable)) -> Result<Artifact, ArtifactError> {
    let mut table = SubstitutionTable {
        description: SubstitutionDescription { format: 1, ..SubstitutionDescription::default() },
        weights: vec![0; 61 * 61],
        innovation: (1..=61).collect(),
    };
    for electrode in 1..61 {
        table.weights[electrode * 61 + electrode - 1] = if electrode == 1 { -127 } else { 127 };
    }
    change(&mut table);
    testing::pca().with_substitution(Some(table))
}

#[test]
fn a_table_reads_back_with_the_same_id_which_covers_it() {
    let folder = tempfile::tempdir().unwrap();
    let (plain, artifact) = (testing::pca(), with(|_| ()).unwrap());
    assert_ne!(artifact.id, plain.id);
    assert_eq!(artifact.write(folder.path()).unwrap(), artifact.id);
    assert_eq!(Artifact::read(folder.path()).unwrap(), artifact);
    assert_ne!(with(|table| table.weights[1] = 1).unwrap().id, artifact.id);
    // Removing the table removes its files, and the id becomes the hash of the other files.
    let without = artifact.clone().with_substitution(None).unwrap();
    assert_eq!(without.write(folder.path()).unwrap(), plain.id);
    assert_eq!(Artifact::read(folder.path()).unwrap(), plain);

    artifact.write(folder.path()).unwrap();
    std::fs::remove_file(folder.path().join(DESCRIPTION)).unwrap();
    let error = Artifact::read(folder.path()).unwrap_err().to_string();
    for part in [DESCRIPTION, "is missing", TENSORS, "trainer substitution"] {
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn a_table_out_of_range_or_of_another_montage_is_refused_by_name() {
    type Change = fn(&mut SubstitutionTable);
    let cases: [(Change, &str); 8] = [
        (|t| t.weights[7] = -128, "weights, element 7: the weight is -128"),
        (|t| t.weights[62] = 1, "weights, element 62: the electrode predicts itself"),
        (
            |t| t.weights[125..142].fill(127),
            "weights, element 122: the magnitudes of the row's weights sum to more than 2,047",
        ),
        (|t| t.innovation[3] = 0, "innovation, element 3: it is not in 1..=2^26"),
        (|t| t.innovation[60] = (1 << 26) + 1, "innovation, element 60: it is not"),
        (|t| t.weights.truncate(60 * 60), "weights has shape [3600], expected [61, 61]"),
        (|t| t.innovation.push(1), "innovation has shape [62], expected [61]"),
        (|t| t.description.format = 2, "format is 2, but must be 1"),
    ];
    for (change, expected) in cases {
        let error = with(change).unwrap_err().to_string();
        assert!(error.starts_with("substitution."), "{error}");
        assert!(error.contains(expected), "{error}");
    }
    with(|table| table.innovation[3] = 1 << 26).unwrap();
}

//! Errors in reading recordings and fitting a packed model to them.

/// Reason why a recording cannot be used, or why no packed model can be fitted.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what each variant and its fields mean")]
pub enum FitError {
    /// A block cannot have `count` coefficients. `most` is the largest possible number; 0 if a
    /// block has fewer than 16 values.
    #[error(
        "a block cannot have {count} coefficients: they are a multiple of 16, and at most {most} \
         with this montage and hop"
    )]
    Coefficients { count: usize, most: usize },
    /// A code cannot have more numbers than a window has values.
    #[error(
        "codes of {numbers} numbers are no linear map of windows of {values} values; fit the packed model alone"
    )]
    Numbers { numbers: usize, values: usize },
    #[error("cannot read the recording {0}")]
    Recording(String, #[source] recordings::RecordingError),
    #[error("the recording {0} does not fit the montage")]
    Montage(String, #[source] recordings::MontageMapError),
    #[error(
        "the training recordings are 0 in all electrodes; check the physical unit in the files"
    )]
    Silent,
    #[error(
        "{0} has no signal at any electrode: the unit in the file is wrong, or no electrode was connected; \
         leave the recording out"
    )]
    SilentRecording(String),
    /// The filters cannot be realised for this mains frequency, Hz.
    #[error("the filters for {0} Hz mains cannot be realised")]
    Filter(u32, #[source] model_gen::FilterError),
    #[error("the decimation cannot be realised")]
    Resampler(#[source] model_gen::FilterError),
    #[error("the model cannot be turned into integers")]
    Filters(#[from] model_gen::ModelGenError),
    #[error("what was fitted is no valid model")]
    Artifact(#[from] artifact::ArtifactError),
}

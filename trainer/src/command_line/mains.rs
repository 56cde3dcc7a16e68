//! The argument `--mains`.

/// Parses a mains frequency, Hz.
pub(super) fn mains_hz(text: &str) -> Result<u32, String> {
    match text {
        "50" => Ok(50),
        "60" => Ok(60),
        _ => Err("mains are 50 or 60 Hz, for which the filters exist".to_owned()),
    }
}

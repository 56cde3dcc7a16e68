//! Fields of comma-separated values.

/// Returns a text as a field (RFC 4180): in quotation marks if it holds one, a comma, a semicolon or a line
/// break.
pub fn field(text: &str) -> String {
    if text.contains(['"', ',', ';', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::field;

    #[test]
    fn texts_with_separators_are_quoted() {
        for (text, written) in [
            ("T1", "T1"),
            ("a,b", "\"a,b\""),
            ("say \"go\"", "\"say \"\"go\"\"\""),
        ] {
            assert_eq!(field(text), written);
        }
    }
}

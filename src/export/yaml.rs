//! The scalars of the YAML writers: numbers and strings that YAML 1.1 and 1.2 readers take for the
//! same.

/// A float that is never read as an integer or as text: with a point, without an exponent.
pub(super) fn number(value: f64) -> String {
    // Null would not be a number, and `.inf` is not read by all; neither occurs in a checked set.
    let value = if value.is_finite() { value + 0.0 } else { 0.0 };
    let text = value.to_string();
    if text.contains('.') { text } else { format!("{text}.0") }
}

/// A quoted string: JSON strings are YAML strings.
pub(super) fn string(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scalars_are_what_they_look_like() {
        assert_eq!(
            [1.0, -0.0, 1e-7, -2.5, 1e21].map(number),
            ["1.0", "0.0", "0.0000001", "-2.5", "1000000000000000000000.0"]
        );
        assert_eq!(string("a: \"b\"\n#"), r#""a: \"b\"\n#""#);
    }
}

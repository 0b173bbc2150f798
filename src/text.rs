//! Text from files as it may be shown: a name can hold characters that move a terminal's cursor,
//! reverse the order of what follows, or end an element of a page.

use std::borrow::Cow;
use std::fmt::Write;

/// Whether a character is written by its number: control characters, line and paragraph ends, and
/// those that change the direction of the text around them.
fn hidden(sign: char) -> bool {
    sign.is_control()
        || matches!(
            sign,
            '\u{200b}'..='\u{200f}'
                | '\u{2028}'..='\u{202e}'
                | '\u{2060}'..='\u{2069}'
                | '\u{feff}'
                | '\u{fff9}'..='\u{fffb}'
        )
}

/// `text` on one line with every hidden character by its number: `\n`, `\u{1b}`.
pub fn shown(text: &str) -> Cow<'_, str> {
    replaced(text, hidden)
}

/// As [`shown`], but with line ends and tabs as they are: for text of ours that quotes names.
pub fn shown_lines(text: &str) -> Cow<'_, str> {
    replaced(text, |sign| hidden(sign) && sign != '\n' && sign != '\t')
}

fn replaced(text: &str, hidden: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.contains(&hidden) {
        return Cow::Borrowed(text);
    }
    let mut plain = String::with_capacity(text.len() + 8);
    for sign in text.chars() {
        match sign {
            _ if !hidden(sign) => plain.push(sign),
            '\n' => plain.push_str("\\n"),
            '\r' => plain.push_str("\\r"),
            '\t' => plain.push_str("\\t"),
            // Writing to a string cannot fail.
            _ => _ = write!(plain, "\\u{{{:x}}}", u32::from(sign)),
        }
    }
    Cow::Owned(plain)
}

/// A number of things, each of which is `one`: `1 grip`, `2 grips`.
pub fn counted(count: u64, one: &str) -> String {
    format!("{count} {one}{}", if count == 1 { "" } else { "s" })
}

/// What TOML's reader says of a value of another shape, with what to write instead: of `own` the
/// advice whose words the message holds, else that for any file of ours.
pub(crate) fn with_shape(message: &str, own: &[(&str, &str)]) -> String {
    const ANY: [(&str, &str); 4] = [
        ("expected an array of length 2", "give two texts with units, e.g. [\"0mm\", \"85mm\"]"),
        (
            "expected an array of length 3",
            "give three texts with units, e.g. [\"40mm\", \"20mm\", \"8mm\"]",
        ),
        ("expected a string", "give a text with its unit, e.g. \"12mm\""),
        ("expected f64", "give a plain number, without unit and quotes, e.g. 0.5"),
    ];
    let advice = own.iter().chain(&ANY).find(|(words, _)| message.contains(words));
    advice.map_or(message.to_owned(), |(_, advice)| format!("{message}: {advice}"))
}

/// `text` for an element or a quoted attribute of SVG, XML or HTML.
pub fn markup(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for sign in shown(text).chars() {
        match sign {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            _ => escaped.push(sign),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_moves_a_cursor_or_turns_text_is_shown_by_its_number() {
        assert_eq!(shown("\u{1b}]0;owned\u{7}"), "\\u{1b}]0;owned\\u{7}");
        assert_eq!(shown("a\u{202e}b\nc\td\u{9b}"), "a\\u{202e}b\\nc\\td\\u{9b}");
        assert_eq!(shown_lines("a\n\tb\u{1b}"), "a\n\tb\\u{1b}");
        assert!(matches!(shown("Gr\u{fc}\u{df}e, \u{2264} 5 \u{b5}m"), Cow::Borrowed(_)));
    }

    #[test]
    fn one_is_no_plural() {
        assert_eq!([counted(0, "grip"), counted(1, "grip")], ["0 grips", "1 grip"]);
    }

    #[test]
    fn markup_ends_no_element_and_no_attribute() {
        assert_eq!(markup("</a>\"'&\u{1b}"), "&lt;/a&gt;&quot;&#39;&amp;\\u{1b}");
    }
}

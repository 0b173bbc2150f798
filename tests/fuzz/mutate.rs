//! Small damage to a good input.

use crate::support::random::Random;

/// Words that readers trip over.
const WORDS: [&str; 22] = [
    "nan",
    "inf",
    "-inf",
    "1e308",
    "-1e308",
    "1e400",
    "1e160",
    "1e-320",
    "-0",
    "0",
    "-1",
    "1o",
    "1,5",
    "4294967295",
    "4294967296",
    "18446744073709551615",
    "9999999999",
    "\"",
    "[",
    "{",
    "\u{1b}[2J",
    "",
];

/// One to four changes.
pub(crate) fn mutated(mut bytes: Vec<u8>, random: &mut Random) -> Vec<u8> {
    for _ in 0..=random.below(4) {
        change(&mut bytes, random);
    }
    bytes
}

fn change(bytes: &mut Vec<u8>, random: &mut Random) {
    let length = bytes.len();
    let at = random.below(length);
    let end = (at + 1 + random.below(40)).min(length);
    match random.below(8) {
        0 if length > 0 => bytes[at] ^= 1 << random.below(8),
        1 if length > 0 => bytes[at] = random.below(256) as u8,
        2 => bytes.truncate(at),
        3 => drop(bytes.drain(at.min(end)..end)),
        4 => {
            let piece = bytes[at.min(end)..end].to_vec();
            let to = random.below(length + 1);
            bytes.splice(to..to, piece);
        }
        5 if length >= 4 => {
            // A count or an index of a binary form.
            let at = random.below(length - 3);
            let value = [0, 1, 0x7fff_ffff, 0xffff_ffff_u32, 0x7fc0_0000, 0x7f80_0000];
            bytes[at..at + 4].copy_from_slice(&value[random.below(value.len())].to_le_bytes());
        }
        _ => {
            // A word of a text: the next one from here.
            let part = |byte: &u8| byte.is_ascii_alphanumeric() || b".+-".contains(byte);
            let Some(start) = bytes[at..].iter().position(part).map(|k| at + k) else { return };
            let stop =
                bytes[start..].iter().position(|byte| !part(byte)).map_or(length, |k| start + k);
            let word = WORDS[random.below(WORDS.len())];
            bytes.splice(start..stop, word.bytes());
        }
    }
}

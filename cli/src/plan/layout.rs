//! Tables that fit where they are shown.

use comfy_table::{CellAlignment, Table, presets};
use gripfast::results::RankedGrip;

/// Width where nobody watches: the same for every machine.
const WIDTH: usize = 120;
/// Narrowest that a column of words is cut to.
const LEAST_WORDS: usize = 14;

/// A column of a table of grips.
pub(super) struct Column<'a> {
    /// Its heading.
    pub(super) name: &'static str,
    /// Whether its cells stand to the right, as numbers do.
    pub(super) right: bool,
    /// Columns with the largest number go first where not all fit; 0 stays.
    pub(super) spare: u8,
    /// The text of a grip.
    pub(super) text: Box<dyn Fn(&RankedGrip) -> String + 'a>,
}

/// A column of numbers.
pub(super) fn number<'a>(
    name: &'static str,
    spare: u8,
    text: impl Fn(&RankedGrip) -> String + 'a,
) -> Column<'a> {
    Column { name, right: true, spare, text: Box::new(text) }
}

/// A column of words.
pub(super) fn words<'a>(
    name: &'static str,
    spare: u8,
    text: impl Fn(&RankedGrip) -> String + 'a,
) -> Column<'a> {
    Column { name, right: false, spare, text: Box::new(text) }
}

/// Signs in a line of standard output: the terminal's, or 120.
pub(super) fn width() -> usize {
    crate::terminal::width().unwrap_or(WIDTH)
}

/// The table of the grips in at most `width` signs, and the names of the columns left out for it.
pub(super) fn grid(
    columns: &[Column<'_>],
    shown: &[&RankedGrip],
    width: usize,
) -> (Table, Vec<&'static str>) {
    let rows: Vec<Vec<String>> = shown.iter().map(|grip| row(columns, grip)).collect();
    table(columns, &rows, width)
}

/// The texts of a grip.
pub(super) fn row(columns: &[Column<'_>], grip: &RankedGrip) -> Vec<String> {
    columns.iter().map(|column| (column.text)(grip)).collect()
}

/// As [`grid`], with the texts of each row.
pub(super) fn table(
    columns: &[Column<'_>],
    rows: &[Vec<String>],
    width: usize,
) -> (Table, Vec<&'static str>) {
    let texts = |index: usize| rows.iter().map(|row| row[index].clone()).collect();
    let mut cells: Vec<(&Column<'_>, Vec<String>)> =
        columns.iter().enumerate().map(|(index, column)| (column, texts(index))).collect();
    let left_out = fit(&mut cells, width);
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    table.set_header(cells.iter().map(|(column, _)| column.name));
    for row in 0..rows.len() {
        table.add_row(cells.iter().map(|(_, texts)| texts[row].clone()));
    }
    for (index, _) in cells.iter().enumerate().filter(|(_, (column, _))| column.right) {
        if let Some(column) = table.column_mut(index) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    (table, left_out)
}

/// Drops and shortens columns until a line has no more than `width` signs; the names of those that
/// went.
fn fit(cells: &mut Vec<(&Column<'_>, Vec<String>)>, width: usize) -> Vec<&'static str> {
    let signs = |text: &str| text.chars().count();
    let wide = |(column, texts): &(&Column<'_>, Vec<String>)| {
        texts.iter().map(|text| signs(text)).max().unwrap_or(0).max(signs(column.name))
    };
    let mut left_out = Vec::new();
    loop {
        // A blank on either side of each column.
        let total: usize = cells.iter().map(|column| wide(column) + 2).sum();
        let spare = cells.iter().enumerate().max_by_key(|(index, column)| (column.0.spare, *index));
        let Some((index, _)) = spare.filter(|(_, column)| total > width && column.0.spare > 0)
        else {
            break;
        };
        let (column, texts) = &mut cells[index];
        let own = texts.iter().map(|text| signs(text)).max().unwrap_or(0);
        let room = (own + width).saturating_sub(total);
        if !column.right && room >= LEAST_WORDS.max(signs(column.name)) {
            for text in texts.iter_mut().filter(|text| signs(text) > room) {
                *text = text.chars().take(room - 1).chain(['…']).collect();
            }
            break;
        }
        left_out.push(column.name);
        cells.remove(index);
    }
    left_out.reverse();
    left_out
}

/// Text in lines of at most `width` signs, broken between words.
pub(super) fn wrapped(text: &str, width: usize) -> String {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines.join("\n")
}

/// A number to three digits, all of those before the point.
pub(super) fn significant(value: f64) -> String {
    let digits = (2.0 - value.abs().max(1e-9).log10().floor()).clamp(0.0, 9.0);
    format!("{value:.*}", digits as usize)
}

/// Numbers in brackets.
pub(super) fn tuple(numbers: &[f64], places: usize) -> String {
    let text: Vec<String> = numbers.iter().map(|x| fixed(*x, places)).collect();
    format!("({})", text.join(", "))
}

/// A number to so many places, without negative zeros.
pub(super) fn fixed(number: f64, places: usize) -> String {
    let text = format!("{number:.places$}");
    let zero = text.trim_start_matches('-').chars().all(|sign| sign == '0' || sign == '.');
    text[usize::from(zero && text.starts_with('-'))..].to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(widths: &[(usize, bool, u8)], width: usize) -> (Vec<usize>, usize) {
        let columns: Vec<Column<'_>> = widths
            .iter()
            .map(|&(_, right, spare)| Column {
                name: "n",
                right,
                spare,
                text: Box::new(|_: &RankedGrip| String::new()),
            })
            .collect();
        let mut cells: Vec<_> = columns
            .iter()
            .zip(widths)
            .map(|(column, (signs, ..))| (column, vec!["x".repeat(*signs), "y".to_owned()]))
            .collect();
        let left_out = fit(&mut cells, width).len();
        let kept = cells.iter().map(|(_, texts)| texts[0].chars().count()).collect();
        (kept, left_out)
    }

    #[test]
    fn columns_that_can_be_spared_go_first_and_words_are_cut() {
        let columns = [(4, true, 0), (40, false, 1), (10, true, 3), (8, true, 2)];
        assert_eq!(shown(&columns, 70), (vec![4, 40, 10, 8], 0));
        assert_eq!(shown(&columns, 69), (vec![4, 40, 8], 1));
        assert_eq!(shown(&columns, 50), (vec![4, 40], 2));
        assert_eq!(shown(&columns, 40), (vec![4, 32], 2), "the words are cut");
        assert_eq!(shown(&columns, 20), (vec![4], 3), "but not to nothing");
        assert_eq!(shown(&columns, 1), (vec![4], 3), "what cannot be spared stays");
    }

    #[test]
    fn text_is_broken_between_words() {
        assert_eq!(wrapped("aa bb cc", 5), "aa bb\ncc");
        assert_eq!(wrapped("aaaaaaa b", 3), "aaaaaaa\nb");
    }
}

//! Text in the cells of CSV files, written so that no spreadsheet takes it for a formula and no reader for something else, and read
//! back unchanged.
//!
//! Spreadsheets compute text that begins like a formula, and formulas can call programs and remote addresses. Annotators choose
//! the names of classes. So text that begins like a formula gets an apostrophe in front, which marks text in spreadsheets. So does
//! text that begins like JSON, and a word that other tools write where they have no value.

use crate::csv_file::is_no_value;
use std::borrow::Cow;

const MARK: char = '\'';
/// The first characters of formulas, some also in their wide forms, and the mark itself: so text that begins with the mark reads
/// back unchanged.
const FORMULAS: [char; 11] = ['=', '+', '-', '@', '\t', '\r', '＝', '＋', '－', '＠', MARK];
/// The first characters of JSON.
const JSON: [char; 2] = ['{', '['];

/// Whether a spreadsheet takes the text for a formula.
pub fn is_formula(text: &str) -> bool {
    text.starts_with(FORMULAS)
}

fn is_marked(text: &str) -> bool {
    is_formula(text) || text.starts_with(JSON) || (is_no_value(text) && !text.is_empty())
}

pub fn to_cell(text: &str) -> Cow<'_, str> {
    match is_marked(text) {
        true => format!("{MARK}{text}").into(),
        false => text.into(),
    }
}

/// The text of a cell. An apostrophe that marks no formula is part of the text.
pub fn of_cell(cell: &str) -> &str {
    match cell.strip_prefix(MARK) {
        Some(text) if is_marked(text) => text,
        _ => cell,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn formulas_are_marked_and_nothing_else_is_changed() {
        for (text, cell) in [
            (
                "=HYPERLINK(\"http://evil.example\")",
                "'=HYPERLINK(\"http://evil.example\")",
            ),
            ("+1", "'+1"),
            ("-2+3+cmd|' /C calc'!A0", "'-2+3+cmd|' /C calc'!A0"),
            ("@SUM(1)", "'@SUM(1)"),
            ("＝1", "'＝1"),
            ("'=1", "''=1"),
            ("None", "'None"),
            ("[1]", "'[1]"),
            ("ring", "ring"),
            ("a=b", "a=b"),
            ("", ""),
        ] {
            assert_eq!(to_cell(text), cell);
            assert_eq!(of_cell(cell), text);
        }
        // A person may write an apostrophe without a formula.
        assert_eq!(of_cell("'tis"), "'tis");
    }

    proptest! {
        #[test]
        fn what_is_written_reads_back(text in "['=+@-]{0,3}\\PC{0,4}|'?(nan|null|NA|none)") {
            let cell = to_cell(&text);
            prop_assert_eq!(of_cell(&cell), text.as_str());
            prop_assert!(!cell.starts_with(['=', '+', '-', '@']));
        }
    }
}

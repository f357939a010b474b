//! Text in the cells of CSV files, written so that no spreadsheet takes it for a formula, and read back unchanged.
//!
//! Spreadsheets compute text that begins like a formula, and formulas can call programs and remote addresses. Annotators choose
//! the names of classes. So text that begins like a formula gets an apostrophe in front, which marks text in spreadsheets.

use std::borrow::Cow;

const MARK: char = '\'';
/// Text that begins with one of these characters gets the mark: the first characters of formulas, some also in their wide forms,
/// and the mark itself. So text that begins with the mark reads back unchanged.
const MARKED: [char; 11] = ['=', '+', '-', '@', '\t', '\r', '＝', '＋', '－', '＠', MARK];

pub fn to_cell(text: &str) -> Cow<'_, str> {
    match text.starts_with(MARKED) {
        true => format!("{MARK}{text}").into(),
        false => text.into(),
    }
}

/// The text of a cell. An apostrophe that marks no formula is part of the text.
pub fn of_cell(cell: &str) -> &str {
    match cell.strip_prefix(MARK) {
        Some(text) if text.starts_with(MARKED) => text,
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
        fn what_is_written_reads_back(text in "['=+@-]{0,3}\\PC{0,4}") {
            let cell = to_cell(&text);
            prop_assert_eq!(of_cell(&cell), text.as_str());
            prop_assert!(!cell.starts_with(['=', '+', '-', '@']));
        }
    }
}

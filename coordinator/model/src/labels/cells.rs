//! Text in the cells of CSV files: written so that no spreadsheet takes it for a formula, and read back as it was.
//!
//! A spreadsheet computes what begins like a formula, which may call programs and addresses elsewhere; and names come from
//! whoever labels. Such a text gets an apostrophe in front, by which spreadsheets know text.

use std::borrow::Cow;

const MARK: char = '\'';
/// First characters of formulas, in some spreadsheets also in their wide forms; and the mark itself, so that a text that begins
/// with one is not changed by reading it.
const MARKED: [char; 11] = ['=', '+', '-', '@', '\t', '\r', '＝', '＋', '－', '＠', MARK];

pub fn to_cell(text: &str) -> Cow<'_, str> {
    match text.starts_with(MARKED) {
        true => format!("{MARK}{text}").into(),
        false => text.into(),
    }
}

/// The text of a cell, whoever wrote it.
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
        // As people write it.
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

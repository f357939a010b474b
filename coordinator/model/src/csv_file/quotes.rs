//! Finds unclosed quotes in CSV. A CSV reader takes an unclosed quote and the rows after it for part of a cell.

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Place {
    #[default]
    CellBegins,
    Plain,
    Quoted,
    /// After a quote in a quoted cell: the cell ends here, unless another quote follows.
    Closed,
}

/// Follows the quotes of a text whose lines end with LF.
#[derive(Debug)]
pub(super) struct Quotes {
    place: Place,
    line: u64,
    /// Line of the last quote that began a cell.
    opened: u64,
    unclosed: Option<u64>,
}

impl Default for Quotes {
    fn default() -> Self {
        Self {
            place: Place::default(),
            line: 1,
            opened: 1,
            unclosed: None,
        }
    }
}

impl Quotes {
    /// Follows the next byte.
    pub(super) fn push(&mut self, byte: u8) {
        self.place = match (self.place, byte) {
            (Place::CellBegins, b'"') => {
                self.opened = self.line;
                Place::Quoted
            }
            (Place::Quoted, b'"') => Place::Closed,
            (Place::Closed, b'"') | (Place::Quoted, _) => Place::Quoted,
            (_, b',' | b'\n') => Place::CellBegins,
            (Place::Closed, b' ' | b'\t') => Place::Closed,
            (Place::Closed, _) => {
                self.unclosed.get_or_insert(self.opened);
                Place::Plain
            }
            (Place::CellBegins | Place::Plain, _) => Place::Plain,
        };
        self.line += u64::from(byte == b'\n');
    }

    /// Notes the end of the text.
    pub(super) fn end(&mut self) {
        if self.is_open() {
            self.unclosed.get_or_insert(self.opened);
        }
    }

    pub(super) fn is_open(&self) -> bool {
        self.place == Place::Quoted
    }

    /// The line, from 1, of the first cell that begins with a quote and does not end with a quote.
    pub(super) const fn unclosed(&self) -> Option<u64> {
        self.unclosed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quote_that_is_not_closed_is_found() {
        let check = |text: &str, line| {
            let mut quotes = Quotes::default();
            text.bytes().for_each(|byte| quotes.push(byte));
            quotes.end();
            assert_eq!(quotes.unclosed(), line, "{text:?}");
        };
        check("id,class\n1,\"ring\"\n", None);
        check("id,class\n1,\"a \"\"big\"\" ring\"\n", None);
        check("\"id\",\"class\"\n1,\"two\nlines\"\n", None);
        check("id,class\n1,ring \"big\"\n", None);
        check("id,class\n1,\"ring\" \n", None);
        check("id,class\n1,\"\"\n2,\"\"", None);
        check("id,class\n1,\"ring", Some(2));
        check("id,class\n1,ring\n2,\"clump\n3,ring\n", Some(3));
        check("id,class\n1,\"two\nlines\"\n2,\"clump\n", Some(4));
        check("id,class\n1,\"ring\"\"", Some(2));
        // The quote that should open the cell of line 3 closes the cell of line 2.
        check("id,class,note\n1,ring,\"so\n2,clump,\"so\"\n", Some(2));
    }
}

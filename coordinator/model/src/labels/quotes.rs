//! Finds unclosed quotes in CSV. A CSV reader takes an unclosed quote and the rows after it for part of a cell.

/// The bytes with which some programs mark text as UTF-8.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

enum Place {
    CellBegins,
    Plain,
    Quoted,
    /// After a quote in a quoted cell: the cell ends here, unless another quote follows.
    Closed,
}

/// The line, from 1, of the first cell that begins with a quote and does not end with a quote.
pub(super) fn unclosed(text: &[u8]) -> Option<usize> {
    let text = text.strip_prefix(BYTE_ORDER_MARK).unwrap_or(text);
    let (mut place, mut line, mut opened) = (Place::CellBegins, 1, 1);
    for &byte in text {
        place = match (place, byte) {
            (Place::CellBegins, b'"') => {
                opened = line;
                Place::Quoted
            }
            (Place::Quoted, b'"') => Place::Closed,
            (Place::Closed, b'"') | (Place::Quoted, _) => Place::Quoted,
            (_, b',' | b'\r' | b'\n') => Place::CellBegins,
            (Place::Closed, b' ' | b'\t') => Place::Closed,
            (Place::Closed, _) => return Some(opened),
            (Place::CellBegins | Place::Plain, _) => Place::Plain,
        };
        line += usize::from(byte == b'\n');
    }
    matches!(place, Place::Quoted).then_some(opened)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quote_that_is_not_closed_is_found() {
        let check = |text: &str, line| assert_eq!(unclosed(text.as_bytes()), line, "{text:?}");
        check("id,class\n1,\"ring\"\n", None);
        check("id,class\n1,\"a \"\"big\"\" ring\"\n", None);
        check("\"id\",\"class\"\r\n1,\"two\r\nlines\"\r\n", None);
        check("id,class\n1,ring \"big\"\n", None);
        check("id,class\n1,\"ring\" \n", None);
        check("id,class\n1,\"\"\n2,\"\"", None);
        check("id,class\n1,\"ring", Some(2));
        check("id,class\n1,ring\n2,\"clump\n3,ring\n", Some(3));
        check("id,class\n1,\"two\nlines\"\n2,\"clump\n", Some(4));
        check("id,class\n1,\"ring\"\"", Some(2));
        // The quote that should open the cell of line 3 closes the cell of line 2.
        check("id,class,note\n1,ring,\"so\n2,clump,\"so\"\n", Some(2));
        check("\u{feff}\"id", Some(1));
    }
}

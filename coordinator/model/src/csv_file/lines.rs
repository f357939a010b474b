//! The bytes of a text, with one kind of line ends.

use super::quotes::Quotes;
use std::io::{self, Read};

/// Maximum length of a line, and of a cell in quotes, in bytes: a reader keeps a whole row in memory.
const MAX_ROW_BYTES: u64 = 1 << 20;
const BUFFER_BYTES: usize = 64 << 10;
/// The bytes with which some programs mark text as UTF-8.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Reads a text whose lines end with LF, CR LF or CR as a text whose lines all end with LF, including the last line. Looks for
/// quotes that are not closed.
pub(super) struct Lines<R> {
    reader: R,
    buffer: Vec<u8>,
    /// The bytes of the buffer that are still to be read.
    rest: std::ops::Range<usize>,
    quotes: Quotes,
    is_after_return: bool,
    /// Whether the last byte ended a line.
    is_line_ended: bool,
    /// Bytes since the last end of a line outside quotes.
    row_bytes: u64,
    has_begun: bool,
    is_utf16: bool,
}

impl<R: Read> Lines<R> {
    pub(super) fn new(reader: R) -> Self {
        Self {
            reader,
            buffer: vec![0; BUFFER_BYTES],
            rest: 0..0,
            quotes: Quotes::default(),
            is_after_return: false,
            is_line_ended: true,
            row_bytes: 0,
            has_begun: false,
            is_utf16: false,
        }
    }

    /// The line, from 1, of the first cell so far that begins with a quote and does not end with one.
    pub(super) const fn unclosed(&self) -> Option<u64> {
        self.quotes.unclosed()
    }

    /// Whether the text begins as UTF-16 does.
    pub(super) const fn is_utf16(&self) -> bool {
        self.is_utf16
    }

    /// The next byte of the file.
    fn byte(&mut self) -> io::Result<Option<u8>> {
        if self.rest.is_empty() {
            let mut len = self.reader.read(&mut self.buffer)?;
            let mut begin = 0;
            if !self.has_begun {
                // A pipe may give the first bytes one by one.
                while len <= BYTE_ORDER_MARK.len() {
                    match self.reader.read(&mut self.buffer[len..])? {
                        0 => break,
                        more => len += more,
                    }
                }
                self.has_begun = true;
                let text = &self.buffer[..len];
                self.is_utf16 =
                    text.starts_with(b"\xff\xfe") || text.starts_with(b"\xfe\xff") || text.contains(&0);
                begin = match text.starts_with(BYTE_ORDER_MARK) {
                    true => BYTE_ORDER_MARK.len(),
                    false => 0,
                };
            }
            self.rest = begin..len;
        }
        Ok(self.rest.next().map(|place| self.buffer[place]))
    }

    /// The next byte, after the ends of lines are unified.
    fn unified(&mut self) -> io::Result<Option<u8>> {
        loop {
            let Some(byte) = self.byte()? else {
                self.quotes.end();
                let is_whole = std::mem::replace(&mut self.is_line_ended, true);
                return Ok((!is_whole).then_some(b'\n'));
            };
            let is_after_return = std::mem::replace(&mut self.is_after_return, byte == b'\r');
            let byte = match byte {
                b'\n' if is_after_return => continue,
                b'\r' => b'\n',
                other => other,
            };
            self.quotes.push(byte);
            self.is_line_ended = byte == b'\n';
            self.row_bytes = match self.is_line_ended && !self.quotes.is_open() {
                true => 0,
                false => self.row_bytes + 1,
            };
            if self.row_bytes > MAX_ROW_BYTES {
                self.quotes.end();
                let reason = format!("a row has more than {MAX_ROW_BYTES} bytes");
                return Err(io::Error::new(io::ErrorKind::InvalidData, reason));
            }
            return Ok(Some(byte));
        }
    }
}

impl<R: Read> Read for Lines<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let mut len = 0;
        while len < bytes.len() {
            match self.unified()? {
                Some(byte) => bytes[len] = byte,
                None => break,
            }
            len += 1;
        }
        Ok(len)
    }
}

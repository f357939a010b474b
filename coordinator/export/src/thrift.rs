//! Thrift's compact encoding, in which Parquet writes its footer and the headers of its pages: as much as it takes to know sizes.
//!
//! The library allocates as much as a footer says that there is. So everything is walked through here before, with nothing kept.

/// Most structures within structures.
const MAX_DEPTH: u32 = 16;

const BOOL_TRUE: u8 = 1;
const BOOL_FALSE: u8 = 2;
const I8: u8 = 3;
const I16: u8 = 4;
const I32: u8 = 5;
const I64: u8 = 6;
const DOUBLE: u8 = 7;
const BINARY: u8 = 8;
const LIST: u8 = 9;
const SET: u8 = 10;
const MAP: u8 = 11;
const STRUCT: u8 = 12;
const UUID: u8 = 13;

/// Bytes that are read from the beginning on. `None`, wherever it is returned, says that they end early or are no Thrift.
#[derive(Debug)]
pub(crate) struct Thrift<'a> {
    bytes: &'a [u8],
}

/// The beginning of a field of a structure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Field {
    pub(crate) id: i64,
    kind: u8,
}

impl<'a> Thrift<'a> {
    pub(crate) const fn new(bytes: &'a [u8]) -> Self {
        Self { bytes }
    }

    /// Bytes that were not read yet.
    pub(crate) const fn left(&self) -> usize {
        self.bytes.len()
    }

    /// The next field of a structure whose last one was `last`; nothing at its end.
    pub(crate) fn field(&mut self, last: i64) -> Option<Option<Field>> {
        let first = self.byte()?;
        let kind = first & 0x0f;
        if kind == 0 {
            return Some(None);
        }
        let id = match i64::from(first >> 4) {
            0 => self.number()?,
            step => last.checked_add(step)?,
        };
        Some(Some(Field { id, kind }))
    }

    /// The value of a field of a whole number.
    pub(crate) fn whole(&mut self, field: Field) -> Option<i64> {
        match field.kind {
            I16 | I32 | I64 => self.number(),
            _ => None,
        }
    }

    /// Whether a field is a structure, whose fields come next.
    pub(crate) const fn is_struct(field: Field) -> bool {
        field.kind == STRUCT
    }

    /// Passes over the value of a field.
    pub(crate) fn skip(&mut self, field: Field) -> Option<()> {
        match field.kind {
            BOOL_TRUE | BOOL_FALSE => Some(()),
            kind => self.skip_value(kind, MAX_DEPTH),
        }
    }

    /// Passes over a structure.
    pub(crate) fn skip_struct(&mut self) -> Option<()> {
        self.skip_value(STRUCT, MAX_DEPTH)
    }

    fn skip_value(&mut self, kind: u8, depth: u32) -> Option<()> {
        let within = depth.checked_sub(1)?;
        match kind {
            BOOL_TRUE | BOOL_FALSE | I8 => self.take(1),
            I16 | I32 | I64 => self.number().map(drop),
            DOUBLE => self.take(8),
            UUID => self.take(16),
            BINARY => {
                let length = self.varint()?;
                self.take(length)
            }
            LIST | SET => {
                let first = self.byte()?;
                let count = match first >> 4 {
                    15 => self.varint()?,
                    count => count.into(),
                };
                // Each element is a byte at least.
                if count > self.left() as u64 {
                    return None;
                }
                (0..count).try_for_each(|_| self.skip_value(first & 0x0f, within))
            }
            MAP => {
                let count = self.varint()?;
                if count == 0 {
                    return Some(());
                }
                if count > self.left() as u64 {
                    return None;
                }
                let kinds = self.byte()?;
                (0..count).try_for_each(|_| {
                    self.skip_value(kinds >> 4, within)?;
                    self.skip_value(kinds & 0x0f, within)
                })
            }
            STRUCT => {
                let mut last = 0;
                while let Some(field) = self.field(last)? {
                    match field.kind {
                        BOOL_TRUE | BOOL_FALSE => {}
                        kind => self.skip_value(kind, within)?,
                    }
                    last = field.id;
                }
                Some(())
            }
            _ => None,
        }
    }

    fn take(&mut self, count: impl TryInto<usize>) -> Option<()> {
        self.bytes = self.bytes.get(count.try_into().ok()?..)?;
        Some(())
    }

    fn byte(&mut self) -> Option<u8> {
        let (&first, rest) = self.bytes.split_first()?;
        self.bytes = rest;
        Some(first)
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0_u64;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f).checked_shl(shift)?;
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    /// A number whose lowest bit is its sign.
    fn number(&mut self) -> Option<i64> {
        let zigzag = self.varint()?;
        Some((zigzag >> 1).cast_signed() ^ -(zigzag & 1).cast_signed())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_read_and_passed_over() {
        // 1: i32 = -3, 2: list of two binaries, 4: true, 20: struct {1: double}.
        let mut bytes = vec![0x15, 0x05, 0x19, 0x28, 1, b'a', 0, 0x21, 0x0c, 40, 0x17];
        bytes.extend([0; 8]);
        bytes.extend([0, 0]);
        let mut thrift = Thrift::new(&bytes);
        let first = thrift.field(0).unwrap().unwrap();
        assert_eq!((first.id, thrift.whole(first)), (1, Some(-3)));
        let mut last = first.id;
        let mut ids = Vec::new();
        while let Some(field) = thrift.field(last).unwrap() {
            ids.push((field.id, Thrift::is_struct(field)));
            thrift.skip(field).unwrap();
            last = field.id;
        }
        assert_eq!(ids, [(2, false), (4, false), (20, true)]);
        assert_eq!(thrift.left(), 0);
        assert_eq!(Thrift::new(&bytes).skip_struct(), Some(()));
        for end in 0..bytes.len() {
            assert_eq!(Thrift::new(&bytes[..end]).skip_struct(), None, "{end}");
        }
    }

    #[test]
    fn a_list_that_says_it_is_longer_than_the_bytes_and_endless_nesting_are_refused() {
        // 1: list of 2^28 - 1 structures.
        let long = [0x19, 0xfc, 0xff, 0xff, 0xff, 0x7f, 0, 0];
        assert_eq!(Thrift::new(&long).skip_struct(), None);
        assert_eq!(Thrift::new(&[0x1c; 4096]).skip_struct(), None);
    }
}

//! The sections of a campaign file, from the descriptors of their messages and the comments on the fields.

/// A table of a campaign file.
#[derive(Debug, Clone, Copy)]
pub struct Section {
    /// Name of the table, such as `world.start`; empty for the top of the file.
    pub path: &'static str,
    pub fields: &'static [Field],
}

/// A field of a campaign file.
#[derive(Debug, Clone, Copy)]
pub struct Field {
    pub name: &'static str,
    /// The field's comment in the contract.
    pub explanation: &'static str,
}

impl Section {
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.fields.iter().any(|field| field.name == name)
    }
}

/// Every section of a campaign file. The top of the file is first.
pub const SECTIONS: &[Section] = include!(concat!(env!("OUT_DIR"), "/sections.rs"));

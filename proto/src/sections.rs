//! The sections of a campaign file that are messages, from the descriptors and their comments.

use std::borrow::Cow;

/// A table of a campaign file.
#[derive(Debug, Clone)]
pub struct Section {
    /// Name of the table, such as `world.start`; empty for the top of the file.
    pub path: &'static str,
    pub fields: Cow<'static, [Field]>,
}

/// A field of a campaign file.
#[derive(Debug, Clone, Copy)]
pub struct Field {
    pub name: &'static str,
    /// The field's comment in the contract; `None` for fields of trainings, which the contract does not define.
    pub explanation: Option<&'static str>,
}

impl Section {
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.fields.iter().any(|field| field.name == name)
    }
}

/// Sections that are messages, from the contract's descriptors.
pub const MESSAGES: &[Section] = include!(concat!(env!("OUT_DIR"), "/sections.rs"));

//! The parameters of a node.

use super::{AttributeProto, attribute_proto::AttributeType};

/// A node's parameters by name.
#[derive(Clone, Copy)]
pub(super) struct Attributes<'a>(pub(super) &'a [AttributeProto]);

impl<'a> Attributes<'a> {
    pub(super) fn find(self, name: &str) -> Option<&'a AttributeProto> {
        self.0.iter().find(|attribute| attribute.name == name)
    }

    pub(super) fn integer(self, name: &str, default: i64) -> Result<i64, String> {
        match self.find(name) {
            None => Ok(default),
            Some(attribute) if attribute.r#type() == AttributeType::Int => Ok(attribute.i),
            Some(_) => Err(format!("{name} is not a whole number")),
        }
    }

    /// The attribute `name` as a number of things, at least 1.
    pub(super) fn count(self, name: &str, default: i64) -> Result<usize, String> {
        let count = self.integer(name, default)?;
        let refused = || format!("{name} = {count}: must be at least 1");
        usize::try_from(count)
            .ok()
            .filter(|&count| count > 0)
            .ok_or_else(refused)
    }

    /// The attribute `name` as a list of whole numbers; `None` if the node has no such attribute.
    pub(super) fn integers(self, name: &str) -> Result<Option<&'a [i64]>, String> {
        match self.find(name) {
            None => Ok(None),
            Some(attribute) if attribute.r#type() == AttributeType::Ints => Ok(Some(&attribute.ints)),
            Some(_) => Err(format!("{name} is not a list of whole numbers")),
        }
    }

    /// The attribute `name` as text; `default` if the node has no such attribute.
    pub(super) fn text(self, name: &str, default: &'static str) -> &'a str {
        self.find(name)
            .map_or(default, |attribute| str::from_utf8(&attribute.s).unwrap_or("?"))
    }

    /// The attribute `name` as `N` sizes from `least` to 1000; `None` if the node has no such attribute.
    pub(super) fn list<const N: usize>(self, name: &str, least: usize) -> Result<Option<[usize; N]>, String> {
        let Some(attribute) = self.find(name) else {
            return Ok(None);
        };
        let sizes = attribute
            .ints
            .iter()
            .map(|&size| usize::try_from(size).unwrap_or(usize::MAX));
        let sizes: Vec<usize> = sizes.filter(|size| (least..=1000).contains(size)).collect();
        let refused = || {
            format!(
                "{name} = {:?}: must be {N} numbers from {least} to 1000",
                attribute.ints
            )
        };
        if sizes.len() != attribute.ints.len() || attribute.r#type() != AttributeType::Ints {
            return Err(refused());
        }
        <[usize; N]>::try_from(sizes).map(Some).map_err(|_| refused())
    }

    pub(super) fn pair(self, name: &str) -> Result<Option<[usize; 2]>, String> {
        self.list(name, 1)
    }
}

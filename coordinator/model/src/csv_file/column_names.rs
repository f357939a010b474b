//! Names of columns in the files of other tools.

use murmuration_swarm::{Invalid, text::quoted};
use std::{collections::BTreeMap, str::FromStr};

/// The names that columns have in a file, by our names for these columns. As text: `frame=frame_idx,x=body.x`. Columns without an
/// entry have our names.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ColumnNames(BTreeMap<String, String>);

impl ColumnNames {
    pub(super) fn in_file<'a>(&'a self, column: &'a str) -> &'a str {
        self.0.get(column).map_or(column, String::as_str)
    }

    /// Whether a column has a name of its own in the file.
    pub(super) fn names(&self, column: &str) -> bool {
        self.0.contains_key(column)
    }

    /// Our names of the columns that have another name in the file.
    pub(super) fn named(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }

    /// Checks that only columns among `known` are named.
    ///
    /// # Errors
    /// If another column is named.
    pub fn expect(&self, known: &[&str]) -> Result<(), Invalid> {
        match self.0.keys().find(|column| !known.contains(&column.as_str())) {
            None => Ok(()),
            Some(other) => {
                let allowed = format!("names for columns among {}", known.join(", "));
                Err(Invalid::new("columns", quoted(other), allowed))
            }
        }
    }
}

impl FromStr for ColumnNames {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        let mut names = BTreeMap::new();
        for pair in text.split(',') {
            let both = pair
                .split_once('=')
                .map(|(ours, theirs)| [ours.trim(), theirs.trim()]);
            let Some([ours, theirs]) = both.filter(|names| names.iter().all(|name| !name.is_empty())) else {
                let allowed = "pairs of our name and the file's name, such as frame=frame_idx,robot=track";
                return Err(Invalid::new("columns", quoted(text), allowed));
            };
            let twice = |name: &str| {
                let allowed = format!("pairs with {} once", quoted(name));
                Invalid::new("columns", quoted(text), allowed)
            };
            if names.values().any(|known| known == theirs) {
                return Err(twice(theirs));
            }
            if names.insert(ours.to_owned(), theirs.to_owned()).is_some() {
                return Err(twice(ours));
            }
        }
        Ok(Self(names))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_have_other_names() {
        let names: ColumnNames = "frame=frame_idx, x = body.x,y=a=b".parse().unwrap();
        assert_eq!(
            ["frame", "x", "y", "robot"].map(|ours| names.in_file(ours)),
            ["frame_idx", "body.x", "a=b", "robot"]
        );
        assert_eq!(names.expect(&["frame", "x", "y"]), Ok(()));
        assert_eq!(
            names.expect(&["frame", "x"]).unwrap_err().to_string(),
            "columns = \"y\": must be names for columns among frame, x"
        );
        for bad in ["", "frame", "frame=", "=x", "x=a,x=b", "x=a,"] {
            assert!(bad.parse::<ColumnNames>().is_err(), "{bad}");
        }
    }
}

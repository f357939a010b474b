//! The choice of a taxonomy's behaviours.

use crate::{BehaviourSpace, Invalid, text};

/// How the behaviours that a taxonomy shows are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Choice {
    /// Behaviours that cover the behaviour space: each is the farthest from all behaviours before it. If the embedder learned
    /// from labels, a behaviour of each labelled class comes first.
    Coverage,
    /// The k-medoids of all individuals, which lie where there are many individuals, as in the paper.
    Medoids,
    /// The medoids of each class, if the embedder learned from labels.
    ByClass,
}

impl Choice {
    const ALL: [Self; 3] = [Self::Coverage, Self::Medoids, Self::ByClass];

    /// Name of the choice in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Coverage => "coverage",
            Self::Medoids => "medoids",
            Self::ByClass => "by-class",
        }
    }

    /// The choice of this name; without a name, the default.
    ///
    /// # Errors
    /// If no choice has this name, or if the choice needs an embedding that learns from labels and `space` has none.
    pub(crate) fn from_field(name: Option<&str>, space: BehaviourSpace) -> Result<Self, Invalid> {
        let Some(name) = name else {
            return Ok(Self::Coverage);
        };
        let has = |choice: &Self| *choice != Self::ByClass || space.embeds();
        let found = Self::ALL
            .into_iter()
            .filter(has)
            .find(|choice| choice.name() == name);
        found.ok_or_else(|| {
            let names = Self::ALL.iter().filter(|choice| has(choice));
            let names: Vec<_> = names.map(|choice| format!("\"{}\"", choice.name())).collect();
            let mut allowed = names.join(" or ");
            if name == Self::ByClass.name() {
                allowed += &format!(": the space \"{space}\" has no embedding that learns from labels");
            }
            Invalid::new("choose", text::quoted(name), allowed)
        })
    }
}

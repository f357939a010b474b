//! Changes of classes, and their reversal.
//!
//! Changes are reverted one by one, the newest first. So a reversal finds the classes as the reverted change left them, except
//! for classes that later answers have created.

use super::{super::classes::Replaced, Action, Annotator, Change, Label, Labels, NumberedAnswer, Refusal};
use std::sync::Arc;

/// A change of classes that was not reverted.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ClassChange {
    change: Change,
    replaced: Replaced,
    /// Entries of answers that are set aside until this deletion of a class is reverted: answers that stood at the deletion, and
    /// answers that a later undo would have restored.
    set_aside: Vec<u64>,
}

impl Labels {
    /// Applies a change of a class, as the next entry of the log.
    pub(super) fn change_classes(&mut self, change: &Change) -> Result<(), Refusal> {
        let classes = Arc::make_mut(&mut self.classes);
        let replaced = match &change.action {
            Action::Create { class } => classes.make(class),
            Action::Rename { class, to } => classes.rename(class, to)?,
            Action::Merge { class, into } => classes.merge(class, into)?,
            Action::Colour { class, colour } => classes.colour(class, *colour)?,
            Action::Shortcut { class, shortcut } => classes.shortcut(class, *shortcut)?,
            Action::Delete { class } => classes.delete(class)?,
            Action::Answer { .. } | Action::Undo | Action::Withdraw { .. } | Action::Revert { .. } => {
                return Ok(());
            }
        };
        let set_aside = match replaced {
            Replaced::Deleted(_) => self.set_aside_deleted(),
            _ => Vec::new(),
        };
        let change = ClassChange {
            change: change.clone(),
            replaced,
            set_aside,
        };
        Arc::make_mut(&mut self.class_changes).insert(self.entries, change);
        Ok(())
    }

    /// Reverts the newest change of classes, which must be the change of `entry`.
    pub(super) fn revert(&mut self, entry: u64) -> Result<(), Refusal> {
        let changes = Arc::make_mut(&mut self.class_changes);
        let newest = changes.last_entry();
        let newest = newest.filter(|newest| *newest.key() == entry);
        let reverted = newest.ok_or(Refusal::NotNewestChange(entry))?.remove();
        Arc::make_mut(&mut self.classes).restore(reverted.replaced);
        for answer in reverted.set_aside {
            // A later answer of the same annotator takes precedence.
            let given = self.given.get(&answer);
            let answered = given.and_then(|given| self.standing_of(given.index, &given.annotator));
            if answered.is_none() {
                self.stand(answer);
            }
        }
        Ok(())
    }

    /// Sets aside the answers that name a deleted class, and returns their entries.
    fn set_aside_deleted(&mut self) -> Vec<u64> {
        let standing = self.own.values().flatten().copied();
        let set_aside: Vec<u64> = standing.filter(|entry| self.is_of_deleted(*entry)).collect();
        for &entry in &set_aside {
            self.fall(entry);
        }
        set_aside
    }

    /// Whether an answer names a class that was deleted.
    pub(super) fn is_of_deleted(&self, entry: u64) -> bool {
        self.given.get(&entry).is_some_and(|given| match given.answer {
            NumberedAnswer::Class(class) => self.classes.is_deleted(class),
            NumberedAnswer::NotSure | NumberedAnswer::Skip => false,
        })
    }

    /// Sets aside the answer of this entry, which an undo would restore, until the deletion of its class is reverted.
    pub(super) fn set_aside_restored(&mut self, entry: u64) {
        let Some(NumberedAnswer::Class(class)) = self.given.get(&entry).map(|given| given.answer) else {
            return;
        };
        let deletion = Replaced::Deleted(self.classes.today(class));
        let mut changes = Arc::make_mut(&mut self.class_changes).values_mut();
        if let Some(change) = changes.find(|change| change.replaced == deletion) {
            change.set_aside.push(entry);
        }
    }

    /// Forgets an annotator's set-aside answer about an individual, and returns its entry, if any.
    pub(super) fn forget_set_aside(&mut self, index: u64, annotator: &Annotator) -> Option<u64> {
        let given = &self.given;
        let is_meant = |entry: &u64| {
            given
                .get(entry)
                .is_some_and(|given| given.is_of(index, annotator))
        };
        let mut set_aside = self.class_changes.values().flat_map(|change| &change.set_aside);
        let forgotten = *set_aside.find(|entry| is_meant(entry))?;
        for change in Arc::make_mut(&mut self.class_changes).values_mut() {
            change.set_aside.retain(|entry| !is_meant(entry));
        }
        Some(forgotten)
    }

    /// The answers that stand no more because their class was deleted, and that stand again once the deletion is reverted.
    pub fn set_aside(&self) -> impl Iterator<Item = Label> {
        let entries = self.class_changes.values().flat_map(|change| &change.set_aside);
        entries.filter_map(|entry| self.given(*entry))
    }

    /// The changes of classes that were not reverted, each with its entry, the oldest first. Only the last change can be
    /// reverted.
    pub fn class_changes(&self) -> impl DoubleEndedIterator<Item = (u64, &Change)> {
        self.class_changes
            .iter()
            .map(|(entry, change)| (*entry, &change.change))
    }
}

//! The current state of a label log: its classes and its standing answers.

mod class_changes;

use super::{
    Action, Annotator, Answer, Change, ClassName, Colour, Entry, GivenClass, Label, Refusal, Shortcut,
    classes::{ClassNumber, Classes, class_numbers},
    given::given_classes,
};
use class_changes::ClassChange;
use rpds::{RedBlackTreeMapSync, RedBlackTreeSetSync};
use std::{collections::BTreeMap, fmt, sync::Arc};

/// Maximum number of classes that are compared for nearly equal names: with more classes, comparing all pairs takes seconds.
const MOST_COMPARED: usize = 200;

/// The labels of a campaign, computed from its log.
///
/// An answer *stands* until a later entry of the log replaces, undoes or withdraws it, or deletes its class. Each annotator has
/// at most one standing answer about an individual. Answers follow their class through renaming and merging. A class is present
/// while a standing answer names it, or if it was created explicitly.
///
/// A clone shares the unchanged parts, so that a reader hardly slows down labelling.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Labels {
    entries: u64,
    classes: Arc<Classes>,
    /// Every answer of the log, by entry.
    given: RedBlackTreeMapSync<u64, Given>,
    /// The entries of the standing answers, by individual and annotator. Individuals without a standing answer are not in the
    /// map.
    standing: RedBlackTreeMapSync<u64, RedBlackTreeMapSync<Annotator, u64>>,
    /// The entries of the standing answers, by annotator.
    own: RedBlackTreeMapSync<Annotator, RedBlackTreeSetSync<u64>>,
    /// Number of standing answers by the class that they named, even if that class was later merged into another.
    named: RedBlackTreeMapSync<ClassNumber, u64>,
    /// The changes of classes that were not reverted, by entry.
    class_changes: Arc<BTreeMap<u64, ClassChange>>,
}

#[derive(Debug, Clone, PartialEq)]
struct Given {
    index: u64,
    annotator: Annotator,
    answer: NumberedAnswer,
    time_ms: u64,
    supersedes: Option<u64>,
}

impl Given {
    /// Whether this is the annotator's answer about the individual.
    fn is_of(&self, index: u64, annotator: &Annotator) -> bool {
        self.index == index && self.annotator == *annotator
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum NumberedAnswer {
    Class(ClassNumber),
    NotSure,
    Skip,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Class {
    /// The class's name, as it was first spelled or last renamed.
    pub name: ClassName,
    /// The colour that an annotator gave the class, or else the default colour.
    pub colour: Colour,
    /// The key on the keyboard that an annotator chose for the class.
    pub shortcut: Option<Shortcut>,
    /// Number of standing answers that name the class.
    pub labels: u64,
    /// Other classes with nearly the same name, perhaps a typing error.
    pub near: Vec<ClassName>,
}

/// The log contains an entry that [`Labels`] would not have written.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("entry {0} of the label log does not follow from the entries before it")]
pub struct BrokenLog(pub u64);

impl Labels {
    /// Number of entries of the log that these labels include.
    pub const fn entries(&self) -> u64 {
        self.entries
    }

    /// Applies the entries of the log from [`Labels::entries`] on, in order.
    ///
    /// # Errors
    /// [`BrokenLog`] at the first entry that cannot follow the earlier entries. Do not use the labels after this error.
    pub fn follow(&mut self, log: Vec<Entry>) -> Result<(), BrokenLog> {
        for entry in log {
            match self.take_in(entry.change) {
                Ok(again) if (again.number, again.supersedes) == (entry.number, entry.supersedes) => {}
                _ => return Err(BrokenLog(entry.number)),
            }
        }
        Ok(())
    }

    /// Whether an action has no effect and need not be logged: it renames a class to the class's present name.
    pub fn is_idle(&self, action: &Action) -> bool {
        match action.clone().spelled() {
            Action::Rename { class, to } => {
                let number = self.classes.find(&class);
                number.is_ok_and(|number| *self.classes.name(number) == to)
            }
            _ => false,
        }
    }

    /// Applies a change, and returns its entry of the log.
    ///
    /// # Errors
    /// See [`Refusal`]; the labels are then unchanged.
    pub fn record(&mut self, change: Change) -> Result<Entry, Refusal> {
        // Only new changes need this step: the names in a log are already in the paper's spelling.
        let action = change.action.spelled();
        let change = Change { action, ..change };
        self.check(&change.action)?;
        self.take_in(change)
    }

    /// Refuses an action that does not fit the present classes.
    fn check(&self, action: &Action) -> Result<(), Refusal> {
        let classes = &self.classes;
        // A class that is not present does not block its name.
        let taken = |number: ClassNumber| match self.is_there(number) {
            true => Err(Refusal::ClassExists(classes.name(number).clone())),
            false => Ok(()),
        };
        match action {
            Action::Answer {
                answer: Answer::Class(class),
                ..
            } => classes.has_room_for(class),
            Action::Create { class } => {
                classes.has_room_for(class)?;
                classes.find(class).map_or(Ok(()), taken)
            }
            Action::Rename { class, to } => {
                let number = classes.find(class)?;
                let other = classes.find(to).ok().filter(|other| *other != number);
                other.map_or(Ok(()), taken)
            }
            Action::Merge { class, into } => match classes.find(class)? == classes.find(into)? {
                true => Err(Refusal::IntoItself(class.clone())),
                false => Ok(()),
            },
            Action::Colour { class, .. } | Action::Delete { class } | Action::Shortcut { class, .. } => {
                classes.find(class).map(drop)
            }
            Action::Answer { .. } | Action::Undo | Action::Withdraw { .. } | Action::Revert { .. } => Ok(()),
        }
    }

    /// Applies a change, whether new or from a log.
    fn take_in(&mut self, change: Change) -> Result<Entry, Refusal> {
        let supersedes = match &change.action {
            Action::Answer { index, answer } => self.answer(*index, answer, &change),
            Action::Undo => Some(self.undo(&change.annotator)?),
            Action::Withdraw { index } => Some(self.withdraw(*index, &change.annotator)?),
            Action::Revert { entry } => self.revert(*entry).map(|()| None)?,
            Action::Create { .. }
            | Action::Rename { .. }
            | Action::Merge { .. }
            | Action::Colour { .. }
            | Action::Delete { .. }
            | Action::Shortcut { .. } => self.change_classes(&change).map(|()| None)?,
        };
        let number = self.entries;
        self.entries += 1;
        Ok(Entry {
            number,
            change,
            supersedes,
        })
    }

    fn answer(&mut self, index: u64, answer: &Answer, change: &Change) -> Option<u64> {
        let answer = match answer {
            Answer::Class(class) => NumberedAnswer::Class(match self.classes.find(class) {
                Ok(number) => number,
                Err(_) => Arc::make_mut(&mut self.classes).find_or_add(class),
            }),
            Answer::NotSure => NumberedAnswer::NotSure,
            Answer::Skip => NumberedAnswer::Skip,
        };
        let supersedes = self.standing_of(index, &change.annotator);
        if let Some(former) = supersedes {
            self.fall(former);
        }
        let given = Given {
            index,
            annotator: change.annotator.clone(),
            answer,
            time_ms: change.time_ms,
            supersedes,
        };
        self.given.insert_mut(self.entries, given);
        self.stand(self.entries);
        supersedes
    }

    fn undo(&mut self, annotator: &Annotator) -> Result<u64, Refusal> {
        let undone = self
            .newest(annotator)
            .ok_or_else(|| Refusal::NothingToUndo(annotator.clone()))?;
        self.fall(undone);
        let before = self.given.get(&undone).and_then(|given| given.supersedes);
        match before {
            Some(before) if self.is_of_deleted(before) => self.set_aside_restored(before),
            Some(before) => self.stand(before),
            None => {}
        }
        Ok(undone)
    }

    fn withdraw(&mut self, index: u64, annotator: &Annotator) -> Result<u64, Refusal> {
        let withdrawn = self.standing_of(index, annotator);
        if let Some(withdrawn) = withdrawn {
            self.fall(withdrawn);
        }
        let set_aside = self.forget_set_aside(index, annotator);
        withdrawn.or(set_aside).ok_or_else(|| Refusal::NothingToWithdraw {
            annotator: annotator.clone(),
            index,
        })
    }

    /// The entry of an annotator's standing answer about an individual.
    fn standing_of(&self, index: u64, annotator: &Annotator) -> Option<u64> {
        self.standing.get(&index)?.get(annotator).copied()
    }

    /// Makes the answer of this entry stand.
    fn stand(&mut self, entry: u64) {
        let Some(given) = self.given.get(&entry) else {
            return;
        };
        let mut about = self.standing.get(&given.index).cloned().unwrap_or_default();
        about.insert_mut(given.annotator.clone(), entry);
        self.standing.insert_mut(given.index, about);
        let mut own = self.own.get(&given.annotator).cloned().unwrap_or_default();
        own.insert_mut(entry);
        self.own.insert_mut(given.annotator.clone(), own);
        if let NumberedAnswer::Class(class) = given.answer {
            let named = self.named.get(&class).copied().unwrap_or_default();
            self.named.insert_mut(class, named + 1);
        }
    }

    /// Makes the answer of this entry no longer stand.
    fn fall(&mut self, entry: u64) {
        let Some(given) = self.given.get(&entry) else {
            return;
        };
        if let Some(about) = self.standing.get_mut(&given.index) {
            about.remove_mut(&given.annotator);
            if about.is_empty() {
                self.standing.remove_mut(&given.index);
            }
        }
        if let Some(own) = self.own.get_mut(&given.annotator) {
            own.remove_mut(&entry);
        }
        if let NumberedAnswer::Class(class) = given.answer
            && let Some(named) = self.named.get_mut(&class)
        {
            *named = named.saturating_sub(1);
        }
    }

    /// The entry of an annotator's newest standing answer.
    pub fn newest(&self, annotator: &Annotator) -> Option<u64> {
        self.own.get(annotator)?.last().copied()
    }

    /// The standing answers, ordered by individual and then by annotator.
    pub fn standing(&self) -> impl Iterator<Item = Label> {
        self.standing_entries().filter_map(|entry| self.given(entry))
    }

    /// The entries of the standing answers, in the order of [`Labels::standing`].
    pub fn standing_entries(&self) -> impl Iterator<Item = u64> {
        self.standing
            .values()
            .flat_map(RedBlackTreeMapSync::values)
            .copied()
    }

    /// The answer of an entry of the log, standing or not; `None` if the entry is not an answer.
    pub fn given(&self, entry: u64) -> Option<Label> {
        let given = self.given.get(&entry)?;
        let answer = match given.answer {
            NumberedAnswer::Class(class) => Answer::Class(self.classes.name(class).clone()),
            NumberedAnswer::NotSure => Answer::NotSure,
            NumberedAnswer::Skip => Answer::Skip,
        };
        Some(Label {
            entry,
            index: given.index,
            annotator: given.annotator.clone(),
            answer,
            time_ms: given.time_ms,
        })
    }

    /// Annotators with a standing answer about an individual, ordered by name, each with whether the answer names a class.
    pub fn answered(&self, index: u64) -> impl Iterator<Item = (&Annotator, bool)> {
        let about = self.standing.get(&index).into_iter().flatten();
        about.map(|(annotator, entry)| (annotator, self.names_class(*entry)))
    }

    /// Number of individuals with a standing answer.
    pub fn individuals(&self) -> usize {
        self.standing.size()
    }

    fn names_class(&self, entry: u64) -> bool {
        self.given
            .get(&entry)
            .is_some_and(|given| matches!(given.answer, NumberedAnswer::Class(_)))
    }

    /// All annotators that ever answered, with or without a standing answer.
    pub fn annotators(&self) -> impl Iterator<Item = &Annotator> {
        self.own.keys()
    }

    /// The present classes, in the order in which they were created.
    pub fn classes(&self) -> Vec<Class> {
        let labels = self.labels_of_classes();
        let there = self
            .classes
            .iter()
            .filter_map(|(number, name, colour, shortcut)| {
                let labels = labels.get(&number).copied().unwrap_or_default();
                (labels > 0 || self.classes.is_made(number)).then(|| Class {
                    name: name.clone(),
                    colour,
                    shortcut,
                    labels,
                    near: Vec::new(),
                })
            });
        let mut there: Vec<Class> = there.collect();
        if there.len() > MOST_COMPARED {
            return there;
        }
        let keys: Vec<_> = there.iter().map(|class| class.name.key()).collect();
        for (place, key) in keys.iter().enumerate() {
            for (before, _) in keys[..place]
                .iter()
                .enumerate()
                .filter(|(_, other)| key.is_near(other))
            {
                let names = [place, before].map(|class| there[class].name.clone());
                let [name, other] = names;
                there[place].near.push(other);
                there[before].near.push(name);
            }
        }
        there
    }

    /// Number of standing answers for each class, after merging.
    fn labels_of_classes(&self) -> BTreeMap<ClassNumber, u64> {
        let mut labels: BTreeMap<ClassNumber, u64> = BTreeMap::new();
        for (class, named) in &self.named {
            *labels.entry(self.classes.today(*class)).or_default() += named;
        }
        labels
    }

    /// Whether a class is among [`Labels::classes`].
    fn is_there(&self, class: ClassNumber) -> bool {
        self.classes.is_made(class)
            || self
                .labels_of_classes()
                .get(&class)
                .is_some_and(|&labels| labels > 0)
    }

    /// The class of each individual that has a class. If annotators differ, the newest answer decides.
    pub fn by_individual(&self) -> BTreeMap<u64, ClassName> {
        let given = self.given_classes().into_iter();
        given.map(|(index, given)| (index, given.class)).collect()
    }

    /// The classes of [`Labels::by_individual`], each with whether a person gave the class.
    pub fn given_classes(&self) -> BTreeMap<u64, GivenClass> {
        given_classes(self.standing())
    }

    /// Number of individuals with a standing answer by this annotator.
    pub fn answered_by(&self, annotator: &Annotator) -> usize {
        self.own.get(annotator).map_or(0, RedBlackTreeSetSync::size)
    }

    /// Number of individuals with a standing answer by the synthetic annotator alone.
    pub fn answered_by_machine(&self) -> usize {
        let synthetic = Annotator::synthetic();
        let alone = |about: &&RedBlackTreeMapSync<_, _>| about.size() == 1 && about.contains_key(&synthetic);
        self.standing.values().filter(alone).count()
    }

    /// Individuals with a class, each with the [number](class_numbers) of its class, so that an embedder can learn from them.
    pub fn numbered_classes(&self) -> Vec<(u64, u32)> {
        let by_individual = self.by_individual();
        let numbers = class_numbers(by_individual.values().map(ClassName::as_str));
        by_individual
            .iter()
            .filter_map(|(&index, class)| Some((index, *numbers.get(class.as_str())?)))
            .collect()
    }

    /// The classes that one annotator gave, by individual.
    pub fn by(&self, annotator: &Annotator) -> BTreeMap<u64, ClassName> {
        let own = self.standing().filter(|label| label.annotator == *annotator);
        own.filter_map(|label| match label.answer {
            Answer::Class(class) => Some((label.index, class)),
            Answer::NotSure | Answer::Skip => None,
        })
        .collect()
    }

    /// The digest of [`Labels::by_individual`], which does not depend on annotators, times or superseded answers.
    pub fn digest(&self) -> LabelDigest {
        let mut hasher = blake3::Hasher::new_derive_key("murmuration labels v1");
        for (index, class) in self.by_individual() {
            hasher.update(&index.to_le_bytes());
            hasher.update(&(class.as_str().len() as u64).to_le_bytes());
            hasher.update(class.as_str().as_bytes());
        }
        LabelDigest(hasher.finalize())
    }
}

/// BLAKE3 of the standing pairs (individual, class); 64 hexadecimal digits as text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LabelDigest(blake3::Hash);

impl fmt::Display for LabelDigest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.to_hex())
    }
}

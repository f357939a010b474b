//! The classes of a campaign: names and colours that change, and merged classes.
//!
//! Changes of known classes always succeed, because a replayed log can be older than the current rules that distinguish names.
//! [`Labels::record`](super::Labels::record) refuses invalid changes first.

use super::{ClassKey, ClassName, Colour, Refusal, Shortcut};
use crate::colours;
use murmuration_swarm::Class;
use murmuration_train::labelled_pictures::LabelledPictures;
use std::collections::{BTreeMap, BTreeSet};

/// Maximum number of remaining classes, so that a file of another kind that is read by mistake ends in an error.
const MAX_CLASSES: usize = 1000;

/// Identifies a class independently of its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct ClassNumber(usize);

/// Every class ever created, in the order of creation.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Classes {
    all: Vec<Known>,
    /// The remaining classes: neither merged nor deleted.
    numbers: BTreeMap<ClassKey, ClassNumber>,
    /// Every key that a class ever had.
    ever: BTreeSet<ClassKey>,
}

#[derive(Debug, Clone, PartialEq)]
struct Known {
    name: ClassName,
    colour: Colour,
    /// Whether the class was created explicitly, not by an answer.
    made: bool,
    /// The key on the keyboard that an annotator chose for the class.
    shortcut: Option<Shortcut>,
    merged: Option<ClassNumber>,
    deleted: bool,
}

/// The state before a change of classes, which a reversal restores.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Replaced {
    /// The change had no effect.
    Nothing,
    /// The class was not created explicitly.
    Unmade(ClassNumber),
    /// The class had this name. The other class, if any, was not merged into it.
    Name(ClassNumber, ClassName, Option<ClassNumber>),
    /// The class was not merged.
    Merged(ClassNumber),
    /// The class had this colour.
    Colour(ClassNumber, Colour),
    /// The classes had these keys.
    Shortcuts(Vec<(ClassNumber, Option<Shortcut>)>),
    /// The class was not deleted.
    Deleted(ClassNumber),
}

impl Classes {
    pub(super) fn find(&self, name: &ClassName) -> Result<ClassNumber, Refusal> {
        let found = self.numbers.get(&name.key()).copied();
        found.ok_or_else(|| Refusal::NoClass(name.clone()))
    }

    /// Refuses a new class beyond the maximum; a class that exists is accepted.
    pub(super) fn has_room_for(&self, name: &ClassName) -> Result<(), Refusal> {
        if self.find(name).is_ok() || self.numbers.len() < MAX_CLASSES {
            return Ok(());
        }
        Err(Refusal::TooManyClasses(name.clone()))
    }

    /// The class with this name, which is added with the next colour of the palette if it does not exist.
    pub(super) fn find_or_add(&mut self, name: &ClassName) -> ClassNumber {
        self.find(name).unwrap_or_else(|_| {
            let number = ClassNumber(self.all.len());
            self.all.push(Known {
                name: name.clone(),
                colour: Colour::from(colours::class(number.0)),
                made: false,
                shortcut: None,
                merged: None,
                deleted: false,
            });
            self.numbers.insert(name.key(), number);
            self.ever.insert(name.key());
            number
        })
    }

    /// Creates a class explicitly.
    pub(super) fn make(&mut self, name: &ClassName) -> Replaced {
        let number = self.find_or_add(name);
        match std::mem::replace(&mut self.all[number.0].made, true) {
            true => Replaced::Nothing,
            false => Replaced::Unmade(number),
        }
    }

    /// Gives a class another name. A class that already has the name `to` is merged into the renamed class.
    pub(super) fn rename(&mut self, class: &ClassName, to: &ClassName) -> Result<Replaced, Refusal> {
        let Some(number) = self.still(class)? else {
            return Ok(Replaced::Nothing);
        };
        let absorbed = self.find(to).ok().filter(|other| *other != number);
        self.numbers.remove(&class.key());
        let former = std::mem::replace(&mut self.all[number.0].name, to.clone());
        self.claim_name(number);
        Ok(Replaced::Name(number, former, absorbed))
    }

    pub(super) fn merge(&mut self, class: &ClassName, into: &ClassName) -> Result<Replaced, Refusal> {
        if let (Some(ends), Some(goes_on)) = (self.still(class)?, self.still(into)?)
            && ends != goes_on
        {
            self.all[ends.0].merged = Some(goes_on);
            self.numbers.remove(&class.key());
            return Ok(Replaced::Merged(ends));
        }
        Ok(Replaced::Nothing)
    }

    pub(super) fn colour(&mut self, class: &ClassName, colour: Colour) -> Result<Replaced, Refusal> {
        Ok(match self.still(class)? {
            Some(number) => {
                let former = std::mem::replace(&mut self.all[number.0].colour, colour);
                Replaced::Colour(number, former)
            }
            None => Replaced::Nothing,
        })
    }

    /// Gives a class a key on the keyboard, and takes the key from any other class.
    pub(super) fn shortcut(
        &mut self,
        class: &ClassName,
        shortcut: Option<Shortcut>,
    ) -> Result<Replaced, Refusal> {
        let Some(number) = self.still(class)? else {
            return Ok(Replaced::Nothing);
        };
        let mut former = vec![(number, self.all[number.0].shortcut)];
        let others = self.all.iter_mut().enumerate().filter(|(place, known)| {
            *place != number.0 && known.goes_on() && shortcut.is_some() && known.shortcut == shortcut
        });
        for (place, known) in others {
            former.push((ClassNumber(place), known.shortcut.take()));
        }
        self.all[number.0].shortcut = shortcut;
        Ok(Replaced::Shortcuts(former))
    }

    pub(super) fn delete(&mut self, class: &ClassName) -> Result<Replaced, Refusal> {
        let Some(number) = self.still(class)? else {
            return Ok(Replaced::Nothing);
        };
        self.numbers.remove(&class.key());
        self.all[number.0].deleted = true;
        Ok(Replaced::Deleted(number))
    }

    /// Restores the state before the newest change of classes.
    pub(super) fn restore(&mut self, replaced: Replaced) {
        match replaced {
            Replaced::Nothing => {}
            Replaced::Unmade(class) => self.all[class.0].made = false,
            Replaced::Name(class, name, absorbed) => {
                let renamed = std::mem::replace(&mut self.all[class.0].name, name);
                self.numbers.remove(&renamed.key());
                self.claim_name(class);
                if let Some(other) = absorbed {
                    self.all[other.0].merged = None;
                    self.claim_name(other);
                }
            }
            Replaced::Merged(class) => {
                self.all[class.0].merged = None;
                self.claim_name(class);
            }
            Replaced::Colour(class, colour) => self.all[class.0].colour = colour,
            Replaced::Shortcuts(former) => {
                for (class, shortcut) in former {
                    self.all[class.0].shortcut = shortcut;
                }
            }
            Replaced::Deleted(class) => {
                self.all[class.0].deleted = false;
                self.claim_name(class);
            }
        }
    }

    /// Makes the name of `class` mean this class. Another class with the same name is merged into `class`: an answer can have
    /// created the other class while `class` had another name.
    fn claim_name(&mut self, class: ClassNumber) {
        let key = self.all[class.0].name.key();
        self.ever.insert(key.clone());
        if let Some(other) = self.numbers.insert(key, class)
            && other != class
        {
            self.all[other.0].merged = Some(class);
        }
    }

    /// The remaining class with this name; `None` if a class had this name but remains no more. In an old log, the name can
    /// belong to a class that was merged before, because earlier versions distinguished names differently.
    fn still(&self, name: &ClassName) -> Result<Option<ClassNumber>, Refusal> {
        match self.find(name) {
            Ok(number) => Ok(Some(number)),
            Err(_) if self.ever.contains(&name.key()) => Ok(None),
            Err(refusal) => Err(refusal),
        }
    }

    /// The class into which `class` was merged, or else `class` itself.
    pub(super) fn today(&self, mut class: ClassNumber) -> ClassNumber {
        while let Some(into) = self.all[class.0].merged {
            class = into;
        }
        class
    }

    /// The current name of a class.
    pub(super) fn name(&self, class: ClassNumber) -> &ClassName {
        &self.all[self.today(class).0].name
    }

    /// Whether the class was created explicitly.
    pub(super) fn is_made(&self, class: ClassNumber) -> bool {
        self.all[class.0].made
    }

    /// Whether the class, or the class into which it was merged, was deleted.
    pub(super) fn is_deleted(&self, class: ClassNumber) -> bool {
        self.all[self.today(class).0].deleted
    }

    /// The remaining classes, each with its name, its colour and its chosen key.
    pub(super) fn iter(&self) -> impl Iterator<Item = (ClassNumber, &ClassName, Colour, Option<Shortcut>)> {
        let all = self.all.iter().enumerate();
        all.filter(|(_, known)| known.goes_on())
            .map(|(number, known)| (ClassNumber(number), &known.name, known.colour, known.shortcut))
    }
}

impl Known {
    fn goes_on(&self) -> bool {
        self.merged.is_none() && !self.deleted
    }
}

/// The numbers of classes for trainers: [`LabelledPictures::RANDOM`] for [`Class::Random`] in any spelling, and numbers from 1
/// for the other classes, in the order of their names.
pub fn class_numbers<'a>(names: impl IntoIterator<Item = &'a str>) -> BTreeMap<&'a str, u32> {
    let (random, named): (BTreeSet<_>, BTreeSet<_>) = names
        .into_iter()
        .partition(|name| ClassKey::from(*name) == ClassKey::from(Class::Random.name()));
    let random = random.into_iter().map(|name| (name, LabelledPictures::RANDOM));
    random.chain(named.into_iter().zip(1..)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const RANDOM: &str = Class::Random.name();

    #[test]
    fn random_has_a_number_of_its_own_and_no_other_class_has_it() {
        let numbers = class_numbers(["ring", RANDOM, "clump", "ring"]);
        assert_eq!(numbers, BTreeMap::from([("clump", 1), (RANDOM, 0), ("ring", 2)]));
        assert_eq!(class_numbers(["ring"]), BTreeMap::from([("ring", 1)]));
        assert_eq!(
            class_numbers(["Random", "a"]),
            BTreeMap::from([("Random", 0), ("a", 1)])
        );
    }
}

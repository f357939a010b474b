//! The classes of a campaign: names and colours that change, and what became of those that were merged.
//!
//! What is done to classes always succeeds, as it must when a log is replayed that was written before names were told apart
//! as they are now; [`Labels::record`](super::Labels::record) refuses first what nobody should do.

use super::{ClassKey, ClassName, Colour, Refusal};
use crate::colours;
use std::collections::{BTreeMap, BTreeSet};

/// Most classes that go on, so that a file of another kind read by mistake ends as an error.
const MAX_CLASSES: usize = 1000;

/// Which class, whatever its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct ClassNumber(usize);

/// Every class that there ever was, in the order of creation.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Classes {
    all: Vec<Known>,
    /// Those that go on.
    numbers: BTreeMap<ClassKey, ClassNumber>,
    /// Every key that ever was one of a class.
    ever: BTreeSet<ClassKey>,
}

#[derive(Debug, Clone, PartialEq)]
struct Known {
    name: ClassName,
    colour: Colour,
    /// Whether somebody made it for its own sake, not by an answer.
    made: bool,
    /// The class that it was merged into.
    merged: Option<ClassNumber>,
}

impl Classes {
    /// The class that a name means.
    pub(super) fn find(&self, name: &ClassName) -> Result<ClassNumber, Refusal> {
        let found = self.numbers.get(&name.key()).copied();
        found.ok_or_else(|| Refusal::NoClass(name.clone()))
    }

    /// Whether a class of this name may be added, or is there.
    pub(super) fn has_room_for(&self, name: &ClassName) -> Result<(), Refusal> {
        if self.find(name).is_ok() || self.numbers.len() < MAX_CLASSES {
            return Ok(());
        }
        Err(Refusal::TooManyClasses(name.clone()))
    }

    /// The class that a name means, added with the next colour of the palette if there is none.
    pub(super) fn find_or_add(&mut self, name: &ClassName) -> ClassNumber {
        self.find(name).unwrap_or_else(|_| {
            let number = ClassNumber(self.all.len());
            self.all.push(Known {
                name: name.clone(),
                colour: Colour::from(colours::class(number.0)),
                made: false,
                merged: None,
            });
            self.numbers.insert(name.key(), number);
            self.ever.insert(name.key());
            number
        })
    }

    /// Adds a class for its own sake.
    pub(super) fn make(&mut self, name: &ClassName) {
        let number = self.find_or_add(name);
        self.all[number.0].made = true;
    }

    /// Gives a class another name; a class that has it becomes part of this one.
    pub(super) fn rename(&mut self, class: &ClassName, to: &ClassName) -> Result<(), Refusal> {
        let Some(number) = self.still(class)? else {
            return Ok(());
        };
        if let Ok(other) = self.find(to)
            && other != number
        {
            self.all[other.0].merged = Some(number);
        }
        self.numbers.remove(&class.key());
        self.numbers.insert(to.key(), number);
        self.ever.insert(to.key());
        self.all[number.0].name = to.clone();
        Ok(())
    }

    /// Makes one class of two.
    pub(super) fn merge(&mut self, class: &ClassName, into: &ClassName) -> Result<(), Refusal> {
        if let (Some(ends), Some(goes_on)) = (self.still(class)?, self.still(into)?)
            && ends != goes_on
        {
            self.all[ends.0].merged = Some(goes_on);
            self.numbers.remove(&class.key());
        }
        Ok(())
    }

    /// Gives a class another colour.
    pub(super) fn colour(&mut self, class: &ClassName, colour: Colour) -> Result<(), Refusal> {
        if let Some(number) = self.still(class)? {
            self.all[number.0].colour = colour;
        }
        Ok(())
    }

    /// The class that a name means; `None` if none does any more. A log may name a class that was told apart, when it was
    /// written, from another that has taken its name along since.
    fn still(&self, name: &ClassName) -> Result<Option<ClassNumber>, Refusal> {
        match self.find(name) {
            Ok(number) => Ok(Some(number)),
            Err(_) if self.ever.contains(&name.key()) => Ok(None),
            Err(refusal) => Err(refusal),
        }
    }

    /// The class that goes on in place of this one.
    pub(super) fn today(&self, mut class: ClassNumber) -> ClassNumber {
        while let Some(into) = self.all[class.0].merged {
            class = into;
        }
        class
    }

    /// Its name of today.
    pub(super) fn name(&self, class: ClassNumber) -> &ClassName {
        &self.all[self.today(class).0].name
    }

    /// Whether somebody made it for its own sake.
    pub(super) fn is_made(&self, class: ClassNumber) -> bool {
        self.all[class.0].made
    }

    /// Those that go on.
    pub(super) fn iter(&self) -> impl Iterator<Item = (ClassNumber, &ClassName, Colour)> {
        let all = self.all.iter().enumerate();
        all.filter(|(_, known)| known.merged.is_none())
            .map(|(number, known)| (ClassNumber(number), &known.name, known.colour))
    }
}

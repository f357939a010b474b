//! The classes of a campaign: names and colours that change, and what became of those that were merged.

use super::{ClassName, Colour, Refusal};
use crate::picture::colours;

/// Most classes that go on, so that a file of another kind read by mistake ends as an error.
const MAX_CLASSES: usize = 1000;

/// Which class, whatever its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct ClassNumber(usize);

/// Every class that there ever was, in the order of creation.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Classes(Vec<Known>);

#[derive(Debug, Clone, PartialEq)]
struct Known {
    name: ClassName,
    colour: Colour,
    /// The class that it was merged into.
    merged: Option<ClassNumber>,
}

impl Classes {
    /// Adds a class, with the next colour of the palette.
    pub(super) fn create(&mut self, name: &ClassName) -> Result<ClassNumber, Refusal> {
        self.free(name)?;
        if self.iter().count() == MAX_CLASSES {
            return Err(Refusal::TooManyClasses(name.clone()));
        }
        let number = ClassNumber(self.0.len());
        self.0.push(Known {
            name: name.clone(),
            colour: Colour::from(colours::class(number.0)),
            merged: None,
        });
        Ok(number)
    }

    pub(super) fn find_or_create(&mut self, name: &ClassName) -> Result<ClassNumber, Refusal> {
        self.find(name).or_else(|_| self.create(name))
    }

    pub(super) fn rename(&mut self, class: &ClassName, to: &ClassName) -> Result<(), Refusal> {
        let number = self.find(class)?;
        self.free(to)?;
        self.0[number.0].name = to.clone();
        Ok(())
    }

    pub(super) fn merge(&mut self, class: &ClassName, into: &ClassName) -> Result<(), Refusal> {
        let (ends, goes_on) = (self.find(class)?, self.find(into)?);
        if ends == goes_on {
            return Err(Refusal::IntoItself(class.clone()));
        }
        self.0[ends.0].merged = Some(goes_on);
        Ok(())
    }

    pub(super) fn colour(&mut self, class: &ClassName, colour: Colour) -> Result<(), Refusal> {
        let number = self.find(class)?;
        self.0[number.0].colour = colour;
        Ok(())
    }

    /// The class that goes on in place of this one.
    pub(super) fn today(&self, mut class: ClassNumber) -> ClassNumber {
        while let Some(into) = self.0[class.0].merged {
            class = into;
        }
        class
    }

    /// Its name of today.
    pub(super) fn name(&self, class: ClassNumber) -> &ClassName {
        &self.0[self.today(class).0].name
    }

    /// Those that go on.
    pub(super) fn iter(&self) -> impl Iterator<Item = (ClassNumber, &ClassName, Colour)> {
        let all = self.0.iter().enumerate();
        all.filter(|(_, known)| known.merged.is_none())
            .map(|(number, known)| (ClassNumber(number), &known.name, known.colour))
    }

    fn find(&self, name: &ClassName) -> Result<ClassNumber, Refusal> {
        let found = self.iter().find(|(_, other, _)| *other == name);
        found
            .map(|(number, _, _)| number)
            .ok_or_else(|| Refusal::NoClass(name.clone()))
    }

    fn free(&self, name: &ClassName) -> Result<(), Refusal> {
        match self.find(name) {
            Ok(_) => Err(Refusal::ClassExists(name.clone())),
            Err(_) => Ok(()),
        }
    }
}

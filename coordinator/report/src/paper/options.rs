//! The options of a figure for a paper, which the command and the form on the page Taxonomy share.

use murmuration_swarm::{Invalid, text::quoted};
use std::{fmt, str::FromStr};

/// The options of a figure.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Options {
    /// The behaviours to show; by default the distinct ones.
    pub behaviours: Option<Behaviours>,
    pub width: Width,
    /// Number of behaviours in a row; by default as many as are large enough to see.
    pub columns: Option<Columns>,
    pub labels: Labels,
    /// Whether each behaviour has the share of its cluster.
    pub shares: bool,
}

/// Maximum number of behaviours in a figure.
pub const MOST_BEHAVIOURS: usize = 200;

/// The numbers of behaviours, from 1, in the order in which a figure shows them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Behaviours(Vec<usize>);

impl Behaviours {
    const FIELD: &str = "behaviours";

    /// Checks the numbers.
    ///
    /// # Errors
    /// [`Invalid`] if there are none or too many, or if a number is 0 or occurs twice.
    pub fn new(numbers: Vec<usize>) -> Result<Self, Invalid> {
        if numbers.is_empty() {
            return Err(Invalid::missing(
                Self::FIELD,
                "the number of at least one behaviour",
            ));
        }
        if numbers.len() > MOST_BEHAVIOURS {
            let allowed = format!("at most {MOST_BEHAVIOURS} numbers");
            return Err(Invalid::new(
                Self::FIELD,
                format!("{} numbers", numbers.len()),
                allowed,
            ));
        }
        for (place, number) in numbers.iter().enumerate() {
            if *number == 0 {
                return Err(Invalid::new(
                    Self::FIELD,
                    number,
                    "numbers from 1, as the report shows them",
                ));
            }
            if numbers[..place].contains(number) {
                return Err(Invalid::new(Self::FIELD, number, "different numbers"));
            }
        }
        Ok(Self(numbers))
    }

    /// The positions of the behaviours in a taxonomy of `count` behaviours.
    pub(super) fn places(&self, count: usize) -> Result<Vec<usize>, Invalid> {
        match self.0.iter().find(|number| **number > count) {
            Some(number) => Err(Invalid::new(
                Self::FIELD,
                number,
                format!("numbers from 1 to {count}, as the report shows them"),
            )),
            None => Ok(self.0.iter().map(|number| number - 1).collect()),
        }
    }
}

impl FromStr for Behaviours {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        let number = |text: &str| {
            text.trim()
                .parse()
                .map_err(|_| Invalid::new(Self::FIELD, quoted(text), "numbers with commas, like 2,5,9"))
        };
        Self::new(text.split(',').map(number).collect::<Result<_, _>>()?)
    }
}

/// The width of a figure on paper.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Width {
    micrometres: u32,
}

impl Width {
    /// The column of a journal with two columns.
    pub const COLUMN: Self = Self { micrometres: 85_000 };
    /// The text of a page of such a journal.
    pub const PAGE: Self = Self { micrometres: 178_000 };
    const ALLOWED: std::ops::RangeInclusive<f64> = 20.0..=500.0;

    pub(super) fn millimetres(self) -> f64 {
        f64::from(self.micrometres) / 1000.0
    }
}

impl Default for Width {
    fn default() -> Self {
        Self::COLUMN
    }
}

impl fmt::Display for Width {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::COLUMN => f.write_str("column"),
            Self::PAGE => f.write_str("page"),
            _ => write!(f, "{}mm", self.millimetres()),
        }
    }
}

impl FromStr for Width {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        match text.trim() {
            "column" => return Ok(Self::COLUMN),
            "page" => return Ok(Self::PAGE),
            _ => {}
        }
        let refused = || {
            let (least, most) = (Self::ALLOWED.start(), Self::ALLOWED.end());
            let allowed = format!("column, page, or from {least}mm to {most}mm, like 85mm");
            Invalid::new("width", quoted(text), allowed)
        };
        let number = text.trim().strip_suffix("mm").ok_or_else(refused)?;
        let millimetres: f64 = number.trim().parse().map_err(|_| refused())?;
        match Self::ALLOWED.contains(&millimetres) {
            true => Ok(Self {
                micrometres: (1000.0 * millimetres).round() as u32,
            }),
            false => Err(refused()),
        }
    }
}

/// The number of behaviours in a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Columns(usize);

impl Columns {
    const MOST: usize = 50;

    pub(super) const fn get(self) -> usize {
        self.0
    }
}

impl FromStr for Columns {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        match text.trim().parse() {
            Ok(columns @ 1..=Self::MOST) => Ok(Self(columns)),
            _ => Err(Invalid::new(
                "columns",
                quoted(text),
                format!("a number from 1 to {}", Self::MOST),
            )),
        }
    }
}

/// The label of each behaviour.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Labels {
    /// a, b, c, for the caption of a paper.
    Letters,
    /// The numbers of the report.
    Numbers,
    /// The names, with a question mark unless a person gave the name.
    #[default]
    Names,
    None,
}

impl Labels {
    pub const ALL: [Self; 4] = [Self::Names, Self::Letters, Self::Numbers, Self::None];

    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Letters => "letters",
            Self::Numbers => "numbers",
            Self::Names => "names",
            Self::None => "none",
        }
    }
}

impl FromStr for Labels {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        let mut all = Self::ALL.into_iter();
        all.find(|labels| labels.name() == text)
            .ok_or_else(|| Invalid::new("labels", quoted(text), "letters, numbers, names or none"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check<T: FromStr<Err = Invalid>>(text: &str, expected: &str) {
        match text.parse::<T>() {
            Ok(_) => panic!("{text} is accepted"),
            Err(error) => assert_eq!(error.to_string(), expected),
        }
    }

    #[test]
    fn widths_have_names_or_millimetres() {
        for (text, millimetres) in [
            ("column", 85.0),
            ("page", 178.0),
            ("62.5mm", 62.5),
            ("20 mm", 20.0),
        ] {
            assert_eq!(text.parse::<Width>().unwrap().millimetres(), millimetres);
        }
        assert_eq!("178mm".parse::<Width>().unwrap().to_string(), "page");
        for text in ["19.9mm", "501mm", "NaNmm", "85", "8cm", ""] {
            let expected =
                format!("width = \"{text}\": must be column, page, or from 20mm to 500mm, like 85mm");
            check::<Width>(text, &expected);
        }
    }

    #[test]
    fn behaviours_are_different_numbers_from_one() {
        let places = |text: &str, count| text.parse::<Behaviours>().unwrap().places(count);
        assert_eq!(places("9, 2,5", 9).unwrap(), [8, 1, 4]);
        assert_eq!(
            places("2,10", 9).unwrap_err().to_string(),
            "behaviours = 10: must be numbers from 1 to 9, as the report shows them"
        );
        check::<Behaviours>("2,2", "behaviours = 2: must be different numbers");
        check::<Behaviours>(
            "0",
            "behaviours = 0: must be numbers from 1, as the report shows them",
        );
        check::<Behaviours>("1,", "behaviours = \"\": must be numbers with commas, like 2,5,9");
        let many: Vec<String> = (1..=201).map(|number: u32| number.to_string()).collect();
        check::<Behaviours>(
            &many.join(","),
            "behaviours = 201 numbers: must be at most 200 numbers",
        );
    }

    #[test]
    fn columns_and_labels_are_checked() {
        assert_eq!("3".parse::<Columns>().unwrap().get(), 3);
        check::<Columns>("0", "columns = \"0\": must be a number from 1 to 50");
        check::<Labels>(
            "roman",
            "labels = \"roman\": must be letters, numbers, names or none",
        );
    }
}

//! The classes that people give to behaviours, in place of the judge's classes.

use crate::measured::Measured;
use csv::{ReaderBuilder, StringRecord, Writer};
use murmuration_model::labels::{Annotator, of_cell, to_cell};
use murmuration_swarm::{Class, Invalid};
use std::collections::BTreeMap;

/// Name of the annotator of a behaviour if the file names no annotator.
const SOMEBODY: &str = "a person";
/// The value of column `by` in `medoids.csv` for classes that the judge gave.
pub const JUDGE: &str = "judge";
/// Most characters of a name; longer names are cut.
const NAME_CHARS: usize = 64;

/// Classes that people gave to individuals of cells.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Corrections {
    /// The classes, by the digest of the cell and the index of the individual.
    by_individual: BTreeMap<Place, Given>,
}

/// Why a file of classes cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {what}")]
pub struct CorrectionsError {
    /// The line, from 1.
    pub line: u64,
    pub what: String,
}

impl Corrections {
    /// Reads a table (CSV) such as the `medoids.csv` of a report. Its columns are `cell`, `index`, `class`, and `by` for the name
    /// of the person who gave the class. Rows by the judge count only if their class differs from the judge's class; see
    /// [`Corrections::of`].
    ///
    /// # Errors
    /// The error names the line with a missing column, an invalid value, or another class than an earlier line about the
    /// individual.
    pub fn parse(text: &str) -> Result<Self, CorrectionsError> {
        let mut reader = ReaderBuilder::new().flexible(true).from_reader(text.as_bytes());
        let unreadable = |error: csv::Error| CorrectionsError {
            line: error.position().map_or(1, csv::Position::line),
            what: error.to_string(),
        };
        let header = reader.headers().map_err(unreadable)?.clone();
        let place = |name: &str| header.iter().position(|column| column.trim() == name);
        let needed = |name: &str| {
            let what = format!("there is no column \"{name}\"");
            place(name).ok_or(CorrectionsError { line: 1, what })
        };
        let columns = Columns {
            cell: needed("cell")?,
            index: needed("index")?,
            class: needed("class")?,
            by: place("by"),
        };
        let mut by_individual: BTreeMap<Place, Given> = BTreeMap::new();
        for row in reader.records() {
            let row = row.map_err(unreadable)?;
            let line = row.position().map_or(0, csv::Position::line);
            let Some((individual, given)) = columns
                .read(&row)
                .map_err(|what| CorrectionsError { line, what })?
            else {
                continue;
            };
            match by_individual.get(&individual) {
                Some((class, _)) if *class != given.0 => {
                    let (_, index) = individual;
                    let what = format!(
                        "individual {index} has the class {} here, but {class} in an earlier row: give it one class in all rows",
                        given.0
                    );
                    return Err(CorrectionsError { line, what });
                }
                _ => by_individual.insert(individual, given),
            };
        }
        Ok(Self { by_individual })
    }

    /// Sets the class that the person `by` gives to an individual of the cell with the digest `cell`; `None` restores the judge's
    /// class.
    ///
    /// # Errors
    /// Fails if the name is empty, too long, or the judge's.
    pub fn set(&mut self, cell: &str, index: u64, class: Option<Class>, by: &str) -> Result<(), Invalid> {
        let name: Annotator = by.trim().parse()?;
        let name = name.as_str();
        if name.eq_ignore_ascii_case(JUDGE) {
            let allowed = format!("a person's name, other than \"{JUDGE}\"");
            return Err(Invalid::new("by", format!("{name:?}"), allowed));
        }
        let place = (cell.to_owned(), index);
        match class {
            Some(class) => drop(self.by_individual.insert(place, (class, name.to_owned()))),
            None => drop(self.by_individual.remove(&place)),
        }
        Ok(())
    }

    /// These corrections, and the corrections in `others` for further individuals.
    #[must_use]
    pub fn or(mut self, others: Self) -> Self {
        for (place, given) in others.by_individual {
            self.by_individual.entry(place).or_insert(given);
        }
        self
    }

    /// The table that [`Corrections::parse`] reads, one row for each individual.
    pub fn to_csv(&self) -> String {
        let mut table = Writer::from_writer(Vec::new());
        // Writing to memory cannot fail, and all rows have the same number of cells.
        let _ = table.write_record(["cell", "index", "class", "by"]);
        for ((cell, index), (class, by)) in &self.by_individual {
            let _ = table.write_record([cell.as_str(), &index.to_string(), class.name(), &to_cell(by)]);
        }
        let bytes = table.into_inner().unwrap_or_default();
        String::from_utf8_lossy(&bytes).into_owned()
    }

    /// The class that a person gave to an individual of a cell, and the person; `None` if the judge's class remains.
    pub fn of(&self, cell: &Measured, index: u64) -> Option<(Class, &str)> {
        let (class, by) = self.by_individual.get(&(cell.cell.clone(), index))?;
        let judged = cell
            .behaviours
            .as_ref()
            .map(|behaviours| behaviours.judged(index));
        match by.as_str() {
            JUDGE if judged == Some(*class) => None,
            JUDGE => Some((*class, SOMEBODY)),
            person => Some((*class, person)),
        }
    }
}

/// An individual by the digest of its cell and its index.
type Place = (String, u64);
type Given = (Class, String);

struct Columns {
    cell: usize,
    index: usize,
    class: usize,
    by: Option<usize>,
}

impl Columns {
    /// The individual of a row, its class, and the name of the person or judge who gave the class; `None` for a row without a
    /// class.
    fn read(&self, row: &StringRecord) -> Result<Option<(Place, Given)>, String> {
        let cell = |place: usize| row.get(place).unwrap_or_default().trim();
        let name = cell(self.class);
        if name.is_empty() {
            return Ok(None);
        }
        let class = Class::ALL.into_iter().find(|class| class.name() == name);
        let class = class.ok_or_else(|| {
            let names = Class::ALL.map(Class::name).join(", ");
            format!("class = \"{}\": must be one of {names}", name.escape_debug())
        })?;
        let index = cell(self.index);
        let index = index.parse().map_err(|_| {
            format!(
                "index = \"{}\": must be the index of an individual",
                index.escape_debug()
            )
        })?;
        let by = self.by.map(cell).filter(|by| !by.is_empty()).unwrap_or(SOMEBODY);
        let by = of_cell(by)
            .chars()
            .filter(|c| !c.is_control())
            .take(NAME_CHARS)
            .collect();
        Ok(Some(((cell(self.cell).to_owned(), index), (class, by))))
    }
}

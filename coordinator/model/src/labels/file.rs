//! Files of labels: CSV with a header. Columns may be in any order, and unknown columns are ignored.
//!
//! The command `labels` writes this format, and `label`, `lab accuracy` and `lab judge` read it. docs/labels.md describes the
//! columns. This module handles text, not files.

use super::{
    Annotator, Answer, LabelFileError,
    columns::{ANGLE, FIRST_SPEEDS, IMAGE, INDEX, SET_ANGLE, SET_INDEX, SET_SPEED, WORLD, set_genes},
    of_cell,
    quotes::unclosed,
};
use crate::Timestamp;
use csv::{ErrorKind, ReaderBuilder, StringRecord, Trim};
use murmuration_proto::v1;
use murmuration_swarm::{
    CapabilityModel, Controller, FEATURE_NAMES, Features, ImageFormat, Invalid, Preset, World, counted,
    of_toml_line, text::quoted,
};
use serde::de::DeserializeOwned;
use std::{
    path::{Path, PathBuf},
    str::FromStr,
};

/// Column of the robots, if they are not the paper's, as [`CapabilityModel::to_line`] writes them.
pub(super) const ROBOTS: &str = "robots";

/// A file of labels, split into cells; only its header has been interpreted.
#[derive(Debug, Clone)]
pub struct LabelFile {
    path: PathBuf,
    text: Vec<u8>,
    columns: StringRecord,
    rows: Vec<StringRecord>,
}

#[derive(Debug, Clone, Copy)]
pub struct Row<'a> {
    file: &'a LabelFile,
    cells: &'a StringRecord,
}

impl LabelFile {
    /// Parses the text of the file at `path`.
    ///
    /// # Errors
    /// If the text is not CSV, or the column `index` (or `id`) or `class` is missing or repeated.
    pub fn parse(path: &Path, text: Vec<u8>) -> Result<Self, LabelFileError> {
        let file = Self::with_columns(&[], path, text)?;
        for column in [file.behaviour_column(), "class"] {
            file.need(column)?;
        }
        Ok(file)
    }

    /// The column that identifies a row's behaviour: `index`, or else `id`.
    pub(crate) fn behaviour_column(&self) -> &'static str {
        match !self.has(INDEX) && self.has(SET_INDEX) {
            true => SET_INDEX,
            false => INDEX,
        }
    }

    /// Parses the text of a file that must have the columns `needed`.
    ///
    /// # Errors
    /// If the text is not CSV, or a needed column is missing or repeated.
    pub fn with_columns(needed: &[&str], path: &Path, text: Vec<u8>) -> Result<Self, LabelFileError> {
        let mut file = Self {
            path: path.to_owned(),
            text,
            columns: StringRecord::new(),
            rows: Vec::new(),
        };
        let (columns, rows) = file.take_apart()?;
        (file.columns, file.rows) = (columns, rows);
        for column in needed {
            file.need(column)?;
        }
        Ok(file)
    }

    fn take_apart(&self) -> Result<(StringRecord, Vec<StringRecord>), LabelFileError> {
        let mut reader = ReaderBuilder::new()
            .trim(Trim::All)
            .from_reader(self.text.as_slice());
        if let Some(line) = unclosed(&self.text) {
            let path = self.path.clone();
            return Err(LabelFileError::Quote { path, line });
        }
        let not_csv = |error: csv::Error| self.not_csv(&error);
        let columns = reader.headers().map_err(not_csv)?.clone();
        if let Some(separator) = other_separator(&columns) {
            let path = self.path.clone();
            return Err(LabelFileError::Separator { path, separator });
        }
        let rows = reader.into_records().collect::<Result<_, _>>().map_err(not_csv)?;
        Ok((columns, rows))
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        self.rows.iter().map(|cells| Row { file: self, cells })
    }

    /// A row by its place, from 0.
    pub fn row(&self, place: usize) -> Option<Row<'_>> {
        let cells = self.rows.get(place)?;
        Some(Row { file: self, cells })
    }

    pub fn has(&self, column: &str) -> bool {
        self.columns.iter().any(|name| name == column)
    }

    /// Whether the file has controllers: of the paper's robots, or of robots that a column names.
    pub fn has_controllers(&self) -> bool {
        self.has(ROBOTS) || FIRST_SPEEDS.iter().any(|column| self.has(column))
    }

    /// The place of a required column.
    fn need(&self, column: &str) -> Result<usize, LabelFileError> {
        let mut places = self
            .columns
            .iter()
            .enumerate()
            .filter(|(_, name)| *name == column);
        let problem = match (places.next(), places.next()) {
            (Some((place, _)), None) => return Ok(place),
            (None, _) => "there is no",
            (Some(_), Some(_)) => "there is more than one",
        };
        Err(LabelFileError::Column {
            path: self.path.clone(),
            column: column.to_owned(),
            problem,
            columns: self.columns.iter().collect::<Vec<_>>().join(", "),
        })
    }

    fn not_csv(&self, error: &csv::Error) -> LabelFileError {
        let path = self.path.clone();
        match error.kind() {
            ErrorKind::UnequalLengths {
                pos: Some(position),
                expected_len,
                len,
            } => LabelFileError::Uneven {
                path,
                line: self.line(position.byte()),
                cells: counted(*len, "cell"),
                columns: counted(*expected_len, "column"),
            },
            _ => LabelFileError::Unreadable {
                path,
                error: error.to_string(),
            },
        }
    }

    /// The line number of the row at `byte`, after any empty lines at `byte`.
    fn line(&self, byte: u64) -> usize {
        let (before, rest) = self.text.split_at((byte as usize).min(self.text.len()));
        let empty = rest.iter().take_while(|&&character| b"\r\n".contains(&character));
        1 + before
            .iter()
            .chain(empty)
            .filter(|&&character| character == b'\n')
            .count()
    }
}

/// The separator of the columns, if it is not a comma.
fn other_separator(columns: &StringRecord) -> Option<&'static str> {
    let only = columns.get(0).filter(|_| columns.len() == 1)?;
    let others = [(';', "semicolons"), ('\t', "tabs")];
    let other = others.into_iter().find(|(mark, _)| only.contains(*mark));
    other.map(|(_, name)| name)
}

impl<'a> Row<'a> {
    /// The cell of a column; empty if the column is missing.
    pub fn cell(&self, column: &str) -> &'a str {
        let place = self.file.columns.iter().position(|name| name == column);
        place.and_then(|place| self.cells.get(place)).unwrap_or_default()
    }

    pub fn refused(&self, error: Invalid) -> LabelFileError {
        LabelFileError::Cell {
            path: self.file.path.clone(),
            line: self
                .file
                .line(self.cells.position().map_or(0, csv::Position::byte)),
            error,
        }
    }

    /// An error about a cell of the row. `allowed` describes the allowed values.
    pub fn refuse(&self, column: &str, allowed: &str) -> LabelFileError {
        self.refused(match self.cell(column) {
            "" => Invalid::missing(column, allowed),
            text => Invalid::new(column, quoted(text), allowed),
        })
    }

    /// The text that identifies the row's behaviour; empty if the row has none.
    pub fn behaviour(&self) -> &'a str {
        self.cell(self.file.behaviour_column())
    }

    /// An error about the text that identifies the row's behaviour. `allowed` describes the allowed values.
    pub fn refuse_behaviour(&self, allowed: &str) -> LabelFileError {
        self.refuse(self.file.behaviour_column(), allowed)
    }

    /// The row's answer; `None` if the cell of the class is empty.
    ///
    /// # Errors
    /// If the class is not a valid name.
    pub fn answer(&self) -> Result<Option<Answer>, LabelFileError> {
        match self.cell("class") {
            "" => Ok(None),
            class => {
                let answer = of_cell(class).parse();
                answer.map(Some).map_err(|error| self.refused(error))
            }
        }
    }

    /// The annotator of the row, or else `otherwise`.
    ///
    /// # Errors
    /// If the row has no annotator and `otherwise` is `None`, or the name is invalid.
    pub fn annotator(&self, otherwise: Option<&Annotator>) -> Result<Annotator, LabelFileError> {
        match (self.cell("annotator"), otherwise) {
            ("", Some(annotator)) => Ok(annotator.clone()),
            ("", None) => Err(self.refuse("annotator", "a name, in this column or with --annotator")),
            (named, _) => of_cell(named).parse().map_err(|error| self.refused(error)),
        }
    }

    /// Whether the row names the synthetic annotator.
    pub fn is_synthetic(&self) -> bool {
        Annotator::is_synthetic(of_cell(self.cell("annotator")))
    }

    /// The time of the answer, milliseconds since 1970-01-01 UTC; 0 if the row has no time.
    ///
    /// # Errors
    /// If the cell is not a time in RFC 3339.
    pub fn time_ms(&self) -> Result<u64, LabelFileError> {
        let time = self.given("time", "a time such as 2026-11-21T12:00:00Z")?;
        Ok(time.map_or(0, Timestamp::ms))
    }

    /// Index of the individual in its campaign's archive.
    ///
    /// # Errors
    /// If the cell is not a whole number.
    pub fn index(&self) -> Result<u64, LabelFileError> {
        self.needed(self.file.behaviour_column(), "a whole number")
    }

    /// The seed of the behaviour's start.
    ///
    /// # Errors
    /// If the row has no seed, or the seed is not a whole number.
    pub fn seed(&self) -> Result<u64, LabelFileError> {
        self.needed("seed", "a whole number")
    }

    /// The capability model in the column `robots`, which may be missing if the robots are the paper's.
    fn model(&self) -> Result<CapabilityModel, LabelFileError> {
        let world = self.world()?;
        let has_angle = self.file.has(ANGLE) || self.file.has(SET_ANGLE);
        let model = match (self.cell(ROBOTS), has_angle) {
            ("", false) => world.robots_of(Preset::SingleSensor),
            ("", true) => world.robots_of(Preset::TwoSensor),
            (line, _) => world.robots_of_line(ROBOTS, line),
        };
        model.map_err(|error| self.refused(error))
    }

    /// The row's controller. Each gene has a column with the gene's name. For the paper's robots, the columns can also be `v1` to
    /// `v4`, or `v1` to `v8` and `theta`.
    ///
    /// # Errors
    /// If a column is missing, or a gene is not a number or out of range.
    pub fn controller(&self) -> Result<Controller, LabelFileError> {
        self.controller_of(self.model()?)
    }

    /// The row's controller, with the robots that the file names, or else with the `campaign`'s robots.
    pub(super) fn controller_in(&self, campaign: &CapabilityModel) -> Result<Controller, LabelFileError> {
        let names_robots = self.file.has(ROBOTS) || self.file.has(SET_SPEED);
        self.controller_of(match names_robots {
            true => self.model()?,
            false => campaign.clone(),
        })
    }

    fn controller_of(&self, model: CapabilityModel) -> Result<Controller, LabelFileError> {
        let (names, in_sets) = (model.gene_names(), set_genes(&model));
        let columns: Vec<&str> = match in_sets.first().is_some_and(|first| self.file.has(first)) {
            true => in_sets.to_vec(),
            false => names.iter().map(String::as_str).collect(),
        };
        let genes = columns.iter().map(|name| self.needed(name, "a number"));
        let genes = genes.collect::<Result<Vec<f64>, _>>()?;
        Controller::new(model, &genes).map_err(|error| self.refused(error))
    }

    /// The five hand-crafted features, each from the column of its name.
    ///
    /// # Errors
    /// If a column is missing, or a value is not a finite number.
    pub fn features(&self) -> Result<Features, LabelFileError> {
        let mut features = [0.0_f64; FEATURE_NAMES.len()];
        for (feature, name) in features.iter_mut().zip(FEATURE_NAMES) {
            *feature = self.finite(name)?;
        }
        Ok(features)
    }

    /// The whole number in a column.
    ///
    /// # Errors
    /// If the column is missing, or its value is not a whole number.
    pub fn whole(&self, column: &str) -> Result<u32, LabelFileError> {
        self.needed(column, "a whole number from 0 to 4294967295")
    }

    /// The finite number in a column.
    ///
    /// # Errors
    /// If the column is missing, or its value is not a finite number.
    pub fn finite(&self, column: &str) -> Result<f64, LabelFileError> {
        let number: f64 = self.needed(column, "a finite number")?;
        match number.is_finite() {
            true => Ok(number),
            false => Err(self.refuse(column, "a finite number")),
        }
    }

    /// The world of the simulation. Fields that are not in the row have the paper's values.
    ///
    /// # Errors
    /// If a value is out of range.
    pub fn world(&self) -> Result<World, LabelFileError> {
        let mut world: v1::World = self.table(WORLD, "{ horizon = 600 }")?;
        // If the row has robots, the defaults of their number and size come from these robots.
        if !self.cell(ROBOTS).is_empty() {
            let robots = World::default().robots_of_line(ROBOTS, self.cell(ROBOTS));
            let robots = robots.map_err(|error| self.refused(error))?;
            world.agents = world.agents.or(robots.robots());
            world.radius = world.radius.or(Some(robots.largest_radius()));
        }
        World::try_from(world).map_err(|error| self.refused(error))
    }

    /// The format of the picture of a behaviour of `model` in `world`. Fields that are not in the row have the paper's values.
    ///
    /// # Errors
    /// If a value is out of range.
    pub fn image_format(
        &self,
        world: &World,
        model: &CapabilityModel,
    ) -> Result<ImageFormat, LabelFileError> {
        let format = self.table(IMAGE, "{ resolution = 100 }")?;
        ImageFormat::for_swarm(format, world, model).map_err(|error| self.refused(error))
    }

    /// The TOML table in a cell, such as `example`. An empty cell or a missing column gives a table without fields.
    fn table<T: DeserializeOwned + Default>(&self, column: &str, example: &str) -> Result<T, LabelFileError> {
        match self.cell(column) {
            "" => Ok(T::default()),
            line => of_toml_line(column, line, example).map_err(|error| self.refused(error)),
        }
    }

    fn needed<T: FromStr>(&self, column: &str, allowed: &str) -> Result<T, LabelFileError> {
        self.file.need(column)?;
        let given = self.given(column, allowed)?;
        given.ok_or_else(|| self.refuse(column, allowed))
    }

    fn given<T: FromStr>(&self, column: &str, allowed: &str) -> Result<Option<T>, LabelFileError> {
        match self.cell(column) {
            "" => Ok(None),
            text => text.parse().map(Some).map_err(|_| self.refuse(column, allowed)),
        }
    }
}

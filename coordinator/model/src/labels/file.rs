//! Files of labels: CSV with a header. Columns may be in any order, and unknown columns are ignored.
//!
//! The command `labels` writes this format, and `label`, `lab accuracy` and `lab judge` read it. docs/labels.md describes the
//! columns. This module handles text, not files.

use super::{
    Annotator, Answer, LabelFileError,
    columns::{ANGLE, FIRST_SPEEDS, IMAGE, INDEX, SET_ANGLE, SET_INDEX, SET_SPEED, WORLD, set_genes},
    of_cell,
};
use crate::{
    Timestamp,
    csv_file::{ColumnNames, CsvError, CsvFile, CsvRow, Header, is_no_value, without_zeros},
};
use murmuration_proto::v1;
use murmuration_swarm::{
    CapabilityModel, Controller, FEATURE_NAMES, Features, ImageFormat, Preset, World, of_toml_line,
    text::quoted,
};
use serde::de::DeserializeOwned;
use std::{cmp::Ordering, collections::BTreeMap, ops::Deref, path::Path, sync::Arc};

/// Column of the robots, if they are not the paper's, as [`CapabilityModel::to_line`] writes them.
pub(super) const ROBOTS: &str = "robots";

/// A file of labels, split into cells; only its header has been interpreted.
#[derive(Debug, Clone)]
pub struct LabelFile {
    header: Arc<Header>,
    rows: Vec<CsvRow>,
}

/// The newest row of a behaviour and an annotator.
#[derive(Debug)]
pub struct Newest<'a, A> {
    /// Place of the row in the file, from 0.
    pub place: usize,
    pub row: Row<'a>,
    pub answer: Answer,
    pub annotator: A,
    /// Time of the answer, milliseconds since 1970-01-01 UTC; 0 if the row has no time.
    pub time_ms: u64,
}

/// A row of a file of labels, or of a file with the same columns of controllers and seeds.
#[derive(Debug, Clone, Copy)]
pub struct Row<'a>(pub &'a CsvRow);

impl Deref for Row<'_> {
    type Target = CsvRow;

    fn deref(&self) -> &CsvRow {
        self.0
    }
}

impl LabelFile {
    /// Parses the text of the file at `path`.
    ///
    /// # Errors
    /// If the text is not CSV, or the column `index` (or `id`) or `class` is missing or repeated.
    pub fn parse(path: &Path, text: &[u8]) -> Result<Self, CsvError> {
        let file = Self::read(path, text, ColumnNames::default())?;
        file.need_classes()?;
        Ok(file)
    }

    /// Parses the text of the file at `path`, which may lack the column `class`. `names` has the names of the columns in the file.
    ///
    /// # Errors
    /// If the text is not CSV, or the column `index` (or `id`) is missing or repeated.
    pub(super) fn read(path: &Path, text: &[u8], names: ColumnNames) -> Result<Self, CsvError> {
        let file = CsvFile::open_named(path, text, &[], names)?;
        let header = file.header().clone();
        header.need(behaviour_column(&header))?;
        let rows = file.collect::<Result<_, _>>()?;
        Ok(Self { header, rows })
    }

    /// Checks that the file has a column `class`.
    ///
    /// # Errors
    /// If the column is missing or repeated.
    pub(super) fn need_classes(&self) -> Result<(), CsvError> {
        self.header.need("class")
    }

    /// The names of the columns in the file.
    pub(super) fn columns(&self) -> String {
        self.header.columns().collect::<Vec<_>>().join(", ")
    }

    /// The column that identifies a row's behaviour: `index`, or else `id`.
    pub(crate) fn behaviour_column(&self) -> &'static str {
        behaviour_column(&self.header)
    }

    pub fn path(&self) -> &Path {
        self.header.path()
    }

    pub fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        self.rows.iter().map(Row)
    }

    /// A row by its place, from 0.
    pub fn row(&self, place: usize) -> Option<Row<'_>> {
        self.rows.get(place).map(Row)
    }

    pub fn has(&self, column: &str) -> bool {
        self.header.has(column)
    }

    /// Whether a column `id` identifies the individuals, and nothing shows that it has their indices. Other tools number their tasks
    /// in a column of this name.
    pub(super) fn has_only_ids(&self) -> bool {
        let is_gene = |column: &str| {
            ["left_", "right_", "speed_", "turn_"]
                .iter()
                .any(|name| column.contains(name))
        };
        self.behaviour_column() == SET_INDEX
            && !self.header.is_renamed(SET_INDEX)
            && !self.has("seed")
            && !self.has_controllers()
            && !self.header.columns().any(is_gene)
    }

    /// Of each behaviour and annotator, the newest row with an answer, in the order of their first rows. `annotator` gives the
    /// annotator of a row.
    ///
    /// # Errors
    /// If a row is not valid, or two rows have different answers and no times that tell which is newer.
    pub fn newest<A: Ord + Clone>(
        &self,
        annotator: impl Fn(Row<'_>) -> Result<A, CsvError>,
    ) -> Result<Vec<Newest<'_, A>>, LabelFileError> {
        let mut newest: Vec<Newest<'_, A>> = Vec::new();
        let mut places: BTreeMap<(String, A), usize> = BTreeMap::new();
        for (place, row) in self.rows().enumerate() {
            let Some(answer) = row.answer()? else { continue };
            let own = Newest {
                place,
                row,
                answer,
                annotator: annotator(row)?,
                time_ms: row.time_ms()?,
            };
            // `3`, `03` and two pictures of individual 3 are one behaviour.
            let behaviour = row
                .index()
                .map_or_else(|_| row.behaviour().to_owned(), |index| index.to_string());
            let key = (behaviour, own.annotator.clone());
            let Some(&place) = places.get(&key) else {
                places.insert(key, newest.len());
                newest.push(own);
                continue;
            };
            let before = &mut newest[place];
            let has_times = before.time_ms > 0 && own.time_ms > 0;
            match own.time_ms.cmp(&before.time_ms) {
                Ordering::Greater if has_times => *before = own,
                Ordering::Less if has_times => {}
                _ if before.answer == own.answer => {}
                _ => {
                    return Err(LabelFileError::Twice {
                        path: self.path().to_owned(),
                        lines: [before.row.line(), row.line()],
                        behaviour: row.behaviour().to_owned(),
                    });
                }
            }
        }
        Ok(newest)
    }

    /// Whether the file has controllers: of the paper's robots, or of robots that a column names.
    pub fn has_controllers(&self) -> bool {
        self.has(ROBOTS) || FIRST_SPEEDS.iter().any(|column| self.has(column))
    }
}

/// The number at the end of the name of a picture's file, such as 3 of `/data/upload/1/ab12cd34-00003.png`.
fn number_of_picture(cell: &str) -> Option<u64> {
    let name = cell.rsplit(['/', '\\']).next()?;
    let (stem, end) = name.rsplit_once('.')?;
    let is_picture = ["png", "jpg", "jpeg", "gif", "webp", "bmp", "tif", "tiff", "svg"]
        .iter()
        .any(|known| end.eq_ignore_ascii_case(known));
    let word = stem.trim_end_matches(|letter: char| letter.is_ascii_digit());
    stem[word.len()..].parse().ok().filter(|_| is_picture)
}

fn behaviour_column(header: &Header) -> &'static str {
    match !header.has(INDEX) && header.has(SET_INDEX) {
        true => SET_INDEX,
        false => INDEX,
    }
}

impl<'a> Row<'a> {
    /// The cell of a column, without spaces around it; empty if the column is missing.
    pub fn cell(&self, column: &str) -> &'a str {
        self.0.cell(column)
    }

    /// The text that identifies the row's behaviour; empty if the row has none.
    pub fn behaviour(&self) -> &'a str {
        without_zeros(self.cell(behaviour_column(self.header())))
    }

    /// An error about the text that identifies the row's behaviour. `allowed` describes the allowed values.
    pub fn refuse_behaviour(&self, allowed: &str) -> CsvError {
        self.refuse(behaviour_column(self.header()), allowed)
    }

    /// The row's answer; `None` if the cell of the class has no value.
    ///
    /// # Errors
    /// If the class is not a valid name, or the cell has JSON, as some tools write for several choices.
    pub fn answer(&self) -> Result<Option<Answer>, CsvError> {
        match self.cell("class") {
            class if is_no_value(class) => Ok(None),
            json if json.starts_with(['{', '[']) => {
                let allowed = "one class; the cell has JSON, as some tools write for several choices: keep one choice in each row";
                Err(self.refuse("class", allowed))
            }
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
    pub fn annotator(&self, otherwise: Option<&Annotator>) -> Result<Annotator, CsvError> {
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
    pub fn time_ms(&self) -> Result<u64, CsvError> {
        let time = self.given("time", "a time such as 2026-11-21T12:00:00Z")?;
        Ok(time.map_or(0, Timestamp::ms))
    }

    /// The number at the end of the name of the row's picture.
    pub(super) fn picture(&self) -> Option<u64> {
        number_of_picture(self.cell(IMAGE))
    }

    /// Index of the individual in its campaign's archive. If the column has another name in the file, it can have names of pictures
    /// that end with the index.
    ///
    /// # Errors
    /// If the cell is not a whole number, or the name of the row's picture ends with another number.
    pub fn index(&self) -> Result<u64, CsvError> {
        let column = behaviour_column(self.header());
        let pictured = number_of_picture(self.cell(column)).filter(|_| self.header().is_renamed(column));
        let index = match pictured {
            Some(index) => index,
            None => self.whole_number(column, "a whole number")?,
        };
        match self.picture() {
            Some(other) if other != index => {
                let allowed = format!(
                    "{other}, the number in the name of the picture {}",
                    quoted(self.cell(IMAGE))
                );
                Err(self.refuse(column, &allowed))
            }
            _ => Ok(index),
        }
    }

    /// The seed of the behaviour's start.
    ///
    /// # Errors
    /// If the row has no seed, or the seed is not a whole number.
    pub fn seed(&self) -> Result<u64, CsvError> {
        self.whole_number("seed", "a whole number")
    }

    /// The capability model in the column `robots`, which may be missing if the robots are the paper's.
    fn model(&self) -> Result<CapabilityModel, CsvError> {
        let world = self.world()?;
        let has_angle = self.header().has(ANGLE) || self.header().has(SET_ANGLE);
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
    pub fn controller(&self) -> Result<Controller, CsvError> {
        self.controller_of(self.model()?)
    }

    /// The row's controller, with the robots that the file names, or else with the `campaign`'s robots.
    pub(super) fn controller_in(&self, campaign: &CapabilityModel) -> Result<Controller, CsvError> {
        let names_robots = self.header().has(ROBOTS) || self.header().has(SET_SPEED);
        self.controller_of(match names_robots {
            true => self.model()?,
            false => campaign.clone(),
        })
    }

    fn controller_of(&self, model: CapabilityModel) -> Result<Controller, CsvError> {
        let (names, in_sets) = (model.gene_names(), set_genes(&model));
        let columns: Vec<&str> = match in_sets.first().is_some_and(|first| self.header().has(first)) {
            true => in_sets.to_vec(),
            false => names.iter().map(String::as_str).collect(),
        };
        let genes = columns.iter().map(|name| self.finite(name));
        let genes = genes.collect::<Result<Vec<f64>, _>>()?;
        Controller::new(model, &genes).map_err(|error| self.refused(error))
    }

    /// The five hand-crafted features, each from the column of its name.
    ///
    /// # Errors
    /// If a column is missing, or a value is not a finite number.
    pub fn features(&self) -> Result<Features, CsvError> {
        let mut features = [0.0_f64; FEATURE_NAMES.len()];
        for (feature, name) in features.iter_mut().zip(FEATURE_NAMES) {
            *feature = self.finite(name)?;
        }
        Ok(features)
    }

    /// The world of the simulation. Fields that are not in the row have the paper's values.
    ///
    /// # Errors
    /// If a value is out of range.
    pub fn world(&self) -> Result<World, CsvError> {
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
    pub fn image_format(&self, world: &World, model: &CapabilityModel) -> Result<ImageFormat, CsvError> {
        let format = self.table(IMAGE, "{ resolution = 100 }")?;
        ImageFormat::for_swarm(format, world, model).map_err(|error| self.refused(error))
    }

    /// The TOML table in a cell, such as `example`. An empty cell or a missing column gives a table without fields.
    fn table<T: DeserializeOwned + Default>(&self, column: &str, example: &str) -> Result<T, CsvError> {
        match self.cell(column) {
            "" => Ok(T::default()),
            line => of_toml_line(column, line, example).map_err(|error| self.refused(error)),
        }
    }
}

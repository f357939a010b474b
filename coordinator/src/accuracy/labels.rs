//! Labelled sets: a CSV file of behaviours and, beside it, their images.

mod swarms;

use super::grey_image::pixels;
use csv::{ReaderBuilder, StringRecord};
use murmuration_proto::{FEATURE_NAMES, Features};
use std::{
    collections::BTreeSet,
    path::{Component, Path, PathBuf},
};

/// The behaviours of a labelled set that have a class.
///
/// The file has a line of column names, among them `id` and `class`; the features are columns too
/// ([`FEATURE_NAMES`]). Rows whose class is empty are left out.
#[derive(Debug, Clone)]
pub struct Labels {
    file: PathBuf,
    columns: StringRecord,
    rows: Vec<Row>,
}

#[derive(Debug, Clone)]
struct Row {
    line: u64,
    id: String,
    class: String,
    values: StringRecord,
}

/// What is wrong with a labelled set.
#[derive(Debug, thiserror::Error)]
pub enum LabelsError {
    /// The file cannot be read, or is not CSV.
    #[error("{}: {error}", file.display())]
    Csv {
        /// The file.
        file: PathBuf,
        /// What is wrong; it names the line where there is one.
        error: csv::Error,
    },
    /// A column is missing.
    #[error("{}, line 1: there is no column {column:?}", file.display())]
    Column {
        /// The file.
        file: PathBuf,
        /// The column's name.
        column: String,
    },
    /// A value cannot be used.
    #[error("{}, line {line}, column {column:?}: {value:?} {problem}", file.display())]
    Value {
        /// The file.
        file: PathBuf,
        /// Its line, from 1.
        line: u64,
        /// The column's name.
        column: String,
        /// The value.
        value: String,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// No row has a class.
    #[error("{}: no row has a class", .0.display())]
    Empty(PathBuf),
    /// A behaviour's image cannot be used.
    #[error("{}: {problem}", image.display())]
    Image {
        /// The image's file.
        image: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
}

impl Labels {
    /// Reads a CSV file.
    ///
    /// # Errors
    /// Where the file cannot be read, has no `id` or `class`, an id that is there twice or is no file name, or no row
    /// with a class.
    pub fn read(file: impl Into<PathBuf>) -> Result<Self, LabelsError> {
        let file = file.into();
        let refused = |error| LabelsError::Csv {
            file: file.clone(),
            error,
        };
        let mut reader = ReaderBuilder::new().from_path(&file).map_err(refused)?;
        let columns = reader.headers().map_err(refused)?.clone();
        let mut labels = Self {
            file: file.clone(),
            columns,
            rows: Vec::new(),
        };
        let (id, class) = (labels.column("id")?, labels.column("class")?);
        let mut ids = BTreeSet::new();
        for record in reader.into_records() {
            let values = record.map_err(refused)?;
            let row = Row {
                line: values.position().map_or(0, csv::Position::line),
                id: values[id].to_owned(),
                class: values[class].to_owned(),
                values,
            };
            if !is_file_name(&row.id) {
                return Err(labels.value(&row, "id", "is not the name of an image"));
            }
            if !ids.insert(row.id.clone()) {
                return Err(labels.value(&row, "id", "is there twice"));
            }
            if !row.class.is_empty() {
                labels.rows.push(row);
            }
        }
        if labels.rows.is_empty() {
            return Err(LabelsError::Empty(file));
        }
        Ok(labels)
    }

    /// The classes, one for each behaviour, in the file's order.
    pub fn classes(&self) -> impl Iterator<Item = &str> {
        self.rows.iter().map(|row| row.class.as_str())
    }

    /// The patterns that people saw in each behaviour, in the file's order (column `pattern`, several joined by `|`);
    /// empty where they saw none, and where the file does not have the column.
    pub fn patterns(&self) -> impl Iterator<Item = &str> {
        let column = self.column("pattern").ok();
        self.rows.iter().map(move |row| {
            let pattern = column.and_then(|column| row.values.get(column));
            pattern.unwrap_or_default()
        })
    }

    /// The five hand-crafted features of each behaviour, their absolute values, as the authors compare them: which way
    /// round a swarm turns does not matter.
    ///
    /// # Errors
    /// Where a column is missing, or a value is not a finite number.
    pub fn absolute_features(&self) -> Result<Vec<Features>, LabelsError> {
        let mut columns = [0; FEATURE_NAMES.len()];
        for (column, name) in columns.iter_mut().zip(FEATURE_NAMES) {
            *column = self.column(name)?;
        }
        self.rows
            .iter()
            .map(|row| self.features_of(row, columns))
            .collect()
    }

    fn features_of(&self, row: &Row, columns: [usize; 5]) -> Result<Features, LabelsError> {
        let mut features = [0.0; 5];
        for ((feature, column), name) in features.iter_mut().zip(columns).zip(FEATURE_NAMES) {
            let parsed = row.values[column]
                .parse()
                .ok()
                .filter(|value: &f64| value.is_finite());
            *feature = parsed
                .ok_or_else(|| self.value(row, name, "is not a finite number"))?
                .abs();
        }
        Ok(features)
    }

    /// The grey image of each behaviour, `folder/ID.png` with 8 bits a pixel: `height` rows (axis 0, which is x) of
    /// `width` pixels (axis 1, y), as an embedder takes them.
    ///
    /// # Errors
    /// Names the first image that is missing or is something else.
    pub fn images(&self, folder: &Path, height: usize, width: usize) -> Result<Vec<Vec<u8>>, LabelsError> {
        let image = |row: &Row| {
            let image = folder.join(format!("{}.png", row.id));
            pixels(&image, height, width).map_err(|problem| LabelsError::Image { image, problem })
        };
        self.rows.iter().map(image).collect()
    }

    fn column(&self, name: &str) -> Result<usize, LabelsError> {
        self.columns
            .iter()
            .position(|column| column == name)
            .ok_or_else(|| LabelsError::Column {
                file: self.file.clone(),
                column: name.to_owned(),
            })
    }

    fn value(&self, row: &Row, column: &str, problem: &'static str) -> LabelsError {
        let value = self.column(column).ok().and_then(|column| row.values.get(column));
        LabelsError::Value {
            file: self.file.clone(),
            line: row.line,
            column: column.to_owned(),
            value: value.unwrap_or_default().to_owned(),
            problem,
        }
    }
}

/// Whether `id` names a file in a folder, and not one elsewhere.
fn is_file_name(id: &str) -> bool {
    let mut components = Path::new(id).components();
    matches!((components.next(), components.next()), (Some(Component::Normal(name)), None) if name == id)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accuracy::{Accuracy, Tally};
    use std::fs;

    const HEAD: &str = "id,class,average_speed,angular_momentum,radial_variance_x20,scatter,group_rotation\n";

    /// Writes a CSV file of these lines and reads it.
    fn read(lines: &str) -> Result<Labels, LabelsError> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("labels.csv");
        fs::write(&file, lines).unwrap();
        Labels::read(file)
    }

    #[track_caller]
    fn check_refused(lines: &str, said: &str) {
        let features = read(lines).and_then(|labels| labels.absolute_features());
        let error = features.unwrap_err().to_string();
        assert!(error.contains(said), "{error}\nnot {said:?}");
    }

    #[test]
    fn rows_with_a_class_are_taken() {
        let labels = read(&format!(
            "{HEAD}7,ring,1,-2,3,-0.5,0\n8,,,,,,\n\"9\",\"clump\",5,4,3,2,1\n"
        ))
        .unwrap();
        assert_eq!(labels.classes().collect::<Vec<_>>(), ["ring", "clump"]);
        let features = labels.absolute_features().unwrap();
        assert_eq!(features, [[1.0, 2.0, 3.0, 0.5, 0.0], [5.0, 4.0, 3.0, 2.0, 1.0]]);
    }

    #[test]
    fn errors_name_line_and_column() {
        check_refused("id,klass\n1,ring\n", "line 1: there is no column \"class\"");
        check_refused(
            "id,class\n1,ring\n",
            "line 1: there is no column \"average_speed\"",
        );
        check_refused(
            &format!("{HEAD}1,ring,0,0,fast,0,0\n"),
            "line 2, column \"radial_variance_x20\": \"fast\" is",
        );
        check_refused(
            &format!("{HEAD}1,ring,0,0,0,0,NaN\n"),
            "column \"group_rotation\": \"NaN\" is not a finite",
        );
        check_refused(
            &format!("{HEAD}1,,,,,,\n1,ring,0,0,0,0,0\n"),
            "line 3, column \"id\": \"1\" is there twice",
        );
        check_refused(
            &format!("{HEAD}../1,ring,0,0,0,0,0\n"),
            "\"../1\" is not the name of an image",
        );
        check_refused(&format!("{HEAD}1,ring\n"), "line: 2");
        check_refused(&format!("{HEAD}1,,,,,,\n"), "no row has a class");
        check_refused("", "no column \"id\"");
        assert!(
            Labels::read("/nowhere.csv")
                .unwrap_err()
                .to_string()
                .starts_with("/nowhere.csv: ")
        );
    }

    /// Figures that were found independently of this code.
    #[test]
    fn hand_crafted_features_have_the_known_accuracy() {
        let check = |set: &str, not_random: [u64; 2], every: [u64; 2], percent: [f64; 2]| {
            let file = format!(
                "{}/../tests/labelled/{set}/validation.csv",
                env!("CARGO_MANIFEST_DIR")
            );
            let labels = Labels::read(file).unwrap();
            let features = labels
                .absolute_features()
                .unwrap()
                .into_iter()
                .map(|features| features.to_vec());
            let accuracy = Accuracy::measure(&labels.classes().zip(features).collect::<Vec<_>>());
            let [not_random, every] =
                [not_random, every].map(|[correct, triplets]| Tally { correct, triplets });
            assert_eq!(
                (accuracy.anchor_not_random(), accuracy.every_anchor()),
                (not_random, every),
                "{set}"
            );
            let rounded = |tally: Tally| (tally.percent().unwrap() * 100.0).round() / 100.0;
            assert_eq!([rounded(not_random), rounded(every)], percent, "{set}");
        };
        check(
            "single_sensor",
            [552_164, 661_752],
            [1_058_671, 1_495_092],
            [83.44, 70.81],
        );
        check(
            "two_sensor",
            [166_592, 222_408],
            [856_806, 1_394_760],
            [74.90, 61.43],
        );
    }
}

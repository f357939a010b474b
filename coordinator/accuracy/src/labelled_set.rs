//! Labelled sets: a label file with pictures beside it, or with the data to simulate the behaviours again.

use super::grey_image::pixels;
use murmuration_files::{InputKind, read_bytes};
use murmuration_model::csv_file::CsvError;
use murmuration_model::labels::{Answer, ClassKey, LabelFile, LabelFileError, Newest, Row};
use murmuration_onnx::ImageShape;
use murmuration_sim::evaluate::Evaluator;
use murmuration_swarm::{Class, Features, ImageFormat, Invalid};
use rayon::prelude::*;
use std::{
    collections::BTreeMap,
    path::{Component, Path, PathBuf},
};

mod swarms;

pub use swarms::Swarm;

/// The behaviours of a label file that have a class from an annotator other than the synthetic one, each once.
#[derive(Debug, Clone)]
pub struct LabelledSet {
    file: LabelFile,
    behaviours: Vec<Behaviour>,
    synthetic: u64,
}

#[derive(Debug, Clone)]
struct Behaviour {
    /// The position of the behaviour's row.
    row: usize,
    id: String,
    class: String,
    time_ms: u64,
}

impl LabelledSet {
    /// Reads a file. Ignores rows without a class, rows with `not sure` or `skip`, and answers of the synthetic annotator. If
    /// several annotators labelled a behaviour, only the newest label counts; of equally new labels, the last in the file. The
    /// judge's classes get the judge's spelling; other classes keep their first spelling.
    ///
    /// # Errors
    /// If the file cannot be read, lacks the column `class` or both `index` and `id`, has two answers of one annotator about one
    /// behaviour and no times that tell which is newer, or has no row with a class.
    pub fn read(path: impl Into<PathBuf>) -> Result<Self, LabelFileError> {
        let path = path.into();
        let text = read_bytes(&path, InputKind::Labels).map_err(|error| CsvError::Unreadable {
            path: path.clone(),
            error: error.to_string(),
        })?;
        let file = LabelFile::parse(&path, &text)?;
        let (behaviours, synthetic) = behaviours(&file)?;
        match (behaviours.is_empty(), synthetic) {
            (true, 0) => Err(LabelFileError::NoClass(path)),
            (true, rows) => Err(LabelFileError::NoPerson { path, rows }),
            (false, _) => Ok(Self {
                file,
                behaviours,
                synthetic,
            }),
        }
    }

    pub fn path(&self) -> &Path {
        self.file.path()
    }

    /// Number of ignored rows in which the synthetic annotator gave a class.
    pub const fn synthetic(&self) -> u64 {
        self.synthetic
    }

    /// The ids of the behaviours, in the file's order.
    pub fn ids(&self) -> impl Iterator<Item = &str> {
        self.behaviours.iter().map(|behaviour| behaviour.id.as_str())
    }

    /// The classes, one for each behaviour, in the file's order.
    pub fn classes(&self) -> impl Iterator<Item = &str> {
        self.behaviours.iter().map(|behaviour| behaviour.class.as_str())
    }

    /// The patterns that annotators saw in each behaviour, in the file's order: the text of the column `pattern`, in which `|`
    /// separates patterns. Empty if the annotators saw no pattern or the file lacks the column.
    pub fn patterns(&self) -> impl Iterator<Item = &str> {
        self.rows().map(|(_, row)| row.cell("pattern"))
    }

    /// Whether the file has the columns to simulate each behaviour again: its controller, and the seed of its start.
    pub fn can_be_simulated(&self) -> bool {
        self.file.has("seed") && self.file.has_controllers()
    }

    /// The absolute values of the five hand-crafted features of each behaviour, which the authors also compare: the direction in
    /// which a swarm turns does not matter.
    ///
    /// # Errors
    /// If a column is missing, or a value is not a finite number.
    pub fn absolute_features(&self) -> Result<Vec<Features>, LabelFileError> {
        let features = self.rows().map(|(_, row)| row.features());
        features.map(|features| Ok(features?.map(f64::abs))).collect()
    }

    /// Reads the image of each behaviour, the grey PNG `folder/ID.png` with 8 bits per pixel, for an embedder of `images`. The
    /// rows of the PNG are axis 0 (x).
    ///
    /// # Errors
    /// Names the first image that is missing, has another format, or is not [taken](ImageShape::takes) by the embedder.
    pub fn images(&self, folder: &Path, images: ImageShape) -> Result<Vec<Vec<u8>>, LabelFileError> {
        let image = |(behaviour, row): (&Behaviour, Row<'_>)| {
            if !is_file_name(&behaviour.id) {
                return Err(row.refuse_behaviour("the name of an image").into());
            }
            let image = folder.join(format!("{}.png", behaviour.id));
            pixels(&image, images).map_err(|problem| LabelFileError::Image { image, problem })
        };
        self.rows().map(image).collect()
    }

    /// Simulates each behaviour again for an embedder that takes `images`; [`LabelledSet::swarms`] explains `starts`.
    ///
    /// # Errors
    /// If a column is missing, a value is out of range, or an embedder of `images` does not take the file's pictures.
    pub fn simulated_images(
        &self,
        images: ImageShape,
        starts: Option<&Path>,
    ) -> Result<Vec<Vec<u8>>, LabelFileError> {
        let rows: Vec<_> = self
            .rows()
            .map(|(_, row)| row)
            .zip(self.swarms(starts)?)
            .collect();
        let image = |(row, swarm): &(Row<'_>, Swarm)| -> Result<_, CsvError> {
            let Swarm {
                controller,
                start,
                world,
            } = swarm;
            let format = row.image_format(world, controller.model())?;
            check_images(&format, images).map_err(|error| row.refused(error))?;
            let evaluated = Evaluator::new(world, &format)
                .and_then(|mut evaluator| evaluator.evaluate(controller, start));
            Ok(evaluated.map_err(|error| row.refused(error))?.into_image())
        };
        Ok(rows.par_iter().map(image).collect::<Result<_, _>>()?)
    }

    /// Each behaviour with its row.
    fn rows(&self) -> impl Iterator<Item = (&Behaviour, Row<'_>)> {
        let rows = self.behaviours.iter();
        rows.filter_map(|behaviour| Some((behaviour, self.file.row(behaviour.row)?)))
    }
}

/// Checks that an embedder of `images` takes pictures in `format`.
fn check_images(format: &ImageFormat, images: ImageShape) -> Result<(), Invalid> {
    let pictures = ImageShape::from(format.shape());
    if images.takes(pictures) {
        return Ok(());
    }
    let allowed = format!("that of the embedder's images, {images}");
    Err(match pictures.channels == images.channels {
        true => Invalid::new("resolution", format.resolution(), format!("at most {allowed}")),
        false => Invalid::new("channels", format.channels_name(), allowed),
    })
}

/// The behaviours to which an annotator of the file gave a class, in the order of their first rows; and the number of rows in
/// which the synthetic annotator gave a class.
fn behaviours(file: &LabelFile) -> Result<(Vec<Behaviour>, u64), LabelFileError> {
    let known = Class::ALL.map(|class| (ClassKey::from(class.name()), class.name().to_owned()));
    let mut spelled: BTreeMap<ClassKey, String> = known.into_iter().collect();
    let mut behaviours: Vec<Behaviour> = Vec::new();
    let mut places: BTreeMap<&str, usize> = BTreeMap::new();
    let mut synthetic = 0;
    for newest in file.newest(|row| Ok(row.cell("annotator").to_owned()))? {
        let Newest { place, row, .. } = newest;
        let Answer::Class(class) = newest.answer else {
            continue;
        };
        if row.is_synthetic() {
            synthetic += 1;
            continue;
        }
        let spelled = spelled.entry(class.key()).or_insert_with(|| class.to_string());
        let labelled = Behaviour {
            row: place,
            id: row.behaviour().to_owned(),
            class: spelled.clone(),
            time_ms: newest.time_ms,
        };
        match places.get(row.behaviour()) {
            None => {
                places.insert(row.behaviour(), behaviours.len());
                behaviours.push(labelled);
            }
            Some(&before) if behaviours[before].time_ms <= labelled.time_ms => behaviours[before] = labelled,
            Some(_) => {}
        }
    }
    Ok((behaviours, synthetic))
}

/// Whether `id` is a plain file name, without a path.
fn is_file_name(id: &str) -> bool {
    let mut components = Path::new(id).components();
    matches!((components.next(), components.next()), (Some(Component::Normal(name)), None) if name == id)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Accuracy, Tally};
    use murmuration_swarm::PictureShape;
    use std::fs;

    const HEAD: &str = "id,class,average_speed,angular_momentum,radial_variance_x20,scatter,group_rotation\n";

    /// Writes `lines` to a CSV file and reads this file.
    fn read(lines: &str) -> Result<LabelledSet, LabelFileError> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("labels.csv");
        fs::write(&file, lines).unwrap();
        LabelledSet::read(file)
    }

    #[track_caller]
    fn check_refused(lines: &str, expected: &str) {
        let features = read(lines).and_then(|labels| labels.absolute_features());
        let error = features.unwrap_err().to_string();
        assert!(error.contains(expected), "{error}\nnot {expected:?}");
    }

    #[test]
    fn rows_with_a_class_are_taken() {
        let labels = read(&format!(
            "{HEAD}7,ring,1,-2,3,-0.5,0\n8,,,,,,\n\"9\",\"'=clump\",5,4,3,2,1\n"
        ))
        .unwrap();
        assert_eq!(labels.classes().collect::<Vec<_>>(), ["ring", "=clump"]);
        let features = labels.absolute_features().unwrap();
        assert_eq!(features, [[1.0, 2.0, 3.0, 0.5, 0.0], [5.0, 4.0, 3.0, 2.0, 1.0]]);
    }

    #[test]
    fn errors_name_line_and_column() {
        check_refused("id,klass\n1,ring\n", "line 1: there is no column \"class\"");
        check_refused(
            "id,class\n1,ring\n",
            "line 1: there is no column \"average_speed\"; its columns are id, class",
        );
        check_refused(
            &format!("{HEAD}1,ring,0,0,fast,0,0\n"),
            "line 2: radial_variance_x20 = \"fast\": must be a finite number",
        );
        check_refused(
            &format!("{HEAD}1,ring,0,0,0,0,NaN\n"),
            "line 2: group_rotation = \"NaN\": must be a finite number",
        );
        check_refused(
            &format!("{HEAD}1,,,,,,\n1,ring,0,0,0,0,0\n1,clump,0,0,0,0,0\n"),
            "lines 3 and 4: one annotator has two answers about 1, and no times tell which is newer",
        );
        let elsewhere = read(&format!("{HEAD}../1,ring,0,0,0,0,0\n")).unwrap();
        let error = elsewhere
            .images(Path::new("images"), PictureShape::PAPER.into())
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("line 2: id = \"../1\": must be the name of an image"),
            "{error}"
        );
        check_refused(
            &format!("{HEAD}1,ring\n"),
            "line 2: the row has 2 cells, the header 7 columns",
        );
        check_refused(&format!("{HEAD}1,,,,,,\n"), "no row has a class");
        check_refused("", "the file is empty; its first line must name its columns");
        assert!(
            LabelledSet::read("/nowhere.csv")
                .unwrap_err()
                .to_string()
                .starts_with("/nowhere.csv: ")
        );
    }

    #[test]
    fn a_behaviour_of_several_annotators_counts_once_with_its_newest_class() {
        let rows = [
            ("7,ring,ana", 5),
            ("7,clump,ben", 4),
            ("8,Wall Following,ana", 1),
            ("8,skip,ben", 2),
            ("9,Ring,ana", 1),
            ("9,not sure,ben", 1),
            ("5,ring,ana", 3),
            ("5,clump,ben", 3),
        ];
        let rows = rows.map(|(row, second)| format!("{row},2026-11-21T12:00:0{second}Z\n"));
        let labels = read(&format!("id,class,annotator,time\n{}", rows.concat())).unwrap();
        assert_eq!(
            labels.classes().collect::<Vec<_>>(),
            ["ring", "wall_following", "ring", "clump"]
        );
    }

    #[test]
    fn what_the_synthetic_annotator_answered_is_no_persons_class() {
        let text = "id,class,annotator\n7,ring,ana\n7,clump,synthetic\n8,milling,synthetic\n9,skip,synthetic\n4,ring,ben\n";
        let labels = read(text).unwrap();
        assert_eq!(labels.classes().collect::<Vec<_>>(), ["ring", "ring"]);
        assert_eq!(labels.synthetic(), 2);
        check_refused(
            "id,class,annotator\n7,ring,synthetic\n8,ring,\"Synthetic\"\n",
            "no row has a class by an annotator other than `synthetic`, which gave 2 classes",
        );
    }

    #[test]
    fn what_is_not_separated_by_commas_or_has_an_open_quote_says_so() {
        check_refused(
            "id;class;annotator\n7;ring;ana\n",
            "line 1: the columns are separated by semicolons; save the file with commas",
        );
        check_refused(
            "id\tclass\n7\tring\n",
            "line 1: the columns are separated by tabs",
        );
        check_refused(
            "id,class\n7,ring\n8,\"clump\n",
            "line 3: a cell begins with a quote but does not end with one",
        );
    }

    /// The expected figures were computed independently of this code.
    #[test]
    fn hand_crafted_features_have_the_known_accuracy() {
        let check = |set: &str, not_random: [u64; 2], every: [u64; 2], percent: [f64; 2]| {
            let file = format!(
                "{}/../../tests/labelled/{set}/validation.csv",
                env!("CARGO_MANIFEST_DIR")
            );
            let labels = LabelledSet::read(file).unwrap();
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

//! Reads answers from a [`LabelFile`], and writes answers in its format.
//!
//! This module handles text, not files.

use super::{
    Annotator, LabelFile, LabelFileError,
    columns::settings,
    file::{ROBOTS, Row},
    to_cell,
};
use crate::{
    Timestamp,
    csv_file::{ColumnNames, CsvError, FIRST_INEXACT},
};
use murmuration_proto::v1;
use murmuration_swarm::{CampaignSpec, CapabilityModel, Controller, FEATURE_NAMES, Invalid, Preset, counted};
use std::path::Path;

pub const ANSWER_COLUMNS: [&str; 4] = ["index", "class", "annotator", "time"];

/// The columns that can have other names in the files of other tools.
const NAMED_COLUMNS: [&str; 5] = ["index", "class", "annotator", "time", "seed"];

/// A file of answers, parsed and checked.
#[derive(Debug)]
pub struct Table {
    file: LabelFile,
    /// Each answer with the place of its row.
    answers: Vec<(usize, v1::Answer)>,
}

/// An answer, and the individual that it is about.
#[derive(Debug, Clone, Copy)]
pub struct Labelled<'a> {
    pub answer: &'a v1::Answer,
    pub individual: &'a v1::Individual,
}

impl Table {
    /// Reads the answers in the text of the file at `path`; rows without a class are skipped. `annotator` is the annotator for
    /// rows that name no annotator.
    ///
    /// # Errors
    /// If the text is not CSV, a column or a value is missing or not allowed, an annotator has two answers about an individual and no
    /// times tell which is newer, a bare column `id` identifies the individuals, or no row has a class.
    pub fn parse(path: &Path, text: &[u8], annotator: Option<&Annotator>) -> Result<Self, LabelFileError> {
        Self::parse_named(path, text, annotator, ColumnNames::default())
    }

    /// As [`Table::parse`], for a file whose columns have the names `names`.
    ///
    /// # Errors
    /// As [`Table::parse`].
    pub fn parse_named(
        path: &Path,
        text: &[u8],
        annotator: Option<&Annotator>,
        names: ColumnNames,
    ) -> Result<Self, LabelFileError> {
        names
            .expect(&NAMED_COLUMNS)
            .map_err(|error| CsvError::Unreadable {
                path: path.to_owned(),
                error: error.to_string(),
            })?;
        let file = LabelFile::read(path, text, names)?;
        let newest = file.newest(|row| row.annotator(annotator))?;
        Self::refuse_ids(&file)?;
        file.need_classes()?;
        let mut answers = Vec::new();
        for newest in newest {
            let answer = v1::Answer {
                index: newest.row.index()?,
                answer: newest.answer.to_string(),
                annotator: newest.annotator.to_string(),
                time_ms: newest.time_ms,
            };
            answers.push((newest.place, answer));
        }
        if answers.is_empty() {
            return Err(LabelFileError::NoClass(path.to_owned()));
        }
        Ok(Self { file, answers })
    }

    /// Checks that all answers are about individuals of an archive of `len` individuals.
    ///
    /// # Errors
    /// The error names the first answer whose index is beyond the archive.
    pub fn check_indices(&self, campaign: &str, len: u64) -> Result<(), LabelFileError> {
        let allowed = || {
            let individuals = counted(len, "individual");
            format!("the index of one of the {individuals} in the archive of {campaign}")
        };
        self.check(|_, answer| Ok((answer.index >= len).then(&allowed)))
    }

    /// Refuses a file whose only hint at individuals is a column `id`, which other tools use for numbers of their own.
    ///
    /// # Errors
    /// [`LabelFileError::OnlyIds`].
    fn refuse_ids(file: &LabelFile) -> Result<(), LabelFileError> {
        match file.has_only_ids() {
            false => Ok(()),
            true => Err(LabelFileError::OnlyIds {
                path: file.path().to_owned(),
                columns: file.columns(),
                has_pictures: file.rows().any(|row| row.picture().is_some()),
            }),
        }
    }

    /// Whether the file identifies individuals of a campaign of `model` by more than their indices.
    pub fn describes(&self, model: &CapabilityModel) -> bool {
        self.file.has("seed") || self.has_controllers(model)
    }

    /// Whether the file has controllers: of the paper's robots, with one sensor or two, or of `model`.
    fn has_controllers(&self, model: &CapabilityModel) -> bool {
        let genes = model.gene_names();
        self.file.has_controllers() || genes.iter().any(|gene| self.file.has(gene))
    }

    /// Checks that the robots, controllers and seeds in the file, if the file has them, match the individuals in the archive of
    /// `campaign`. The campaign is of `model`, and `individual` looks up the campaign's individuals.
    ///
    /// # Errors
    /// The error names the first individual that differs: the file then belongs to another archive.
    pub fn check_individuals<'a>(
        &self,
        campaign: &str,
        model: &CapabilityModel,
        individual: impl Fn(u64) -> Option<&'a v1::Individual>,
    ) -> Result<(), LabelFileError> {
        let has_controller = self.has_controllers(model);
        let has_seed = self.file.has("seed");
        self.check(|row, answer| {
            let found = individual(answer.index);
            let seed = row.cell("seed");
            let is_own = |found: &v1::Individual| seed == found.seed.to_string();
            let is_rounded = has_seed && !found.is_some_and(is_own) && is_rounded(seed);
            let same = match found {
                None => false,
                Some(found) => {
                    (!has_controller || is_of(&row.controller_in(model)?, model, &found.controller))
                        && !is_rounded
                        && (!has_seed || row.seed()? == found.seed)
                }
            };
            Ok((!same).then(|| match is_rounded {
                true => format!(
                    "an individual of {campaign} with the seed {}: a spreadsheet has rounded it; import the file with the column \
                     seed as text, or leave this column out",
                    row.cell("seed")
                ),
                false => {
                    format!("an individual of {campaign} with this controller and seed: the file belongs to another archive")
                }
            }))
        })
    }

    /// Refuses the first answer for which `objection` returns a text. The text of an objection describes the allowed indices.
    fn check(
        &self,
        objection: impl Fn(Row<'_>, &v1::Answer) -> Result<Option<String>, LabelFileError>,
    ) -> Result<(), LabelFileError> {
        for (place, answer) in &self.answers {
            let Some(row) = self.file.row(*place) else {
                continue;
            };
            if let Some(allowed) = objection(row, answer)? {
                return Err(row
                    .refused(Invalid::new(self.file.behaviour_column(), answer.index, allowed))
                    .into());
            }
        }
        Ok(())
    }

    pub fn into_answers(self) -> Vec<v1::Answer> {
        self.answers.into_iter().map(|(_, answer)| answer).collect()
    }
}

/// Whether `cell` has a seed as other tools round it: to 15 digits, or to a floating-point number with all its digits or the
/// fewest that tell it from others. A few seeds look like this by chance.
fn is_rounded(cell: &str) -> bool {
    let Ok(number) = cell.parse::<u128>() else {
        return cell
            .parse::<f64>()
            .is_ok_and(|number| number >= FIRST_INEXACT as f64);
    };
    let unit = 10_u128.pow((cell.len() as u32).saturating_sub(15).min(30));
    let float = number as f64;
    let is_float = float as u128 == number || float.to_string().parse() == Ok(number);
    number >= u128::from(FIRST_INEXACT) && (number.is_multiple_of(unit) || is_float)
}

/// Whether a controller has these genes, and its robots are those of `model`. For a preset, the size of the bodies does not
/// matter, because a file can omit this size.
fn is_of(controller: &Controller, model: &CapabilityModel, genes: &[f64]) -> bool {
    let own = controller.model();
    let same_robots = own == model || (model.preset().is_some() && own.preset() == model.preset());
    same_robots && controller.genes() == genes
}

/// The cells of an answer for the columns [`ANSWER_COLUMNS`], which all tables of answers share.
pub fn answer_row(index: u64, answer: &str, annotator: &str, time_ms: u64) -> [String; 4] {
    [
        index.to_string(),
        to_cell(answer).into_owned(),
        to_cell(annotator).into_owned(),
        Timestamp::from_ms(time_ms).to_string(),
    ]
}

/// Writes answers about a campaign as text that [`LabelFile::parse`] reads. Each row has the individual's seed, controller and
/// features, and the fields of its world and picture that are not the paper's.
///
/// # Errors
/// If the answers cannot be written as CSV.
pub fn to_csv<'a>(
    spec: &CampaignSpec,
    labels: impl Iterator<Item = Labelled<'a>>,
) -> Result<Vec<u8>, csv::Error> {
    let model = spec.model();
    let genes = model.gene_names();
    let robots = match model.preset() {
        Some(Preset::SingleSensor | Preset::TwoSensor) => None,
        Some(Preset::Flockbots | Preset::TurboPi) | None => Some((ROBOTS, model.to_line())),
    };
    let settings = settings(spec.world(), *spec.image());
    let differing: Vec<_> = settings.into_iter().chain(robots).collect();
    let genes = genes.iter().map(String::as_str);
    let named = ANSWER_COLUMNS.into_iter().chain(["seed"]).chain(genes);
    let named = named.chain(FEATURE_NAMES);
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(named.chain(differing.iter().map(|(name, _)| *name)))?;
    for Labelled { answer, individual } in labels {
        let own = answer_row(answer.index, &answer.answer, &answer.annotator, answer.time_ms);
        let numbers = individual.controller.iter().chain(&individual.features);
        let settings = differing.iter().map(|(_, value)| value.clone());
        let own = own.into_iter().chain([individual.seed.to_string()]);
        writer.write_record(own.chain(numbers.map(f64::to_string)).chain(settings))?;
    }
    writer.into_inner().map_err(|error| error.into_error().into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    fn read_text(text: &str, annotator: Option<&str>) -> Result<Table, String> {
        let annotator = annotator.map(|name| name.parse::<Annotator>().unwrap());
        Table::parse(Path::new("labels.csv"), text.as_bytes(), annotator.as_ref())
            .map_err(|error| error.to_string())
    }

    #[track_caller]
    fn check_refused(text: &str, expected: &str) {
        let error = read_text(text, None).unwrap_err();
        assert!(error.contains(expected), "{error}\nnot {expected:?}");
    }

    #[test]
    fn rows_with_a_class_are_read_whatever_other_columns_there_are() {
        let table = read_text(
            "x,class,index,annotator\n1,ring,7,ana\n2,,8,\n3,\"not sure\",9.0, \n4,None,10,\n",
            Some("ben"),
        );
        let answers = table.unwrap().into_answers();
        let read: Vec<_> = answers
            .iter()
            .map(|answer| (answer.index, answer.answer.as_str(), answer.annotator.as_str()))
            .collect();
        assert_eq!(read, [(7, "ring", "ana"), (9, "not sure", "ben")]);
    }

    #[test]
    fn a_bad_row_is_named() {
        let head = "index,class,annotator,time\n1,ring,ana,1970-01-01T00:00:00.005Z\n";
        check_refused(
            "index,class,annotator\n1,ring,ana\nx,ring,ana\n",
            "line 3: index = \"x\": must be a whole number",
        );
        check_refused(
            &format!("{head}x,ring,ana,\n"),
            "line 3: index = \"x\": must be a whole number",
        );
        check_refused(&format!("{head}2,ring,,5\n"), "line 3: annotator is missing");
        check_refused(
            &format!("{head}2,ring,ana,1763700000000\n"),
            "line 3: time = \"1763700000000\": must be a time such as 2026-11-21T12:00:00Z",
        );
        check_refused(
            &format!("{head}2,{},ana,5\n", "x".repeat(65)),
            "must be 1 to 64 characters",
        );
        check_refused(
            &format!("{head}\r\n\n2,ring\n"),
            "line 5: the row has 2 cells, the header 4 columns",
        );
        check_refused(&format!("{head}\n2,\"a\nb\",ana,\n"), "line 4: class = \"a\\nb\"");
        check_refused(
            "index,klass\n1,ring\n",
            "line 1: there is no column \"class\"; its columns are index, klass",
        );
        check_refused(
            "index,class,index\n1,ring,2\n",
            "there is more than one column \"index\"",
        );
        check_refused("class\nring\n", "there is no column \"index\"");
        check_refused("index,class\n1,\n", "no row has a class");
    }

    #[test]
    fn a_file_of_another_archive_is_refused() {
        let individual = |controller: [f64; 4], seed| v1::Individual {
            controller: controller.to_vec(),
            seed,
            ..v1::Individual::default()
        };
        let archive = BTreeMap::from([(3, individual([0.1, 0.2, 0.3, 0.4], 7))]);
        let check = |row: &str| {
            let text = format!("seed,v1,v2,v3,v4,id,class,annotator\n{row},ring,ana\n");
            let table = read_text(&text, None).unwrap();
            assert!(table.describes(&Preset::SingleSensor.into()));
            table.check_individuals("small-1", &Preset::SingleSensor.into(), |index| {
                archive.get(&index)
            })
        };
        assert_eq!(check("7,0.1,0.2,0.3,0.4,3"), Ok(()));
        for other in [
            "8,0.1,0.2,0.3,0.4,3",
            "7,0.1,0.2,0.3,0.5,3",
            "7,0.1,0.2,0.3,0.4,4",
        ] {
            let message = check(other).unwrap_err().to_string();
            assert!(
                message.contains("line 2: id = ") && message.contains("to another archive"),
                "{message}"
            );
        }
        assert!(
            !read_text("index,class,annotator\n3,ring,ana\n", None)
                .unwrap()
                .describes(&Preset::SingleSensor.into())
        );
    }

    #[test]
    fn a_column_of_ids_is_no_index_unless_a_seed_or_controller_shows_it() {
        let ids = "id,class,annotator\n4,ring,ana\n";
        check_refused(
            ids,
            "line 1: the column \"id\" may have the numbers of another tool: nothing beside it shows that these are indices of \
             individuals (its columns are id, class, annotator). --columns index=NAME names the column of the indices",
        );
        let pictured = "id,choice,annotator,image\n4,ring,ana,/data/ab12cd34-00003.png\n";
        check_refused(
            pictured,
            "; --columns index=image takes the numbers at the ends of the pictures' names",
        );
        let named = |text: &str, columns: &str| {
            let table = Table::parse_named(
                Path::new("t.csv"),
                text.as_bytes(),
                None,
                columns.parse().unwrap(),
            );
            table
                .map(|table| table.into_answers()[0].index)
                .map_err(|error| error.to_string())
        };
        assert_eq!(named(ids, "index=id"), Ok(4));
        assert_eq!(named(pictured, "index=image,class=choice"), Ok(3));
        let other = named(pictured, "index=id,class=choice").unwrap_err();
        assert!(
            other.contains(
                "id = \"4\": must be 3, the number in the name of the picture \"/data/ab12cd34-00003.png\""
            ),
            "{other}"
        );
        let unknown = named(ids, "x=id").unwrap_err();
        assert!(unknown.contains("columns = \"x\""), "{unknown}");
        // The format of a picture, as our own files have it, is no name.
        let own = "index,class,annotator,image\n4,ring,ana,{ resolution = 100 }\n";
        assert_eq!(named(own, "index=index"), Ok(4));
    }

    #[test]
    fn of_two_answers_of_an_annotator_the_newer_counts_whatever_their_order() {
        let [early, late] = ["2026-11-20T10:00:00Z", "2026-11-20T10:00:01Z"];
        let answers = |rows: &[&str]| {
            let text = format!("index,class,annotator,time\n{}\n", rows.join("\n"));
            let answers = read_text(&text, None).map(Table::into_answers)?;
            Ok(answers
                .into_iter()
                .map(|answer| answer.answer)
                .collect::<Vec<_>>())
        };
        let (ring, clump) = (format!("3,ring,ana,{early}"), format!("3.0,clump,ana,{late}"));
        for rows in [[ring.as_str(), clump.as_str()], [clump.as_str(), ring.as_str()]] {
            assert_eq!(answers(&rows), Ok(vec!["clump".to_owned()]));
        }
        assert_eq!(answers(&[&ring, "3,clump,ben,", &ring]).unwrap().len(), 2);
        for twice in [
            ["3,ring,ana,", "3,clump,ana,"],
            ["03,ring,ana,", "3,clump,ana,"],
            [&ring, &ring.replace("ring", "clump")],
        ] {
            let refused: Result<_, String> = answers(&twice);
            assert_eq!(
                refused.unwrap_err(),
                "labels.csv, lines 2 and 3: one annotator has two answers about 3, and no times tell which is newer"
            );
        }
    }

    #[test]
    fn words_of_other_tools_are_no_classes() {
        for word in ["nan", "NA", "None", "null", "NaN", "<NA>"] {
            check_refused(
                &format!("index,class,annotator\n1,{word},ana\n"),
                "no row has a class",
            );
        }
        check_refused("id,class,annotator\n1,[1],ana\n", "the cell has JSON");
        check_refused(
            "index,class,annotator\n1,\"{\"\"choices\"\": [\"\"ring\"\", \"\"random\"\"]}\",ana\n",
            "must be one class; the cell has JSON, as some tools write for several choices",
        );
    }

    #[test]
    fn a_seed_that_a_spreadsheet_has_rounded_is_called_rounded() {
        let check = |seed: u64, cell: &str| {
            let text = format!("index,class,annotator,seed\n3,ring,ana,{cell}\n");
            let archived = v1::Individual {
                seed,
                ..v1::Individual::default()
            };
            let table = read_text(&text, None).unwrap();
            let checked =
                table.check_individuals("small-1", &Preset::SingleSensor.into(), |_| Some(&archived));
            checked.map_err(|error| error.to_string())
        };
        let seed = 14_601_381_875_911_695_384;
        assert_eq!(check(seed, "14601381875911695384"), Ok(()));
        for rounded in [
            "14601381875911700000",
            "1.46013818759117E+19",
            "14601381875911696000",
            "14601381875911696384",
        ] {
            let refused = check(seed, rounded).unwrap_err();
            assert!(refused.contains("a spreadsheet has rounded it"), "{refused}");
        }
        assert!(
            check(seed, "14601381875911695385")
                .unwrap_err()
                .contains("another archive")
        );
        // The seeds of other archives can be rounded too.
        assert!(
            check(9, "14601381875911700000")
                .unwrap_err()
                .contains("a spreadsheet has rounded it")
        );
        assert!(check(seed, "x").unwrap_err().contains("a whole number"));
        assert_eq!(check(7, "7.0"), Ok(()));
    }

    #[test]
    fn columns_have_the_names_of_an_export_or_of_the_labelled_sets() {
        let genes: Vec<f64> = (1..=9).map(|gene| f64::from(gene) / 10.0).collect();
        let archived = v1::Individual {
            controller: genes.clone(),
            ..v1::Individual::default()
        };
        let model = CapabilityModel::from(Preset::TwoSensor);
        let numbers: Vec<String> = genes.iter().map(f64::to_string).collect();
        let check = |header: &str| {
            let text = format!("{header},class,annotator\n5,{},ring,ana\n", numbers.join(","));
            let table = read_text(&text, None).unwrap();
            let controller = table.file.row(0).unwrap().controller().unwrap();
            assert_eq!(controller.genes(), genes);
            assert_eq!(controller.model().preset(), Some(Preset::TwoSensor));
            let found = |index| (index == 5).then_some(&archived);
            table.check_individuals("two-1", &model, found).unwrap();
        };
        check("id,v1,v2,v3,v4,v5,v6,v7,v8,theta");
        check(&format!("index,{}", model.gene_names().join(",")));
    }

    #[test]
    fn a_file_about_other_robots_is_refused() {
        let robots = |range| format!("robot.sensors = [{{ half_angle = 0.5, range = {range} }}]");
        let model = CampaignSpec::robots_from_toml(&robots(150)).unwrap().0;
        let other = CampaignSpec::robots_from_toml(&robots(999)).unwrap().0;
        let archived = v1::Individual {
            controller: vec![0.1, 0.2, 0.3, 0.4],
            ..v1::Individual::default()
        };
        let check = |header: &str, row: &str| {
            let text = format!("id,class,annotator,{header}\n0,ring,ana,{row}\n");
            let table = read_text(&text, None).unwrap();
            assert!(table.describes(&model));
            table
                .check_individuals("robot-1", &model, |_| Some(&archived))
                .is_ok()
        };
        let genes = "left_0,right_0,left_1,right_1";
        let quoted = |model: &CapabilityModel| model.to_line().replace('"', "\"\"");
        let row = |model: &CapabilityModel| format!("\"{}\",0.1,0.2,0.3,0.4", quoted(model));
        assert!(check(&format!("robots,{genes}"), &row(&model)));
        assert!(!check(&format!("robots,{genes}"), &row(&other)));
        assert!(check(genes, "0.1,0.2,0.3,0.4"));
        assert!(!check(genes, "0.1,0.2,0.3,0.5"));
        assert!(!check("v1,v2,v3,v4", "0.1,0.2,0.3,0.4"));
    }

    #[test]
    fn a_file_of_the_papers_other_robots_is_refused() {
        let models = Preset::PAPER.map(CapabilityModel::from);
        for (own, other) in [(0, 1), (1, 0)] {
            let genes = models[other].gene_names();
            let zeros = ",0".repeat(genes.len());
            let text = format!("index,class,annotator,{}\n0,ring,ana{zeros}\n", genes.join(","));
            let table = read_text(&text, None).unwrap();
            assert!(table.describes(&models[own]));
            let archived = v1::Individual {
                controller: vec![0.0; models[own].genes()],
                ..v1::Individual::default()
            };
            let checked = table.check_individuals("paper-1", &models[own], |_| Some(&archived));
            let message = checked.unwrap_err().to_string();
            assert!(message.contains("there is no column"), "{message}");
        }
    }

    #[test]
    fn robots_say_how_many_and_how_large_they_are() {
        let table = read_text(
            "id,class,annotator,robots\n0,ring,ana,\"{ model = \"\"turbopi\"\" }\"\n",
            None,
        )
        .unwrap();
        assert_eq!(table.file.row(0).unwrap().world().unwrap().radius(), 10.0);
    }

    /// The start of the year 10000, which RFC 3339 cannot express.
    const LAST_MS: u64 = 253_402_300_800_000;

    fn answers() -> impl Strategy<Value = Vec<v1::Answer>> {
        let word = || "[a-z=+@,\"' é-]{0,8}[a-z\"]";
        let answer =
            (any::<u64>(), word(), word(), 0..LAST_MS).prop_map(|(index, class, annotator, time_ms)| {
                v1::Answer {
                    index,
                    answer: class.trim().to_owned(),
                    annotator: annotator.trim().to_owned(),
                    time_ms,
                }
            });
        prop::collection::vec(answer, 1..20)
    }

    proptest! {
        #[test]
        fn what_is_written_reads_back(
            answers in answers(), genes in prop::collection::vec(-1.0..=1.0, 9), two in any::<bool>(),
            features in prop::collection::vec(-1e3..1e3, 5), seed in any::<u64>(), horizon in 1..2000_u32,
        ) {
            let model = if two { "model = \"two-sensor\"" } else { "robot.sensors = [{ half_angle = 0.5 }]" };
            let text = format!("{model}\nmethod = \"random\"\n[world]\nhorizon = {horizon}\npadding = 10.5\nnoise = {{ slip = 0.25, delay = 3 }}\nstart = {{ shape = \"disc\", radius = 30 }}\nobstacles = [{{ x = 9, y = 7, radius = 3 }}]");
            let spec = CampaignSpec::from_toml(&text).unwrap();
            let individual = v1::Individual {
                controller: genes[..spec.model().genes()].to_vec(),
                features: features.clone(),
                seed,
                ..v1::Individual::default()
            };
            let labelled = answers.iter().map(|answer| Labelled { answer, individual: &individual });
            let text = to_csv(&spec, labelled).unwrap();
            let table = Table::parse(Path::new("labels.csv"), &text, None).unwrap();
            for row in table.file.rows() {
                let formula = |column| row.cell(column).starts_with(['=', '+', '-', '@']);
                prop_assert!(!formula("class") && !formula("annotator"));
            }
            let row = table.file.row(0).unwrap();
            let controller = row.controller().unwrap();
            prop_assert_eq!(controller.genes(), individual.controller.as_slice());
            prop_assert_eq!(row.features().unwrap().to_vec(), features);
            prop_assert_eq!(row.seed(), Ok(seed));
            let world = row.world().unwrap();
            prop_assert_eq!(&world, spec.world());
            prop_assert_eq!(&row.image_format(&world, controller.model()).unwrap(), spec.image());
            prop_assert_eq!(table.into_answers(), answers);
        }
    }
}

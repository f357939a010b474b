//! The table of individuals, a row each; pictures are beside it.

use crate::{
    ExportError,
    columns::{
        Described as _, TableWriter, column, list, list_of, lists, lists_or_nulls, number_column, numbers,
        optional, optional_column, text_column, texts,
    },
};
use arrow_array::{
    Array as _, ArrayRef, ListArray, RecordBatch, StructArray,
    cast::AsArray as _,
    types::{Float32Type, Float64Type, UInt8Type, UInt32Type, UInt64Type},
};
use arrow_schema::{DataType, Field, Fields, Schema};
use murmuration_model::labels::ClassName;
use murmuration_proto::{CampaignSpec, FEATURE_NAMES, Starts, Verdict, v1};
use murmuration_store::{Trial, transfer::Member};
use std::{collections::BTreeMap, path::Path, sync::Arc};

/// The unit of each feature, in their order.
const FEATURE_UNITS: &str = "world units a step, world units a step, none, none, world units a step";

/// The columns of the table.
pub(crate) fn columns(spec: &CampaignSpec) -> Schema {
    let nullable = |name: &str, kind| Field::new(name, kind, true);
    Schema::new(vec![
        column("index", DataType::UInt64).about("place in the archive, from 0"),
        column("generation", DataType::UInt32).about("from 0"),
        column("genes", list_of(DataType::Float64))
            .about("the controller")
            .unit("wheel speeds in radians a unit of time, angles in radians, shares from 0 to 1")
            .names(&spec.model().gene_names()),
        column("features", list_of(DataType::Float64))
            .about("hand-crafted features: means over the last 100 steps, and over trials")
            .unit(FEATURE_UNITS)
            .names(&FEATURE_NAMES),
        nullable("embedding", list_of(DataType::Float32))
            .about("of the picture by the campaign's checkpoint, mean over trials; null without a checkpoint")
            .unit("latent space"),
        column("novelty_when_evaluated", DataType::Float64)
            .about("in the archive as it was after the individual's generation")
            .unit("behaviour space"),
        nullable("class", DataType::Utf8).about("the class that was given last; null where there is none"),
        column("seed", DataType::UInt64).about("of the first start; those of other starts follow from it"),
        nullable("cluster", DataType::UInt32)
            .about("from 1, as in taxonomy.parquet and on the pages; null unless the campaign is completed"),
        nullable("robust_trials", DataType::UInt8)
            .about("trials that are nearer to their own medoid than to any other; null with one start")
            .unit("trials"),
        Field::new("trials", DataType::List(Arc::new(trial_field())), false).about("one for each start"),
    ])
}

fn trial_field() -> Field {
    Field::new_list_field(DataType::Struct(trial_columns()), false)
}

fn trial_columns() -> Fields {
    Fields::from(vec![
        Field::new("seed", DataType::UInt64, false),
        Field::new("features", list_of(DataType::Float64), false),
        Field::new("embedding", list_of(DataType::Float32), true),
        Field::new("verdict", DataType::Utf8, true),
    ])
}

/// Adds individuals to the table, with the classes that they have.
pub(crate) fn write(
    table: &mut TableWriter,
    members: &[Member],
    classes: &BTreeMap<u64, ClassName>,
) -> Result<(), ExportError> {
    let rows = members.len();
    let individuals = || members.iter().map(|member| &member.individual);
    let genes: Vec<f64> = individuals()
        .flat_map(|one| one.controller.genes().to_vec())
        .collect();
    let features: Vec<f64> = individuals().flat_map(|one| one.features()).collect();
    let embeddings: Vec<f32> = individuals().flat_map(|one| one.embedding()).collect();
    let width = |values: usize| values / rows.max(1);
    let (gene_width, embedding_width) = (width(genes.len()), width(embeddings.len()));
    table.add(vec![
        number_column::<UInt64Type>(individuals().map(|one| one.index)),
        number_column::<UInt32Type>(individuals().map(|one| one.generation)),
        Arc::new(lists(
            number_column::<Float64Type>(genes.into_iter()),
            rows,
            gene_width,
        )),
        Arc::new(lists(
            number_column::<Float64Type>(features.into_iter()),
            rows,
            FEATURE_NAMES.len(),
        )),
        lists_or_nulls::<Float32Type>(embeddings, rows, embedding_width),
        number_column::<Float64Type>(individuals().map(|one| one.novelty)),
        text_column(individuals().map(|one| classes.get(&one.index).map(ClassName::as_str))),
        number_column::<UInt64Type>(individuals().map(|one| one.seed)),
        optional_column::<UInt32Type>(members.iter().map(|member| member.cluster.map(|place| place + 1))),
        optional_column::<UInt8Type>(members.iter().map(|member| member.robust_trials)),
        trials(members),
    ])
}

/// The column of trials.
fn trials(members: &[Member]) -> ArrayRef {
    let starts = members.first().map_or(0, |member| member.individual.trials.len());
    let seeds = members.iter().flat_map(|member| {
        let starts = Starts::new("trials", starts as u32).unwrap_or_default();
        starts
            .seeds(member.individual.seed)
            .take(starts.get())
            .collect::<Vec<_>>()
    });
    let trials: Vec<&Trial> = members
        .iter()
        .flat_map(|member| &member.individual.trials)
        .collect();
    let features = trials.iter().flat_map(|trial| trial.features);
    let embeddings: Vec<f32> = trials
        .iter()
        .flat_map(|trial| trial.embedding.iter().copied())
        .collect();
    let width = embeddings.len() / trials.len().max(1);
    let verdicts = trials.iter().map(|trial| trial.verdict.map(Verdict::name));
    let columns: Vec<ArrayRef> = vec![
        number_column::<UInt64Type>(seeds),
        Arc::new(lists(
            number_column::<Float64Type>(features),
            trials.len(),
            FEATURE_NAMES.len(),
        )),
        lists_or_nulls::<Float32Type>(embeddings, trials.len(), width),
        text_column(verdicts),
    ];
    let values: ArrayRef = Arc::new(StructArray::new(trial_columns(), columns, None));
    Arc::new(lists(values, members.len(), starts))
}

/// The columns of a row that follow from its other columns and the labels.
#[derive(Debug)]
pub(crate) struct DerivedColumns {
    generation: u32,
    features: Vec<f64>,
    embedding: Vec<f32>,
    class: Option<String>,
    seeds: Vec<u64>,
}

/// The individuals of some rows, without pictures.
pub(crate) fn read(
    path: &Path,
    rows: &RecordBatch,
) -> Result<Vec<(v1::ExportedIndividual, DerivedColumns)>, ExportError> {
    let indices = numbers::<UInt64Type>(rows, 0);
    let (generations, novelty) = (numbers::<UInt32Type>(rows, 1), numbers::<Float64Type>(rows, 5));
    let (genes, features) = (rows.column(2).as_list::<i32>(), rows.column(3).as_list::<i32>());
    let embeddings = rows.column(4).as_list::<i32>();
    let seeds = numbers::<UInt64Type>(rows, 7);
    let mut classes = texts(rows, 6);
    let mut places = optional::<UInt32Type>(rows, 8).zip(optional::<UInt8Type>(rows, 9));
    let all_trials = rows.column(10).as_list::<i32>();
    let mut individuals = Vec::with_capacity(rows.num_rows());
    for row in 0..rows.num_rows() {
        let (trials, starts) = trials_of(path, all_trials, row)?;
        let (cluster, robust) = places.next().unwrap_or_default();
        let individual = v1::ExportedIndividual {
            index: indices[row],
            controller: list::<Float64Type>(genes, row),
            seed: seeds[row],
            novelty: novelty[row],
            trials,
            // There is no cluster 0: it becomes one that no campaign has, which is refused.
            cluster: cluster.map(|number| number.wrapping_sub(1)),
            robust_trials: robust.map(Into::into),
        };
        let derived = DerivedColumns {
            generation: generations[row],
            features: list::<Float64Type>(features, row),
            embedding: list::<Float32Type>(embeddings, row),
            class: classes.next().flatten().map(str::to_owned),
            seeds: starts,
        };
        individuals.push((individual, derived));
    }
    Ok(individuals)
}

/// The trials of a row without pictures, and their seeds.
fn trials_of(
    path: &Path,
    all: &ListArray,
    row: usize,
) -> Result<(Vec<v1::Evaluation>, Vec<u64>), ExportError> {
    let trials = all.value(row);
    let trials = trials.as_struct();
    let seeds = trials.column(0).as_primitive::<UInt64Type>().values().to_vec();
    let (features, embeddings) = (
        trials.column(1).as_list::<i32>(),
        trials.column(2).as_list::<i32>(),
    );
    let verdicts = trials.column(3).as_string::<i32>();
    let verdict = |place: usize| match verdicts.is_valid(place) {
        false => Ok(0),
        true => {
            let name = verdicts.value(place);
            let found = Verdict::all().find(|verdict| verdict.name() == name);
            let damaged = || ExportError::damaged(path, format!("verdict {name:?} is none of the judge's"));
            found
                .map(|verdict| i32::from(verdict.number()))
                .ok_or_else(damaged)
        }
    };
    let trial = |place: usize| {
        Ok(v1::Evaluation {
            features: list::<Float64Type>(features, place),
            image: Vec::new(),
            embedding: list::<Float32Type>(embeddings, place),
            verdict: verdict(place)?,
        })
    };
    let found: Result<Vec<_>, ExportError> = (0..trials.len()).map(trial).collect();
    Ok((found?, seeds))
}

impl DerivedColumns {
    /// Checks them against the individual and the classes that were given.
    pub(crate) fn check(
        &self,
        path: &Path,
        member: &Member,
        classes: &BTreeMap<u64, ClassName>,
    ) -> Result<(), ExportError> {
        let individual = &member.individual;
        let bits = |features: &[f64]| features.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        let embedded = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        let starts = Starts::new("trials", individual.trials.len() as u32).unwrap_or_default();
        let seeds = starts.seeds(individual.seed).take(individual.trials.len());
        let wrong = if self.generation != individual.generation {
            "generation"
        } else if bits(&self.features) != bits(&individual.features()) {
            "features"
        } else if embedded(&self.embedding) != embedded(&individual.embedding()) {
            "embedding"
        } else if self.class.as_deref() != classes.get(&individual.index).map(ClassName::as_str) {
            "class"
        } else if !seeds.eq(self.seeds.iter().copied()) {
            "trials"
        } else {
            return Ok(());
        };
        let index = individual.index;
        let reason = format!(
            "individual {index}: its column `{wrong}` does not follow from its other columns and the labels"
        );
        Err(ExportError::damaged(path, reason))
    }
}

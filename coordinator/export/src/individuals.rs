//! The table of individuals, with one row per individual; another file has the pictures.

use crate::{
    ExportError,
    columns::{
        Described as _, TableWriter, column, list_of, lists, lists_or_nulls, number_column, optional_column,
        text_column,
    },
};
use arrow_array::{
    ArrayRef, StructArray,
    types::{Float32Type, Float64Type, UInt8Type, UInt32Type, UInt64Type},
};
use arrow_schema::{DataType, Field, Fields, Schema};
use murmuration_model::labels::ClassName;
use murmuration_store::{Trial, transfer::Member};
use murmuration_swarm::{CampaignSpec, FEATURE_NAMES, Starts, Verdict};
use std::{collections::BTreeMap, sync::Arc};

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
            .unit("left, right and turn: radians a unit of time; speed: world units a unit of time; angles: radians; shares: 0 to 1")
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
        nullable("class", DataType::Utf8).about("the class that was given last; null if nobody gave a class"),
        column("seed", DataType::UInt64).about("of the first start; it determines the seeds of the other starts"),
        nullable("cluster", DataType::UInt32)
            .about("from 1, as in taxonomy.parquet and on the pages; null outside the sample, and unless the campaign is completed"),
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

/// Adds individuals to the table; `classes` has the classes of those that were labelled.
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

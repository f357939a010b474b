//! Reads and checks study files.

mod message;
mod numbers;
mod recall;
#[cfg(test)]
mod tests;

use crate::{
    figure::{Figure, Measure},
    map_files, recall_curve,
    study::{Axis, Cell, Measures, Phase, Published, RandomBatches, Study},
    written,
};
use message::{AxisMessage, PhaseMessage, PublishedMessage, Seeds, StudyMessage};
use murmuration_model::labels::is_formula;
use murmuration_swarm::{
    CampaignName, CampaignSpec, Invalid, Preset, SpecFileError, Text, TomlError, read_toml, text,
};
use numbers::NumberAxis;
use std::{
    collections::{BTreeMap, BTreeSet},
    num::NonZeroU32,
    path::Path,
};
use toml::{Table, Value};

/// Most characters of the name of an axis, and of one of its values.
const NAME_CHARS: [usize; 2] = [32, 64];
/// Most axes, values of an axis, and replicates.
const MOST_AXES: usize = 8;
const MOST_VALUES: usize = 64;
const MOST_REPLICATES: u64 = 1000;
/// Why a study file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    #[error(transparent)]
    Syntax(#[from] TomlError),
    #[error(transparent)]
    Value(#[from] Invalid),
    #[error("the campaign with {cell}: {error}")]
    Cell { cell: String, error: Box<SpecFileError> },
}

impl Study {
    /// Reads a study file; if `quick` is true, with the changes of `[quick]`. Paths of label files are relative to `folder`.
    pub fn from_toml(text: &str, folder: &Path, quick: bool) -> Result<Self, StudyError> {
        let message: StudyMessage = read_toml(text)?;
        let message = message.made(quick)?;
        let axes = axes(&message.axes)?;
        let seeds = seeds(message.seeds.clone())?;
        let embedders = embedders(message.embedders, seeds.len())?;
        let mut study = Self {
            name: CampaignName::try_from(message.name.clone())?,
            measures: Measures {
                recall: recall::plan(&message)?,
                ..measures(&message, folder)?
            },
            published: message
                .published
                .iter()
                .map(|published| self::published(published, &axes))
                .collect::<Result<_, _>>()?,
            phase: message
                .phase
                .as_ref()
                .map(|given| phase(given, &axes, message.measures.as_deref()))
                .transpose()?,
            axes,
            seeds,
            embedders,
            cells: Vec::new(),
        };
        study.cells = cells(&study, &message)?;
        recall::check(&study)?;
        Ok(study)
    }
}

/// Every combination of the axes' values, in every replicate.
fn cells(study: &Study, message: &StudyMessage) -> Result<Vec<Cell>, StudyError> {
    let sizes = study.axes.iter().map(|axis| axis.values.len());
    let count = sizes.fold(study.seeds.len(), usize::saturating_mul);
    if count > Study::MAX_CELLS {
        let allowed = format!("at most {}", Study::MAX_CELLS);
        return Err(Invalid::new("the number of cells", count, allowed).into());
    }
    let mut rows: Vec<Vec<usize>> = vec![Vec::new()];
    for axis in &study.axes {
        let longer = |row: &Vec<usize>| -> Vec<Vec<usize>> {
            let places = 0..axis.values.len();
            places.map(|place| [row.as_slice(), &[place]].concat()).collect()
        };
        rows = rows.iter().flat_map(longer).collect();
    }
    let mut cells = Vec::with_capacity(count);
    for row in rows {
        let table = message.campaign_of(&row);
        for (replicate, &seed) in study.seeds.iter().enumerate() {
            cells.push(cell(study, &row, &table, replicate, seed)?);
        }
    }
    Ok(cells)
}

fn cell(
    study: &Study,
    values: &[usize],
    table: &Table,
    replicate: usize,
    seed: u64,
) -> Result<Cell, StudyError> {
    let failed = |error| cell_error(study, values, seed, error);
    for field in ["seed", "name"] {
        if table.contains_key(field) {
            let allowed = match field {
                "seed" => "absent: the study's `seeds` define it",
                _ => "absent: campaigns are named after their study",
            };
            return Err(failed(Invalid::new(field, "given", allowed).into()));
        }
    }
    let mut table = table.clone();
    table.insert("name".to_owned(), study.name.as_str().into());
    table.insert("seed".to_owned(), toml::Value::Integer(seed.cast_signed()));
    let spec = CampaignSpec::from_table(table).map_err(failed)?;
    if study.measures.which.contains(&Measure::Shares) && !spec.judges() {
        let allowed = "true: the measure \"shares\" counts the workers' verdicts";
        return Err(failed(Invalid::new("evaluation.judge", "false", allowed).into()));
    }
    Ok(Cell {
        values: values.to_vec(),
        replicate,
        spec,
    })
}

/// The error of a cell, with the cell's name.
fn cell_error(study: &Study, values: &[usize], seed: u64, error: SpecFileError) -> StudyError {
    let named = study.axes.iter().zip(study.names(values));
    let mut words: Vec<String> = named
        .map(|(axis, value)| format!("{} = {value}", axis.name))
        .collect();
    words.push(format!("seed = {seed}"));
    StudyError::Cell {
        cell: words.join(", "),
        error: Box::new(error),
    }
}

fn axes(messages: &[AxisMessage]) -> Result<Vec<Axis>, Invalid> {
    if messages.len() > MOST_AXES {
        return Err(Invalid::new(
            "axes",
            messages.len(),
            format!("at most {MOST_AXES} axes"),
        ));
    }
    let mut axes: Vec<Axis> = Vec::new();
    for message in messages {
        let name = axis_name(&message.name)?;
        if axes.iter().any(|axis| axis.name == name) {
            return Err(Invalid::new("axes.name", text::quoted(&name), "there once"));
        }
        if !(1..=MOST_VALUES).contains(&message.values.len()) {
            let allowed = format!("1 to {MOST_VALUES} values");
            return Err(Invalid::new(
                format!("axes.values of {name}"),
                message.values.len(),
                allowed,
            ));
        }
        let mut values = Vec::new();
        for value in &message.values {
            let value = text::name("axes.values.name", &value.name, NAME_CHARS[1])?;
            if message.about.is_none() && is_formula(&value) {
                let allowed =
                    "a text that no spreadsheet takes for a formula: not with = + - @ at its beginning";
                return Err(Invalid::new("axes.values.name", text::quoted(&value), allowed));
            }
            if values.contains(&value) {
                let allowed = format!("there once on the axis {name}");
                return Err(Invalid::new("axes.values.name", text::quoted(&value), allowed));
            }
            values.push(value);
        }
        let about = message.about.as_ref();
        let field = about.map(|about| about.field());
        if let Some((field, other)) = field.zip(axes.iter().find_map(|axis| same_field(axis, field))) {
            let allowed = format!("a field that the axis {other} does not set too");
            return Err(Invalid::new("axes.field", text::quoted(field), allowed));
        }
        axes.push(Axis {
            name,
            values,
            field: about.map(|about| about.field().to_owned()),
            numbers: about.map(NumberAxis::numbers).unwrap_or_default(),
        });
    }
    Ok(axes)
}

/// The name of the axis if the axis sets `field`, a table that contains `field`, or a field within `field`.
fn same_field<'a>(axis: &'a Axis, field: Option<&str>) -> Option<&'a str> {
    let (own, field) = (axis.field.as_deref()?, field?);
    let is_in = |inner: &str, outer: &str| {
        inner
            .strip_prefix(outer)
            .is_some_and(|rest| rest.starts_with('.'))
    };
    (own == field || is_in(own, field) || is_in(field, own)).then_some(axis.name.as_str())
}

/// The axes of the phase diagrams, which show shares.
fn phase(message: &PhaseMessage, axes: &[Axis], measures: Option<&[String]>) -> Result<Phase, Invalid> {
    let shares = Measure::Shares.name();
    if !measures
        .unwrap_or_default()
        .iter()
        .any(|measure| measure == shares)
    {
        let allowed = "absent: a study with phase diagrams has the measure \"shares\"";
        return Err(Invalid::new("phase", "given", allowed));
    }
    let place = |field: &str, name: &str| {
        let place = axes
            .iter()
            .position(|axis| axis.name == name && axis.field.is_some());
        place.ok_or_else(|| {
            let allowed = "the name of an axis with numbers";
            Invalid::new(format!("phase.{field}"), text::quoted(name), allowed)
        })
    };
    let x = place("x", &message.x)?;
    let y = message.y.as_deref().map(|name| place("y", name)).transpose()?;
    if y == Some(x) {
        let allowed = "another axis than phase.x";
        return Err(Invalid::new("phase.y", text::quoted(&message.x), allowed));
    }
    Ok(Phase { x, y })
}

/// Checks that a name can be a column of a table.
fn axis_name(name: &str) -> Result<String, Invalid> {
    let fits = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_';
    let columns = [
        &written::CELL[..],
        &written::MEDOID,
        &recall_curve::RICHNESS,
        &map_files::COLUMNS,
    ];
    let is_taken = columns.concat().contains(&name) || Figure::all().any(|figure| figure.name() == name);
    if (1..=NAME_CHARS[0]).contains(&name.len()) && name.chars().all(fits) && !is_taken {
        return Ok(name.to_owned());
    }
    let allowed = format!(
        "1 to {} lower-case letters, digits, '-' and '_', and not the name of another column",
        NAME_CHARS[0]
    );
    Err(Invalid::new("axes.name", text::quoted(name), allowed))
}

fn seeds(seeds: Option<Seeds>) -> Result<Vec<u64>, Invalid> {
    let allowed = format!("a number of replicates, 1 to {MOST_REPLICATES}, or a list of different seeds");
    match seeds {
        None => Ok(vec![1]),
        Some(Seeds::Replicates(replicates @ 1..=MOST_REPLICATES)) => Ok((1..=replicates).collect()),
        Some(Seeds::Replicates(replicates)) => Err(Invalid::new("seeds", replicates, allowed)),
        Some(Seeds::List(seeds)) => {
            let different: BTreeSet<u64> = seeds.iter().copied().collect();
            if seeds.is_empty() || different.len() < seeds.len() || seeds.len() as u64 > MOST_REPLICATES {
                return Err(Invalid::new("seeds", format!("{seeds:?}"), allowed));
            }
            Ok(seeds)
        }
    }
}

fn embedders(embedders: Option<u32>, replicates: usize) -> Result<Option<NonZeroU32>, Invalid> {
    let Some(given) = embedders else {
        return Ok(None);
    };
    let fits = NonZeroU32::new(given).filter(|embedders| embedders.get() as usize <= replicates);
    let allowed = format!("1 to {replicates}, the number of replicates");
    fits.map(Some)
        .ok_or_else(|| Invalid::new("embedders", given, allowed))
}

fn measures(message: &StudyMessage, folder: &Path) -> Result<Measures, Invalid> {
    let which = match &message.measures {
        None => BTreeSet::from([Measure::Behaviours, Measure::Search]),
        Some(names) => names
            .iter()
            .map(|name| name.parse())
            .collect::<Result<_, Invalid>>()?,
    };
    if which.is_empty() {
        return Err(Invalid::new("measures", "[]", "at least one"));
    }
    let given = message.behaviours.generations.unwrap_or(10);
    let generations = NonZeroU32::new(given).filter(|generations| generations.get() <= 1000);
    let random = match message.behaviours.random.as_deref() {
        None | Some("samples") => RandomBatches::Samples,
        Some("medoids") => RandomBatches::Medoids,
        Some(other) => {
            let allowed = "\"samples\" or \"medoids\"";
            return Err(Invalid::new("behaviours.random", text::quoted(other), allowed));
        }
    };
    let mut labelled = BTreeMap::new();
    for (model, files) in &message.accuracy {
        if model.parse::<Preset>().is_err() {
            let allowed = "the name of a robot such as \"single-sensor\"";
            return Err(Invalid::new("accuracy", text::quoted(model), allowed));
        }
        if files.is_empty() {
            return Err(Invalid::new(
                format!("accuracy.{model}"),
                "[]",
                "at least one file",
            ));
        }
        labelled.insert(
            model.clone(),
            files.iter().map(|file| folder.join(file)).collect(),
        );
    }
    if which.contains(&Measure::Accuracy) && labelled.is_empty() {
        let allowed = "label files for a robot: the measure \"accuracy\" needs some";
        return Err(Invalid::missing("accuracy", allowed));
    }
    Ok(Measures {
        which: which.into_iter().collect(),
        generations: generations
            .ok_or_else(|| Invalid::new("behaviours.generations", given, "a whole number from 1 to 1000"))?,
        random,
        labelled,
        recall: None,
    })
}

fn published(message: &PublishedMessage, axes: &[Axis]) -> Result<Published, Invalid> {
    let mut rows = BTreeMap::new();
    for (axis, value) in &message.rows {
        let names = || axes.iter().map(|axis| axis.name.as_str()).collect::<Vec<_>>();
        let place = axes.iter().position(|known| known.name == *axis);
        let place = place.ok_or_else(|| {
            let allowed = format!("by the axes {}", names().join(", "));
            Invalid::new("published.where", text::quoted(axis), allowed)
        })?;
        let values = &axes[place].values;
        let value = values.iter().position(|known| known == value).ok_or_else(|| {
            let allowed = format!("one of {}", values.join(", "));
            Invalid::new(format!("published.where.{axis}"), text::quoted(value), allowed)
        })?;
        rows.insert(place, value);
    }
    let mut figures = BTreeMap::new();
    for (name, &value) in &message.figures {
        let figure = name.parse().map_err(|error: Invalid| error.within("published"))?;
        if !value.is_finite() {
            let field = format!("published.figures.{name}");
            return Err(Invalid::new(field, value, "a finite number"));
        }
        figures.insert(figure, value);
    }
    Ok(Published {
        source: Text::line(&message.source).into(),
        rows,
        figures,
    })
}

/// Overrides the fields of `base` by the fields of `over`. A table that is in `base` and in `over` is merged recursively; any
/// other value is replaced.
fn lay_over(base: &mut Table, over: &Table) {
    for (name, value) in over {
        match (base.get_mut(name), value) {
            (Some(Value::Table(below)), Value::Table(above)) => lay_over(below, above),
            _ => {
                base.insert(name.clone(), value.clone());
            }
        }
    }
}

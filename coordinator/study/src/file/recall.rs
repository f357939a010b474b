//! The table `[recall]` of a study file.

use super::{
    StudyError, cell_error,
    message::{RecallMessage, StudyMessage},
};
use crate::{
    figure::Measure,
    recall::{RecallPlan, is_independent},
    study::{Cell, Measures, Study},
};
use murmuration_swarm::{CampaignSpec, Invalid, Method};
use std::num::NonZeroU32;
use toml::Value;

/// Most numbers of evaluations at which recall is measured.
const MOST_STAGES: usize = 32;
/// Numbers of evaluations at which recall is measured, and niches of the behaviour space, unless the file sets them.
const AT: [u32; 3] = [1000, 3000, 10_000];
const NICHES: u32 = 500;
/// Most niches of the behaviour space.
const MOST_NICHES: u32 = 5000;

/// The plan for measuring recall and richness; `None` if the study measures neither.
pub(super) fn plan(message: &StudyMessage) -> Result<Option<RecallPlan>, StudyError> {
    let mut which = message.measures.iter().flatten();
    let measure = which.find(|name| is_of_recall(name));
    match (measure, &message.recall) {
        (None, None) => Ok(None),
        (None, Some(_)) => {
            let allowed = "absent, since no measure is \"recall\" or \"richness\"";
            Err(Invalid::new("recall", "given", allowed).into())
        }
        (Some(measure), None) => {
            let allowed = format!("a table with an atlas: the measure \"{measure}\" needs one");
            Err(Invalid::missing("recall", allowed).into())
        }
        (Some(_), Some(recall)) => Ok(Some(RecallPlan {
            atlas: atlas(&message.name, recall)?,
            at: stages(recall.at.as_deref().unwrap_or(&AT))?,
            niches: niches(recall.niches)?,
        })),
    }
}

fn is_of_recall(name: &str) -> bool {
    [Measure::Recall, Measure::Richness]
        .iter()
        .any(|measure| measure.name() == name)
}

fn atlas(study: &str, recall: &RecallMessage) -> Result<CampaignSpec, StudyError> {
    let mut table = recall.atlas.clone();
    if table.contains_key("name") {
        let allowed = "absent: the atlas is named after the study";
        return Err(Invalid::new("recall.atlas.name", "given", allowed).into());
    }
    let name: String = study.chars().take(58).collect();
    table.insert("name".to_owned(), Value::String(format!("{name}-atlas")));
    let failed = |error| StudyError::Cell {
        cell: "the atlas of [recall]".to_owned(),
        error: Box::new(error),
    };
    let spec = CampaignSpec::from_table(table).map_err(failed)?;
    if !spec.judges() {
        let allowed = "true, or method = \"exhaustive\": an atlas has verdicts";
        return Err(failed(Invalid::new("evaluation.judge", false, allowed).into()));
    }
    Ok(spec)
}

fn stages(given: &[u32]) -> Result<Vec<NonZeroU32>, Invalid> {
    let stages: Option<Vec<NonZeroU32>> = given.iter().copied().map(NonZeroU32::new).collect();
    let fits = |stages: &Vec<NonZeroU32>| {
        (1..=MOST_STAGES).contains(&stages.len()) && stages.is_sorted_by(|a, b| a < b)
    };
    stages.filter(fits).ok_or_else(|| {
        let allowed = format!("1 to {MOST_STAGES} numbers of evaluations, ascending from 1 on");
        Invalid::new("recall.at", format!("{given:?}"), allowed)
    })
}

fn niches(niches: Option<u32>) -> Result<NonZeroU32, Invalid> {
    let given = niches.unwrap_or(NICHES);
    let fits = NonZeroU32::new(given).filter(|niches| (2..=MOST_NICHES).contains(&niches.get()));
    fits.ok_or_else(|| Invalid::new("recall.niches", given, format!("2 to {MOST_NICHES}")))
}

/// Checks that every cell has the verdicts that its measures need, and can be compared with the atlas.
pub(super) fn check(study: &Study) -> Result<(), StudyError> {
    let plan = study.measures.recall.as_ref();
    for cell in &study.cells {
        let checked = measurable(cell, &study.measures)
            .and_then(|()| plan.map_or(Ok(()), |plan| comparable(cell, plan)));
        if let Err(error) = checked {
            return Err(cell_error(study, &cell.values, cell.spec.seed(), error.into()));
        }
    }
    Ok(())
}

/// Checks that the verdicts and the sampling of a cell fit its measures.
fn measurable(cell: &Cell, measures: &Measures) -> Result<(), Invalid> {
    let (spec, has) = (&cell.spec, |measure| measures.which.contains(&measure));
    let needs_verdicts = measures.recall.is_some() || has(Measure::Maps);
    if needs_verdicts && !spec.judges() {
        let allowed = "true: the study measures by verdicts";
        return Err(Invalid::new("evaluation.judge", false, allowed));
    }
    let starts = spec.starts().get();
    if has(Measure::Richness) && is_independent(spec) && starts > 1 {
        let allowed = "1: richness needs independent verdicts, and several verdicts on one controller are not independent";
        return Err(Invalid::new("evaluation.starts", starts, allowed));
    }
    if has(Measure::Maps) && spec.method() == Method::Exhaustive {
        let allowed =
            "another method: maps show a sample of controllers, and \"exhaustive\" lists them in order";
        return Err(Invalid::new("method", spec.method(), allowed));
    }
    Ok(())
}

fn comparable(cell: &Cell, plan: &RecallPlan) -> Result<(), Invalid> {
    let spec = &cell.spec;
    let most = plan.at.last().map_or(0, |at| at.get());
    if spec.model() != plan.atlas.model() || spec.world() != plan.atlas.world() {
        let allowed = "the model and world of [recall]'s atlas";
        return Err(Invalid::new("model and world", "other ones", allowed));
    }
    if u64::from(most) > spec.evaluations() {
        let allowed = format!("at most {}, the evaluations of the campaign", spec.evaluations());
        return Err(Invalid::new("recall.at", most, allowed));
    }
    Ok(())
}

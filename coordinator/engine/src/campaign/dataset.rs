//! The dataset stage: samples controllers, has the workers simulate them, and stores their pictures.

use super::{
    CampaignError,
    context::{StageContext, pictures_at_once},
    evaluate::{Placed, evaluate},
    run_handle::RunHandle,
};
use murmuration_dispatch::EvaluationJob;
use murmuration_model::CampaignRecord;
use murmuration_search::breeding::{self, ProposeError};
use murmuration_store::Store;
use murmuration_swarm::{CampaignSpec, Controller, Dataset, EmbedderSource, Purpose, RandomStream};
use rand::RngExt as _;
use std::ops::Range;

/// Maximum number of controllers whose pictures are simulated and committed together.
const CHUNK: u64 = 500;

/// Simulates the missing part of the dataset.
pub(super) async fn collect(
    context: &StageContext,
    record: CampaignRecord,
    handle: &mut RunHandle,
) -> Result<(), CampaignError> {
    let Some(&EmbedderSource::Trained { dataset, .. }) = record.spec.embedder() else {
        return Ok(());
    };
    let CampaignRecord {
        id,
        spec,
        pictures_done,
        ..
    } = &record;
    let starts = u64::from(dataset.starts());
    let most = pictures_at_once(spec.image(), (CHUNK * starts) as usize) as u64;
    let at_once = (most / starts).max(1);
    let mut next = *pictures_done / starts;
    while next < u64::from(dataset.controllers()) {
        let chunk = next..u64::from(dataset.controllers()).min(next + at_once);
        let tasks = tasks(spec, &dataset, chunk.clone())?;
        let job = EvaluationJob::of(&record, None, tasks);
        let substitute =
            |place: usize, attempt| substitutes(spec, &dataset, chunk.start, place as u64, attempt);
        let evaluated = |progress| evaluate(&context.dispatch, progress, job, substitute);
        let done = handle.until_stopped(evaluated).await??;
        let (pictures, provenance) = done.into_pictures(|place, reason| {
            let picture = chunk.start * starts + place as u64;
            format!(
                "the task of picture {picture} of the dataset was poisoned, and another controller took its place: {reason}"
            )
        });
        let count = pictures.len() as u64;
        let (id, place) = (id.clone(), chunk.start * starts);
        let add = move |store: &Store| store.add_pictures(&id, place, &pictures, &provenance);
        context.commit(&handle.commit_handle(), add).await?;
        handle.done(count);
        next = chunk.end;
    }
    Ok(())
}

/// The dataset's tasks for a range of controllers: each controller once for each of its starts, with the seed of the start.
pub fn tasks(
    spec: &CampaignSpec,
    dataset: &Dataset,
    controllers: Range<u64>,
) -> Result<Vec<(Controller, u64)>, ProposeError> {
    let starts = u64::from(dataset.starts());
    let mut tasks = Vec::new();
    for index in controllers {
        let mut stream = RandomStream::derive(spec.seed(), Purpose::Dataset, index);
        let controller = breeding::sample(spec.controllers(), dataset.filter(), &mut stream)?;
        for place in index * starts..(index + 1) * starts {
            let seed = RandomStream::derive(spec.seed(), Purpose::DatasetStart, place).random();
            tasks.push((controller.clone(), seed));
        }
    }
    Ok(tasks)
}

/// Tasks with another controller in place of a poisoned task's controller, one for each start: the pictures of one controller
/// belong together.
fn substitutes(
    spec: &CampaignSpec,
    dataset: &Dataset,
    first: u64,
    place: u64,
    attempt: u64,
) -> Result<Vec<Placed>, ProposeError> {
    let starts = u64::from(dataset.starts());
    let controller = place / starts;
    let index = (first + controller) << 8 | attempt;
    let mut stream = RandomStream::derive(spec.seed(), Purpose::DatasetSubstitute, index);
    let substitute = breeding::sample(spec.controllers(), dataset.filter(), &mut stream)?;
    let places = controller * starts..(controller + 1) * starts;
    Ok(places
        .map(|place| (place as usize, (substitute.clone(), stream.random())))
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_search::filter::Score;

    fn tasks_of(text: &str, controllers: Range<u64>) -> Vec<(Controller, u64)> {
        let text = format!("model = \"single-sensor\"\nmethod = \"latent\"\n{text}");
        let spec = CampaignSpec::from_toml(&text).unwrap();
        let Some(EmbedderSource::Trained { dataset, .. }) = spec.embedder() else {
            panic!("nothing is trained");
        };
        tasks(&spec, dataset, controllers).unwrap()
    }

    #[test]
    fn a_dataset_does_not_depend_on_how_it_is_cut() {
        let whole = tasks_of("[dataset]\nstarts = 3", 0..20);
        let parts = [0..7, 7..8, 8..20].map(|part| tasks_of("[dataset]\nstarts = 3", part));
        assert_eq!(whole, parts.concat());
    }

    #[test]
    fn every_controller_has_starts_of_its_own() {
        let tasks = tasks_of("[dataset]\nstarts = 2", 0..50);
        assert_eq!(tasks.len(), 100);
        assert!(tasks.chunks(2).all(|pair| pair[0].0 == pair[1].0));
        let mut seeds: Vec<_> = tasks.iter().map(|task| task.1).collect();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), 100);
    }

    #[test]
    fn a_filtered_dataset_passes_the_filter() {
        let tasks = tasks_of("[dataset]\nfilter = true", 0..200);
        assert!(tasks.iter().all(|(controller, _)| Score::of(controller).passes()));
        let unfiltered = tasks_of("", 0..200);
        assert!(
            !unfiltered
                .iter()
                .all(|(controller, _)| Score::of(controller).passes())
        );
    }
}

//! Checks which parts of one campaign are whole.

use crate::{ArchivedIndividual, Store, StoreError, checkpoints::Condition};
use murmuration_model::{CampaignId, CampaignRecord, CampaignState};
use murmuration_proto::SIMULATOR_VERSION;
use murmuration_swarm::{CheckpointDigest, EmbedderSource};
use std::ops::Range;

/// Number of individuals or pictures that are read at a time.
const CHUNK: u64 = 512;

#[derive(Debug)]
pub struct CampaignFindings {
    pub id: CampaignId,
    /// The campaign's state, if the state can be read.
    pub state: Option<CampaignState>,
    /// Sentences that each name something damaged or missing.
    pub problems: Vec<String>,
    /// Amounts that the database should have of the campaign.
    pub stored: Amounts,
    /// Amounts that are whole, counted from the beginning of the campaign.
    pub whole: Amounts,
    pub condition: CampaignCondition,
    /// Why this version of Murmuration does not continue the campaign, even if the campaign is whole.
    pub note: Option<String>,
}

#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Amounts {
    pub pictures: u64,
    pub generations: u32,
    pub individuals: u64,
    /// Entries of the campaign's label log.
    pub labels: u64,
    /// Whether there is a current taxonomy.
    pub taxonomy: bool,
}

/// Whether a campaign can continue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CampaignCondition {
    Whole,
    /// The campaign needs a checkpoint whose bytes are missing or damaged; with a copy of these bytes the campaign is whole.
    LacksCheckpoint,
    /// Some rows of the campaign are damaged or missing.
    Damaged,
    /// The campaign's own row, with its specification, cannot be read.
    Unreadable,
}

impl CampaignFindings {
    pub(super) fn of(store: &Store, id: &CampaignId, checkpoints: &[(CheckpointDigest, Condition)]) -> Self {
        let record = match store.campaign(id.as_str()) {
            Ok(record) => record,
            Err(error) => return Self::unreadable(id, &error),
        };
        let mut problems = Vec::new();
        let (stored, whole) = archive(store, &record, &mut problems);
        let lacking = [record.embedder.checkpoint(), record.embedder.next()]
            .into_iter()
            .flatten()
            .find(|&digest| !checkpoints.contains(&(digest, Condition::Whole)));
        let condition = match (problems.is_empty(), lacking) {
            (false, _) => CampaignCondition::Damaged,
            (true, Some(_)) => CampaignCondition::LacksCheckpoint,
            (true, None) => CampaignCondition::Whole,
        };
        problems.extend(lacking.map(|digest| format!("checkpoint {digest} is missing or damaged")));
        Self {
            id: id.clone(),
            state: Some(record.state),
            problems,
            stored,
            whole,
            condition,
            note: (record.simulator_version != SIMULATOR_VERSION).then(|| {
                let theirs = &record.simulator_version;
                format!(
                    "begun with simulator version {theirs}: only that version can continue it; this version can show it"
                )
            }),
        }
    }

    fn unreadable(id: &CampaignId, error: &StoreError) -> Self {
        Self {
            id: id.clone(),
            state: None,
            problems: vec![error.reason()],
            stored: Amounts::default(),
            whole: Amounts::default(),
            condition: CampaignCondition::Unreadable,
            note: None,
        }
    }
}

/// The amounts that the database should have of a campaign, and the amounts that are whole.
fn archive(store: &Store, record: &CampaignRecord, problems: &mut Vec<String>) -> (Amounts, Amounts) {
    let stored = Amounts {
        pictures: record.pictures_done,
        generations: record.generations_done,
        individuals: record.individuals(),
        labels: store.label_entries(&record.id).unwrap_or(0),
        taxonomy: record.state == CampaignState::Completed,
    };
    let population = u64::from(record.spec.search().population());
    let generations = generations(store, record, problems);
    let individuals = individuals(store, record, problems);
    let generations = u64::from(generations).min(individuals / population) as u32;
    if store.archive_len(&record.id).unwrap_or(0) > record.individuals() {
        problems.push("it has individuals of a generation that is not complete".to_owned());
    }
    let labels = store.readable_labels(&record.id).unwrap_or(0);
    if labels < stored.labels {
        problems.push(format!("entry {labels} of its label log cannot be followed"));
    }
    let complete = generations == record.generations_done;
    let whole = Amounts {
        pictures: pictures(store, record, problems),
        generations,
        individuals: u64::from(generations) * population,
        labels,
        taxonomy: complete && taxonomy(store, record, stored.taxonomy, problems),
    };
    former_taxonomies(store, record, problems);
    (stored, whole)
}

/// Number of generations before the first one whose record is missing.
fn generations(store: &Store, record: &CampaignRecord, problems: &mut Vec<String>) -> u32 {
    let records = match store.generations(&record.id) {
        Ok(records) => records,
        Err(error) => {
            problems.push(format!("its generations: {}", error.reason()));
            return 0;
        }
    };
    let dense = (0..)
        .zip(&records)
        .take_while(|(place, record)| record.generation == *place);
    let whole = dense.count() as u32;
    if whole < record.generations_done {
        problems.push(format!("generation {whole} is missing"));
    }
    whole
}

/// Number of individuals, from the first on, that are whole.
fn individuals(store: &Store, record: &CampaignRecord, problems: &mut Vec<String>) -> u64 {
    let population = u64::from(record.spec.search().population());
    let starts = record.spec.starts().get();
    let mut length = None;
    let mut wrong = |individual: &ArchivedIndividual, index: u64| {
        let embedding = individual.trials.first().map_or(0, |trial| trial.embedding.len());
        let length = *length.get_or_insert(embedding);
        if individual.index != index {
            Some("it is missing")
        } else if u64::from(individual.generation) != index / population {
            Some("it is of another generation")
        } else if individual.trials.len() != starts {
            Some("it has another number of trials than the campaign asks for")
        } else if individual.image().is_none() {
            Some("its picture is missing")
        } else if embedding != length || record.embedder.checkpoint().is_some() != (length > 0) {
            Some("its embedding is missing or cut off")
        } else if !individual.novelty.is_finite() || individual.features().iter().any(|value| value.is_nan())
        {
            Some("its features or novelty are not numbers")
        } else {
            None
        }
    };
    let check = |range: Range<u64>| {
        let found = store.individuals(&record.id, record.spec.model(), range.clone(), true)?;
        let mut found = found.iter();
        for index in range {
            let fault = match found.next() {
                Some(individual) => wrong(individual, index),
                None => Some("it is missing"),
            };
            if let Some(fault) = fault {
                return Ok(Some((index, fault.to_owned())));
            }
        }
        Ok(None)
    };
    let faulty = first_fault(record.individuals(), check).or_else(|| match store.overlap(&record.id) {
        Ok(overlap) => overlap.map(|(index, table)| (index, format!("it is in two chunks of {table}"))),
        Err(error) => Some((0, error.reason())),
    });
    match faulty {
        Some((index, fault)) => {
            let name = format!("individual {index}");
            // The fault of a chunk names all its individuals.
            problems.push(match fault.starts_with("individuals ") {
                true => fault,
                false => format!("{name}: {}", without(&name, &fault)),
            });
            index
        }
        None => record.individuals(),
    }
}

/// Number of pictures of the dataset, from the first on, that are whole. A controller counts only if all its pictures are whole.
fn pictures(store: &Store, record: &CampaignRecord, problems: &mut Vec<String>) -> u64 {
    let Some(EmbedderSource::Trained { dataset, .. }) = record.spec.embedder() else {
        return record.pictures_done;
    };
    let check = |range: Range<u64>| {
        let images = store.dataset_images(&record.id, range.clone())?;
        let whole = range.start + (images.len() / record.spec.image().bytes()) as u64;
        // If a picture is missing, the later pictures move up, so that only the total length of the images shows the gap.
        Ok((whole < range.end).then(|| (range.start, "a picture after this is missing".to_owned())))
    };
    match first_fault(record.pictures_done, check) {
        Some((place, fault)) => {
            let fault = without(&format!("picture {place} of {}", record.id), &fault);
            problems.push(format!("picture {place} of its dataset: {fault}"));
            place - place % u64::from(dataset.starts())
        }
        None => record.pictures_done,
    }
}

/// The text of a fault without `name` at its beginning. The store's errors begin with the name of an item that cannot be read.
fn without<'a>(name: &str, fault: &'a str) -> &'a str {
    let rest = fault.strip_prefix(name);
    rest.and_then(|rest| rest.strip_prefix(": ")).unwrap_or(fault)
}

/// Whether the campaign's taxonomy exists and is about the campaign's archive.
fn taxonomy(store: &Store, record: &CampaignRecord, wanted: bool, problems: &mut Vec<String>) -> bool {
    let fault = match store.taxonomy(&record.id) {
        Ok(None) if wanted => "is missing".to_owned(),
        Ok(None) => return false,
        Ok(Some(taxonomy)) => {
            let len = record.sampled();
            let about = taxonomy.clusters.len() as u64 == len;
            let starts = record.spec.starts().get();
            let robust = &taxonomy.robust_trials;
            let counted = robust.len() == if starts > 1 { taxonomy.clusters.len() } else { 0 };
            if !counted || robust.iter().any(|&trials| usize::from(trials) > starts) {
                "has counts of robust trials that do not fit the campaign's starts".to_owned()
            } else if about && taxonomy.medoids.iter().all(|&index| index < len) {
                return true;
            } else {
                "is of another archive".to_owned()
            }
        }
        Err(error) => format!("cannot be read: {}", error.reason()),
    };
    problems.push(format!("its taxonomy {fault}"));
    false
}

/// Checks the former versions of the campaign's taxonomy.
fn former_taxonomies(store: &Store, record: &CampaignRecord, problems: &mut Vec<String>) {
    let versions = match store.taxonomy_versions(&record.id) {
        Ok(versions) => versions,
        Err(error) => {
            problems.push(format!("the versions of its taxonomy: {}", error.reason()));
            return;
        }
    };
    for former in versions.iter().filter(|version| !version.stands) {
        let fault = match store.taxonomy_of_version(&record.id, former.version) {
            Err(error) => format!("cannot be read: {}", error.reason()),
            Ok(Some(stored)) if stored.medoids.iter().any(|&medoid| medoid >= former.individuals) => {
                "has medoids that are in none of its clusters".to_owned()
            }
            Ok(_) if former.individuals > record.individuals() => {
                "is about individuals that are not there".to_owned()
            }
            Ok(_) => continue,
        };
        problems.push(format!("version {} of its taxonomy {fault}", former.version));
    }
}

/// The first faulty item of `len` items, and its fault. `check` finds the first faulty item in a range, or fails if an item of
/// the range cannot be read at all.
fn first_fault(
    len: u64,
    mut check: impl FnMut(Range<u64>) -> Result<Option<(u64, String)>, StoreError>,
) -> Option<(u64, String)> {
    let mut ranges: Vec<_> = (0..len)
        .step_by(CHUNK as usize)
        .map(|start| start..len.min(start + CHUNK))
        .collect();
    ranges.reverse();
    while let Some(range) = ranges.pop() {
        match check(range.clone()) {
            Ok(None) => {}
            Ok(found) => return found,
            Err(error) if range.end - range.start == 1 => return Some((range.start, error.reason())),
            Err(_) => {
                let middle = range.start.midpoint(range.end);
                ranges.extend([middle..range.end, range.start..middle]);
            }
        }
    }
    None
}

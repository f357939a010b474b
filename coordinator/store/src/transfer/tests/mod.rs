//! Tests that an imported campaign equals the exported campaign, and that files which no export writes are refused.

mod generated;
mod hostile;

use super::*;
use crate::{CheckpointRecord, GenerationRecord, StoredTaxonomy, checkpoints::Checkpoints};
use generated::{GeneratedCampaign, Place, full, generated_campaign};
use murmuration_model::{
    CampaignId, ExportedCampaign,
    labels::{Entry, RequestId},
};
use proptest::prelude::*;
use std::{
    fs::File,
    io::{self, Read as _},
    path::PathBuf,
};

/// Everything in the database of a campaign.
#[derive(Debug, PartialEq)]
struct Contents {
    campaign: ExportedCampaign,
    checkpoints: Vec<(CheckpointRecord, Vec<u8>)>,
    log: Vec<(RequestId, Entry)>,
    generations: Vec<GenerationRecord>,
    members: Vec<Member>,
    taxonomy: Option<StoredTaxonomy>,
}

fn contents(path: &Path) -> Result<Contents, Unsound> {
    let received = ReceivedCampaign::open(path)?;
    let mut members = Vec::new();
    received.archive::<Unsound>(|some| {
        members.extend(some);
        Ok(())
    })?;
    let checkpoints = received.checkpoints().iter();
    let log: Result<Vec<_>, Unsound> = received.log().collect();
    Ok(Contents {
        campaign: received.campaign().clone(),
        checkpoints: checkpoints
            .map(|record| Ok((record.clone(), received.model(record)?)))
            .collect::<Result<_, Unsound>>()?,
        log: log?.concat(),
        generations: received.generations().to_vec(),
        members,
        taxonomy: received.taxonomy().cloned(),
    })
}

/// Exports the generated campaign of a data directory to a file.
async fn exported(place: &Place, data: &Path, to: &Path) -> PathBuf {
    let id = "case-7".parse().unwrap();
    let mut file = export(&place.store, &place.checkpoints, data, &id).await.unwrap();
    io::copy(&mut file, &mut File::create(to).unwrap()).unwrap();
    assert_eq!(left(data), Vec::<String>::new());
    to.to_path_buf()
}

/// Imports a file part by part.
async fn import(
    (store, checkpoints): (&Store, &Checkpoints),
    data: &Path,
    file: &Path,
) -> Result<CampaignId, ImportError> {
    let mut arriving = Arriving::begin(store, data, "case-7".parse().unwrap()).await?;
    let mut file = File::open(file).unwrap();
    loop {
        let mut part = Vec::new();
        (&mut file).take(100_000).read_to_end(&mut part).unwrap();
        if part.is_empty() {
            return arriving.finish(checkpoints).await;
        }
        arriving = arriving.add(part).await?;
    }
}

/// The folders that exports and imports have left in a data directory.
fn left(data: &Path) -> Vec<String> {
    let names = fs::read_dir(data).unwrap();
    let names = names.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.filter(|name| name.starts_with(PREFIX)).collect()
}

fn on_a_runtime<T>(work: impl Future<Output = T>) -> T {
    let mut runtime = tokio::runtime::Builder::new_multi_thread();
    runtime.enable_all().build().unwrap().block_on(work)
}

async fn there_and_back(one: &GeneratedCampaign) -> (Contents, Contents) {
    let folder = tempfile::tempdir().unwrap();
    let [from, to] = ["from", "to"].map(|name| folder.path().join(name));
    let place = one.store(&from).await;
    let file = exported(&place, &from, &folder.path().join("exported")).await;
    let mut there = contents(&file).unwrap();
    // In this store campaigns and checkpoints have other numbers.
    let other = Place::with_another(&to).await;
    let handles = (&other.store, &other.checkpoints);
    assert_eq!(import(handles, &to, &file).await.unwrap().as_str(), "case-7");
    assert_eq!(left(&to), Vec::<String>::new());
    assert_eq!(other.store.faults().unwrap(), Vec::<String>::new());
    assert_eq!(other.store.dangling().unwrap(), Vec::<String>::new());
    let again = import(handles, &to, &file).await.unwrap_err();
    assert!(matches!(again, ImportError::Exists(_)), "{again}");
    let back = contents(&exported(&other, &to, &folder.path().join("again")).await).unwrap();
    there.campaign.record.state = there.campaign.state_when_imported();
    (there, back)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn what_is_exported_is_imported_and_exported_as_it_was(one in generated_campaign()) {
        let (there, back) = on_a_runtime(there_and_back(&one));
        prop_assert_eq!(there, back);
    }
}

#[test]
fn a_full_campaign_comes_with_everything() {
    let (there, back) = on_a_runtime(there_and_back(&full()));
    assert_eq!(there, back);
    assert_eq!((there.checkpoints.len(), there.members.len()), (2, 8));
    assert!(there.taxonomy.is_some() && there.log.len() > 5);
    let notes = &there.campaign.record.notes;
    assert_eq!(
        (notes.tags.to_string().as_str(), notes.note.as_str()),
        ("a b", "Note")
    );
}

#[test]
fn small_pictures_with_long_embeddings_come_back() {
    let wide = GeneratedCampaign {
        starts: 4,
        judge: false,
        is_refined: false,
        is_wide: true,
        log: Vec::new(),
        ..full()
    };
    let (there, back) = on_a_runtime(there_and_back(&wide));
    assert!(there == back && there.members.len() == 1000);
}

#[test]
fn a_campaign_that_is_not_there_is_not_exported() {
    on_a_runtime(async {
        let folder = tempfile::tempdir().unwrap();
        let place = Place::with_another(folder.path()).await;
        let id = "case-9".parse().unwrap();
        let refused = export(&place.store, &place.checkpoints, folder.path(), &id)
            .await
            .unwrap_err();
        assert!(
            refused.to_string().contains("no campaign \"case-9\""),
            "{refused}"
        );
        assert_eq!(left(folder.path()), Vec::<String>::new());
    });
}

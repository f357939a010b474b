//! What is written reads back the same, and what was changed is refused.

mod generated;

use super::*;
use generated::{GeneratedCampaign, generated_campaign};
use murmuration_model::{CampaignState, ExportedCampaign, Weight, labels::Action};
use murmuration_proto::{CampaignSpec, Lineage, PART_BYTES, PictureShape, training::Architecture, v1};
use murmuration_store::{
    DataDirectory, GenerationRecord, Store,
    checkpoints::Checkpoints,
    digest::digest,
    transfer::{Incoming, Medoids, Member, Outgoing, Part, Sequence},
};
use murmuration_trainer::{network::Network, onnx};
use proptest::prelude::*;
use prost::Message as _;
use std::{
    fs,
    path::{Path, PathBuf},
};

/// Writes the parts as they come from a network.
fn write(target: &Path, parts: &[Part], with_csv: bool) -> Exported {
    let mut sequence = Sequence::default();
    let mut parts = parts
        .iter()
        .map(|part| sequence.next(part.clone().into()).unwrap());
    let Some(Part::Campaign(campaign)) = parts.next() else {
        panic!("no campaign")
    };
    let mut folder = NewFolder::create(target, *campaign, with_csv, false).unwrap();
    parts.for_each(|part| folder.add(part).unwrap());
    sequence.end().unwrap();
    folder.finish().unwrap()
}

fn read(folder: &Path) -> Result<Vec<Part>, ExportError> {
    let mut parts = Vec::new();
    ReadFolder::open(folder)?.read(&mut |part| {
        parts.push(part);
        true
    })?;
    Ok(parts)
}

/// The parts apart from how the archive is divided, and from the digest, which an export does not know beforehand.
fn whole(parts: Vec<Part>) -> (Vec<Part>, Vec<Member>) {
    let mut members = Vec::new();
    let mut others = Vec::new();
    for part in parts {
        match part {
            Part::Individuals(some) => members.extend(some),
            Part::Campaign(campaign) => {
                let mut campaign = ExportedCampaign {
                    digest: String::new(),
                    ..*campaign
                };
                // It follows from the generations.
                campaign.record.last_novelty = None;
                others.push(Part::Campaign(Box::new(campaign)));
            }
            other => others.push(other),
        }
    }
    (others, members)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn what_is_exported_reads_back_and_is_stored_with_the_same_digest(one in generated_campaign()) {
        let place = tempfile::tempdir().unwrap();
        let folder = place.path().join("export");
        let exported = write(&folder, &one.parts(), true);
        let parts = read(&folder).unwrap();
        prop_assert_eq!(whole(parts.clone()), whole(one.parts()));

        let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().unwrap();
        let (stored, there) = runtime.block_on(import(&place.path().join("data"), parts));
        prop_assert_eq!(stored, exported.campaign.digest);
        prop_assert_eq!(whole(there), whole(as_imported(one.parts())));
    }
}

/// The parts of a campaign as a store has them that nobody runs it in.
fn as_imported(mut parts: Vec<Part>) -> Vec<Part> {
    for part in &mut parts {
        if let Part::Campaign(campaign) = part {
            campaign.record.state = campaign.state_when_imported();
        }
    }
    parts
}

/// Stores the parts beside another campaign and another checkpoint; the archive's digest, and the parts that the store exports,
/// those of checkpoints without their bytes.
async fn import(data: &Path, parts: Vec<Part>) -> (String, Vec<Part>) {
    let held = DataDirectory::hold(data).unwrap();
    let store = Store::open(&held).unwrap();
    let checkpoints = Checkpoints::open(store.clone(), data, None).unwrap();
    let other =
        CampaignSpec::from_toml("name = \"other\"\nmodel = \"single-sensor\"\nmethod = \"random\"").unwrap();
    store.create_campaign(&other, Weight::default(), 0).unwrap();
    let model = onnx::export(&Network::<f32>::initialise(
        Architecture::compact(PictureShape::PAPER, 3).unwrap(),
        9,
    ));
    checkpoints
        .publish(Lineage::default(), model.into())
        .await
        .unwrap();
    let mut parts = parts.into_iter();
    let Some(Part::Campaign(campaign)) = parts.next() else {
        panic!("no campaign")
    };
    let mut sequence = Sequence::default();
    sequence.next(Part::Campaign(campaign.clone()).into()).unwrap();
    let mut incoming = Incoming::begin(&store, data, *campaign).await.unwrap();
    let mut chunks = Vec::new();
    for part in parts {
        chunks.extend(matches!(part, Part::Chunk(_)).then(|| part.clone()));
        let part = sequence.next(part.into()).unwrap();
        match sequence.take_checkpoint() {
            Some((record, bytes)) => incoming.add_checkpoint(record, bytes).await.unwrap(),
            None => incoming.add(part).await.unwrap(),
        }
    }
    let id = incoming.finish(store.clone(), &checkpoints).await.unwrap();
    let left: Vec<String> = fs::read_dir(data)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.starts_with(".importing"))
        .collect();
    assert!(left.is_empty(), "{left:?}");
    let mut outgoing = Outgoing::of(&store, id.as_str()).unwrap();
    let mut there = vec![Part::Campaign(Box::new(outgoing.campaign().clone()))];
    for (record, chunk) in outgoing.checkpoints().iter().zip(chunks) {
        there.extend([Part::Checkpoint(record.clone()), chunk]);
    }
    while let Some(part) = outgoing.next_part().unwrap() {
        there.push(part);
    }
    let spec = store.campaign(id.as_str()).unwrap().spec;
    (digest(&store, &id, spec.model()).unwrap().digest, there)
}

#[test]
fn parts_of_short_pictures_and_long_embeddings_fit_in_messages() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("export");
    let wide = GeneratedCampaign {
        starts: 4,
        judge: false,
        is_refined: false,
        is_wide: true,
        log: Vec::new(),
        ..full()
    };
    write(&folder, &wide.parts(), false);
    let parts = read(&folder).unwrap();
    let bytes = |part: &Part| v1::CampaignPart::from(part.clone()).encoded_len();
    let longest = parts.iter().map(bytes).max().unwrap();
    let all: usize = parts.iter().map(bytes).sum();
    assert!(
        longest < 2 * PART_BYTES && all > 4 * PART_BYTES,
        "{longest} of {all}"
    );
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .unwrap();
    let (_, there) = runtime.block_on(import(&place.path().join("data"), parts));
    let longest = there.iter().map(bytes).max().unwrap();
    assert!(longest < 2 * PART_BYTES, "{longest}");
}

/// A completed campaign with everything that there may be.
fn full() -> GeneratedCampaign {
    GeneratedCampaign {
        method: "latent",
        starts: 2,
        judge: true,
        species: false,
        state: CampaignState::Completed,
        seed: 7,
        is_refined: true,
        is_wide: false,
        log: vec![
            (8, 1, 0),
            (9, 2, 1),
            (1, 0, 1),
            (8, 1, 2),
            (3, 4, 0),
            (6, 0, 0),
            (6, 1, 2),
            (5, 0, 0),
            (7, 0, 0),
            (3, 5, 1),
            (4, 0, 0),
            (0, 0, 0),
        ],
    }
}

/// Lists the digests anew, as somebody would who changed a file on purpose.
fn list_again(folder: &Path, exported: &Exported) {
    let mut listed = digests::Digests::default();
    for name in exported.files.iter().filter(|name| *name != digests::FILE) {
        listed.add(folder, name).unwrap();
    }
    fs::write(folder.join(digests::FILE), listed.to_text()).unwrap();
}

#[test]
fn one_changed_byte_of_any_file_is_found() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("export");
    let exported = write(&folder, &full().parts(), false);
    assert!(exported.files.len() > 9, "{:?}", exported.files);
    for name in &exported.files {
        let path = folder.join(name);
        let bytes = fs::read(&path).unwrap();
        for place in [0, bytes.len() / 2, bytes.len() - 2] {
            let mut changed = bytes.clone();
            changed[place] ^= 1;
            fs::write(&path, changed).unwrap();
            assert!(read(&folder).is_err(), "byte {place} of {name}");
        }
        fs::write(&path, bytes).unwrap();
    }
    read(&folder).unwrap();
}

#[test]
fn a_file_that_was_cut_off_or_exchanged_on_purpose_is_refused() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("export");
    let exported = write(&folder, &full().parts(), false);
    let read_files = |name: &&String| !["README.md", "DATASHEET.md", digests::FILE].contains(&name.as_str());
    for name in exported.files.iter().filter(read_files) {
        let path = folder.join(name);
        let bytes = fs::read(&path).unwrap();
        for cut in [0, 1, bytes.len() / 3, bytes.len() - 9] {
            fs::write(&path, &bytes[..cut]).unwrap();
            list_again(&folder, &exported);
            assert!(read(&folder).is_err(), "{name} cut off at {cut}");
        }
        // Another file of the export in its place.
        let other = exported
            .files
            .iter()
            .filter(read_files)
            .find(|other| *other != name)
            .unwrap();
        fs::write(&path, fs::read(folder.join(other)).unwrap()).unwrap();
        list_again(&folder, &exported);
        assert!(read(&folder).is_err(), "{other} in place of {name}");
        fs::write(&path, bytes).unwrap();
    }
    list_again(&folder, &exported);
    read(&folder).unwrap();
}

/// Why the parts of a campaign are refused after a change of each of them.
fn with_change(change: impl Fn(&mut Part)) -> Result<(), String> {
    let mut parts = full().parts();
    parts.iter_mut().for_each(change);
    let mut sequence = Sequence::default();
    for part in parts {
        sequence
            .next(v1::CampaignPart::from(part))
            .map_err(|error| error.to_string())?;
    }
    sequence.end().map(drop).map_err(|error| error.to_string())
}

/// The same with another individual in the place of one.
fn with_member(change: impl Fn(&mut Member)) -> Result<(), String> {
    with_change(|part| {
        if let Part::Individuals(members) = part {
            members
                .iter_mut()
                .filter(|member| member.individual.index == 5)
                .for_each(&change);
        }
    })
}

#[test]
fn a_generation_is_what_its_individuals_come_to() {
    let with_generation = |change: fn(&mut GenerationRecord)| {
        with_change(|part| {
            if let Part::Generation(generation) = part {
                change(generation);
            }
        })
    };
    assert_eq!(with_generation(|_| {}), Ok(()));
    for (change, named) in [
        (
            (|one| one.best_novelty += 1.0) as fn(&mut GenerationRecord),
            "generations[0].best_novelty = ",
        ),
        (|one| one.mean_novelty *= 0.5, "generations[0].mean_novelty = "),
    ] {
        let refused = with_generation(change).unwrap_err();
        assert!(refused.contains(named), "{refused}: {named}");
    }
}

#[test]
fn taxonomies_that_no_archive_has_are_named() {
    let with_taxonomy = |change: fn(&mut Medoids)| {
        with_change(|part| {
            if let Part::Taxonomy(taxonomy) = part {
                change(taxonomy);
            }
        })
    };
    assert_eq!(with_taxonomy(|_| {}), Ok(()));
    for (change, named) in [
        ((|one| one.loss = -1.0) as fn(&mut Medoids), "loss = -1"),
        (
            |one| one.medoids[0].1.mean_distance = -5.0,
            "medoids[0].mean_distance = -5",
        ),
        (|one| one.medoids[1].1.novelty = -1.0, "medoids[1].novelty = -1"),
        (|one| one.medoids[1].0 = 8, "medoids[1].index = 8"),
        (|one| one.medoids[1].0 = 2, "medoids[1].index = 2"),
        (|one| one.medoids.swap(0, 1), "medoids[0].index = 5"),
        (
            |one| one.medoids = one.medoids.repeat(1000),
            "medoids = 2000: must be at most 2",
        ),
        (|one| one.medoids.truncate(1), "medoids = 1: must be more than 1"),
    ] {
        let refused = with_taxonomy(change).unwrap_err();
        assert!(refused.contains(named), "{refused}: {named}");
    }
    // A larger cluster behind a smaller one.
    let refused = with_member(|one| one.cluster = Some(0)).map_err(|error| error.contains("medoids"));
    assert_eq!(refused, Err(true));
    let refused = with_change(|part| {
        if let Part::Individuals(members) = part {
            for member in members.iter_mut().filter(|member| member.individual.index == 4) {
                member.cluster = Some(1);
            }
        }
    });
    let refused = refused.unwrap_err();
    assert!(refused.contains("the largest cluster first"), "{refused}");
}

#[test]
fn an_answer_about_an_individual_that_the_archive_does_not_have_is_named() {
    let refused = with_change(|part| {
        if let Part::Labels(entries) = part {
            for (_, entry) in entries {
                if let Action::Answer { index, .. } = &mut entry.change.action {
                    *index += 8;
                }
            }
        }
    });
    let refused = refused.unwrap_err();
    assert!(refused.contains("must be below 8, the individuals"), "{refused}");
}

#[test]
fn values_that_no_archive_has_are_named() {
    assert_eq!(with_member(|_| {}), Ok(()));
    for (change, said) in [
        (
            (|one| one.individual.novelty = f64::NAN) as fn(&mut Member),
            "individuals[5].novelty",
        ),
        (
            |one| one.individual.trials[1].features[2] = f64::INFINITY,
            "individuals[5].features.radial_variance_x20",
        ),
        (|one| one.individual.novelty = -1.0, "individuals[5].novelty = -1"),
        (|one| one.individual.seed ^= 1, "individuals[5].seed"),
        (|one| one.individual.index = 6, "index = 6: must be 5"),
        (|one| drop(one.individual.trials.pop()), "individuals[5].trials"),
        (|one| one.individual.trials[0].image = Some(vec![0; 9]), "image"),
        (|one| one.individual.trials[0].embedding.push(0.0), "embedding"),
        (|one| one.individual.trials[0].verdict = None, "verdict"),
        (|one| one.cluster = Some(u32::MAX), "individuals[5].cluster"),
        (|one| one.cluster = None, "individuals[5].cluster"),
        (|one| one.robust_trials = Some(3), "individuals[5].robust_trials"),
    ] {
        let refused = with_member(change).unwrap_err();
        assert!(refused.contains(said), "{refused}: {said}");
    }
}

#[test]
fn only_an_export_is_replaced_and_only_if_asked() {
    let place = tempfile::tempdir().unwrap();
    let target: PathBuf = place.path().join("export");
    write(&target, &full().parts(), false);
    let Part::Campaign(campaign) = full().parts().remove(0) else {
        panic!("no campaign")
    };
    let create =
        |target: &Path, replaces| NewFolder::create(target, (*campaign).clone(), false, replaces).map(drop);
    assert!(matches!(create(&target, false), Err(ExportError::NotEmpty(_))));
    assert!(create(&target, true).is_ok());
    let other = place.path().join("other");
    fs::create_dir(&other).unwrap();
    fs::write(other.join("thesis.tex"), "").unwrap();
    assert!(matches!(create(&other, true), Err(ExportError::NoExport(_))));
    let names: Vec<_> = fs::read_dir(place.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    assert_eq!(names.len(), 2, "nothing half-written stays: {names:?}");
}

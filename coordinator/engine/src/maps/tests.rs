//! Maps of archives.

use super::*;
use murmuration_model::Weight;
use murmuration_store::{DataDirectory, GenerationRecord, Provenance, Store, Trial, kept::ENTRY_BYTES};
use murmuration_swarm::{CampaignSpec, Purpose, RandomStream};
use rand::RngExt as _;

#[tokio::test]
async fn an_empty_archive_has_an_empty_map() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
    let spec = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"hand-crafted\"").unwrap();
    let id = store.create_campaign(&spec, Weight::default(), 7).unwrap();
    let record = store.campaign(id.as_str()).unwrap();
    let maps = Maps::new(Spaces::new(store.clone()), Interrupt::default());
    assert!(maps.axes(&record).unwrap().points.is_empty());
    // There is no t-SNE while the archive grows.
    assert!(maps.neighbours(&record).await.unwrap().is_none());
    store.set_state(&id, CampaignState::Paused, "").unwrap();
    let record = store.campaign(id.as_str()).unwrap();
    let points = loop {
        if let Some(points) = maps.neighbours(&record).await.unwrap() {
            break points;
        }
        tokio::task::yield_now().await;
    };
    assert!(points.is_empty());
}

/// Number of individuals of a campaign.
const COUNT: u64 = 12;

/// A paused campaign with behaviours in two clumps.
fn paused(store: &Store, seed: u64) -> CampaignRecord {
    let text = format!(
        "model = \"single-sensor\"\nmethod = \"hand-crafted\"\nseed = {seed}\n[search]\npopulation = {COUNT}"
    );
    let id = store
        .create_campaign(&CampaignSpec::from_toml(&text).unwrap(), Weight::default(), 7)
        .unwrap();
    let mut stream = RandomStream::derive(seed, Purpose::Propose, 0);
    let individual = |index: u64| {
        crate::still(index, 0).with_trial(Trial {
            features: std::array::from_fn(|_| 10.0 * (index % 2) as f64 + stream.random::<f64>()),
            ..Trial::default()
        })
    };
    let individuals: Vec<_> = (0..COUNT).map(individual).collect();
    store
        .commit_generation(
            &id,
            &GenerationRecord::of(0, &[0.0], 0),
            &individuals,
            &Provenance::default(),
        )
        .unwrap();
    store.set_state(&id, CampaignState::Paused, "").unwrap();
    store.campaign(id.as_str()).unwrap()
}

#[tokio::test]
async fn maps_that_were_forgotten_are_made_again_and_are_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
    let campaigns = [1, 2].map(|seed| paused(&store, seed));
    // Room for one and a half maps.
    let map = 2 * size_of::<[f64; 2]>() * COUNT as usize + ENTRY_BYTES;
    let bound = map + map / 2;
    let maps = Maps::within(Spaces::new(store), Interrupt::default(), bound);
    let look = async |record: &CampaignRecord| {
        let axes = maps.axes(record).unwrap();
        loop {
            if let Some(points) = maps.neighbours(record).await.unwrap() {
                return (axes.points.clone(), (*points).clone());
            }
            tokio::task::yield_now().await;
        }
    };
    let first = look(&campaigns[0]).await;
    let other = look(&campaigns[1]).await;
    assert_ne!(first, other);
    // The thread that made a map may still hold it.
    while maps.kept.bytes() > bound {
        maps.axes(&campaigns[1]).unwrap();
        tokio::task::yield_now().await;
    }
    assert!(
        maps.neighbours(&campaigns[0]).await.unwrap().is_none(),
        "it was not forgotten"
    );
    assert_eq!(look(&campaigns[0]).await, first);
}

#[tokio::test]
async fn a_map_whose_request_was_dropped_is_made_for_the_next() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
    let record = paused(&store, 1);
    let maps = Maps::new(Spaces::new(store), Interrupt::default());
    // As if the client had left before the computation was spawned.
    assert!(matches!(
        maps.ask(&record, LongTurn::free()),
        Ok(Asked::Wanted(..))
    ));
    assert!(matches!(
        maps.ask(&record, LongTurn::free()),
        Ok(Asked::Wanted(..))
    ));
    let Ok(Asked::Wanted(wanted, turn)) = maps.ask(&record, LongTurn::free()) else {
        panic!("it is not wanted");
    };
    assert!(matches!(maps.ask(&record, LongTurn::free()), Ok(Asked::UnderWay)));
    maps.arrange(&record.id, wanted, turn).await;
    assert!(matches!(maps.ask(&record, LongTurn::free()), Ok(Asked::Known(_))));
}

//! Maps of archives that people look at.

use super::*;
use murmuration_model::Weight;
use murmuration_proto::{CampaignSpec, Purpose, RandomStream};
use murmuration_search::{interrupt::Interrupted, novelty::Behaviours};
use murmuration_store::{
    ArchivedIndividual, DataDirectory, GenerationRecord, Provenance, Store, kept::ENTRY_BYTES,
};

/// Two clumps of behaviours far from each other, half of `count` in each.
fn clumps(count: usize) -> Behaviours {
    let mut stream = RandomStream::derive(7, Purpose::Propose, 0);
    let mut behaviours = Behaviours::new(5);
    for i in 0..count {
        let centre = if i % 2 == 0 { 0.0 } else { 10.0 };
        let near: Vec<f64> = (0..5).map(|_| centre + stream.unit()).collect();
        behaviours.push(&near).unwrap();
    }
    behaviours
}

fn distance(one: [f64; 2], other: [f64; 2]) -> f64 {
    (one[0] - other[0]).hypot(one[1] - other[1])
}

#[test]
fn neighbours_stay_neighbours() {
    // Exactly, and on a grid.
    for count in [12, 120, 300] {
        let behaviours = clumps(count);
        let axes = projection::principal_axes(&behaviours, &Interrupt::default())
            .unwrap()
            .points;
        let points = neighbours::embed(&behaviours, &axes, &Interrupt::default()).unwrap();
        assert_ne!(points, axes);
        for (i, &point) in points.iter().enumerate() {
            let others = (0..points.len()).filter(|&other| other != i);
            let nearest =
                others.min_by(|&a, &b| distance(points[a], point).total_cmp(&distance(points[b], point)));
            assert_eq!(nearest.unwrap() % 2, i % 2, "{i} of {count}");
        }
    }
}

#[test]
fn what_is_no_landmark_lies_among_its_like() {
    let behaviours = clumps(700);
    let interrupt = Interrupt::default();
    let axes = projection::principal_axes(&behaviours, &interrupt)
        .unwrap()
        .points;
    let points = landmarks::embed_by(301, &behaviours, &axes, &interrupt).unwrap();
    let centre = |clump: usize| {
        let members = points.iter().skip(clump).step_by(2);
        members.fold([0.0; 2], |sum, point| {
            [sum[0] + point[0] / 350.0, sum[1] + point[1] / 350.0]
        })
    };
    let centres = [centre(0), centre(1)];
    for (i, &point) in points.iter().enumerate() {
        let [own, other] = [i % 2, (i + 1) % 2].map(|clump| distance(point, centres[clump]));
        assert!(own < other, "{i} lies at {point:?}, the clumps at {centres:?}");
    }
    interrupt.raise();
    assert_eq!(
        landmarks::embed_by(301, &behaviours, &axes, &interrupt),
        Err(Interrupted)
    );
}

#[test]
fn few_behaviours_and_equal_ones_have_a_map_too() {
    for count in [0, 1, 3, 8, 20] {
        let mut equal = Behaviours::new(2);
        (0..count).for_each(|_| equal.push(&[1.0, 2.0]).unwrap());
        let axes = projection::principal_axes(&equal, &Interrupt::default())
            .unwrap()
            .points;
        assert_eq!(neighbours::embed(&equal, &axes, &Interrupt::default()), Ok(axes));
    }
}

#[test]
fn an_empty_archive_has_an_empty_map() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
    let spec = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"hand-crafted\"").unwrap();
    let id = store.create_campaign(&spec, Weight::default(), 7).unwrap();
    let record = store.campaign(id.as_str()).unwrap();
    let maps = Maps::new(Spaces::new(store.clone()), Interrupt::default());
    assert!(maps.axes(&record).unwrap().points.is_empty());
    // Not while it grows.
    assert!(maps.neighbours(&record).unwrap().is_none());
    store.set_state(&id, CampaignState::Paused, "").unwrap();
    let record = store.campaign(id.as_str()).unwrap();
    let points = loop {
        if let Some(points) = maps.neighbours(&record).unwrap() {
            break points;
        }
        std::thread::yield_now();
    };
    assert!(points.is_empty());
}

#[test]
fn an_interrupted_map_is_none() {
    let behaviours = clumps(120);
    let axes = projection::principal_axes(&behaviours, &Interrupt::default()).unwrap();
    let interrupt = Interrupt::default();
    interrupt.raise();
    assert_eq!(
        neighbours::embed(&behaviours, &axes.points, &interrupt),
        Err(Interrupted)
    );
    assert_eq!(
        projection::principal_axes(&behaviours, &interrupt),
        Err(Interrupted)
    );
}

/// Individuals of a campaign.
const COUNT: u64 = 12;

/// A paused campaign of behaviours in two clumps.
fn paused(store: &Store, seed: u64) -> CampaignRecord {
    let text = format!(
        "model = \"single-sensor\"\nmethod = \"hand-crafted\"\nseed = {seed}\n[search]\npopulation = {COUNT}"
    );
    let id = store
        .create_campaign(&CampaignSpec::from_toml(&text).unwrap(), Weight::default(), 7)
        .unwrap();
    let mut stream = RandomStream::derive(seed, Purpose::Propose, 0);
    let individual = |index: u64| ArchivedIndividual {
        features: std::array::from_fn(|_| 10.0 * (index % 2) as f64 + stream.unit()),
        ..crate::still::still(index, 0)
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

#[test]
fn maps_that_were_forgotten_are_made_again_and_are_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
    let campaigns = [1, 2].map(|seed| paused(&store, seed));
    // Room for one and a half.
    let map = 2 * size_of::<[f64; 2]>() * COUNT as usize + ENTRY_BYTES;
    let bound = map + map / 2;
    let maps = Maps::within(Spaces::new(store), Interrupt::default(), bound);
    let look = |record: &CampaignRecord| {
        let axes = maps.axes(record).unwrap();
        loop {
            if let Some(points) = maps.neighbours(record).unwrap() {
                return (axes.points.clone(), (*points).clone());
            }
            std::thread::yield_now();
        }
    };
    let first = look(&campaigns[0]);
    let other = look(&campaigns[1]);
    assert_ne!(first, other);
    // The thread that made a map may have it still.
    while maps.kept.bytes() > bound {
        maps.axes(&campaigns[1]).unwrap();
        std::thread::yield_now();
    }
    assert!(
        maps.neighbours(&campaigns[0]).unwrap().is_none(),
        "it was not forgotten"
    );
    assert_eq!(look(&campaigns[0]), first);
}

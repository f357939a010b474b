//! Maps of archives that people look at.

use super::*;
use crate::{campaign::Weight, novelty::Behaviours, store::DataDirectory};
use murmuration_proto::{CampaignSpec, Purpose, Stream};

/// Two clumps of behaviours far from each other, half of `count` in each.
fn clumps(count: usize) -> Behaviours {
    let mut stream = Stream::derive(7, Purpose::Propose, 0);
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
    let behaviours = clumps(120);
    let axes = projection::principal_axes(&behaviours).points;
    let points = neighbours::embed(&behaviours, &axes);
    for (i, &point) in points.iter().enumerate() {
        let others = (0..points.len()).filter(|&other| other != i);
        let nearest =
            others.min_by(|&a, &b| distance(points[a], point).total_cmp(&distance(points[b], point)));
        assert_eq!(nearest.unwrap() % 2, i % 2, "{i}");
    }
}

#[test]
fn few_behaviours_and_equal_ones_have_a_map_too() {
    for count in [0, 1, 3, 8, 20] {
        let mut equal = Behaviours::new(2);
        (0..count).for_each(|_| equal.push(&[1.0, 2.0]).unwrap());
        let axes = projection::principal_axes(&equal).points;
        assert_eq!(neighbours::embed(&equal, &axes), axes);
    }
}

#[test]
fn an_empty_archive_has_an_empty_map() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
    let spec = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"hand-crafted\"").unwrap();
    let id = store.create_campaign(&spec, Weight::default(), 7).unwrap();
    let record = store.campaign(id.as_str()).unwrap();
    let maps = Maps::new(store.clone());
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

//! Proposals are reproducible, lie within the space, and are selected and varied with the documented probabilities.

use super::*;
use murmuration_swarm::{ControllerSpace, GeneSpace, Preset};
use proptest::prelude::*;

/// A campaign with the lines `search` in its `[search]` table, and the lines `top` (`filter` and so on) before it.
fn spec(model: &str, method: &str, top: &str, search: &str) -> CampaignSpec {
    let text = format!("model = \"{model}\"\nmethod = \"{method}\"\n{top}\n[search]\n{search}\n");
    CampaignSpec::from_toml(&text).unwrap()
}

fn single(top: &str, search: &str) -> CampaignSpec {
    spec("single-sensor", "hand-crafted", top, search)
}

fn parent(genes: &[f64], novelty: f64) -> Parent {
    let model = match genes.len() {
        4 => Preset::SingleSensor,
        _ => Preset::TwoSensor,
    };
    let controller = Controller::new(model, genes).unwrap();
    Parent { controller, novelty }
}

/// `count` parents of `model` with novelty 0, 1, 2, ..., drawn from the paper's space.
fn parents(model: &str, count: usize) -> Vec<Parent> {
    let spec = spec(model, "random", "", "");
    let mut stream = RandomStream::derive(99, Purpose::Start, 0);
    (0..count)
        .map(|i| Parent {
            controller: spec.controllers().sample(&mut stream),
            novelty: i as f64,
        })
        .collect()
}

fn is_in(space: &ControllerSpace, controller: &Controller) -> bool {
    let mut genes = controller.genes().iter().zip(space.genes());
    genes.all(|(&gene, values)| match values {
        GeneSpace::Speed { limit, .. } => (values.nearest_speed(gene / limit) - gene).abs() < 1e-12,
        GeneSpace::Among(angles) => angles.contains(&gene),
        GeneSpace::Within([low, high]) => (low..=high).contains(&&gene),
        GeneSpace::Ratio(count) => gene.fract() == 0.0 && (0.0..*count as f64).contains(&gene),
    })
}

/// Checks that `count` is the share `expected` of `total`, within four standard deviations.
#[track_caller]
fn check_share(count: usize, total: usize, expected: f64) {
    let share = count as f64 / total as f64;
    let deviation = (expected * (1.0 - expected) / total as f64).sqrt();
    assert!(
        (share - expected).abs() <= 4.0 * deviation,
        "{share} is not {expected}"
    );
}

/// If these proposals change, the digest of every campaign changes.
#[test]
fn the_proposals_are_the_same_for_ever() {
    let show = |proposal: Proposal| {
        proposal
            .controllers
            .iter()
            .map(ToString::to_string)
            .collect::<Vec<_>>()
    };
    let two = spec(
        "two-sensor",
        "hand-crafted",
        "filter = true",
        "population = 2\ngenerations = 9",
    );
    assert_eq!(
        show(propose(&two, 0, &[]).unwrap()),
        [
            "[1, -1, 0.8, 0.4, 0.2, 0.5, -1, 1, -1.0472]",
            "[0.9, -0.9, -0.8, -0.7, 0.6, 0.8, -0.4, 0.2, 2.0944]"
        ]
    );
    assert_eq!(
        show(propose(&two, 1, &parents("two-sensor", 10)).unwrap()),
        [
            "[0.5, 0.3, 0.9, 0.2, -0.2, 0.4, 0.2, 0, -0.7854]",
            "[0.5, 0.1, -0.5, 0.6, 0.4, -0.3, 0.9, -0.6, -1.0472]"
        ]
    );
}

#[test]
fn the_filter_discards_its_share_of_samples() {
    let with = propose(&single("filter = true", "population = 10000"), 0, &[]).unwrap();
    assert!(
        with.controllers
            .iter()
            .all(|controller| Score::of(controller).passes())
    );
    check_share(
        with.filtered as usize,
        with.filtered as usize + 10_000,
        43_065.0 / 194_481.0,
    );

    let without = propose(&single("", "population = 10000"), 0, &[]).unwrap();
    assert_eq!(without.filtered, 0);
    let failing = without
        .controllers
        .iter()
        .filter(|controller| !Score::of(controller).passes());
    check_share(failing.count(), 10_000, 43_065.0 / 194_481.0);
}

#[test]
fn random_search_never_looks_at_parents() {
    let random = spec("single-sensor", "random", "", "");
    let parents = parents("single-sensor", 5);
    assert_eq!(propose(&random, 3, &parents), propose(&random, 3, &[]));
    assert_ne!(propose(&random, 3, &[]), propose(&random, 4, &[]));
}

/// The chance that at least `least` of `trials` succeed, each with probability `p`.
#[test]
fn with_a_lag_the_second_generation_is_sampled_and_later_ones_have_older_parents() {
    let (now, lagging) = (single("", ""), single("", "lag = 1"));
    let of = |spec: &CampaignSpec| [0, 1, 2, 7].map(|generation| parents_of(spec, generation));
    assert_eq!(of(&now), [None, Some(0), Some(1), Some(6)]);
    assert_eq!(of(&lagging), [None, None, Some(0), Some(5)]);
    assert_eq!(of(&spec("single-sensor", "random", "", "")), [None; 4]);
    let [first, second] = [0, 1].map(|generation| propose(&lagging, generation, &[]).unwrap());
    assert_ne!(first, second);
    let refused = propose(&lagging, 2, &[]).unwrap_err();
    assert_eq!(refused, ProposeError::NoParents { generation: 2 });
}

fn at_least(least: i32, trials: i32, p: f64) -> f64 {
    let exactly = |k: i32| {
        let ways = (0..k).fold(1.0, |ways, i| ways * f64::from(trials - i) / f64::from(i + 1));
        ways * p.powi(k) * (1.0 - p).powi(trials - k)
    };
    (least..=trials).map(exactly).sum()
}

/// How often each of three parents, the most novel first, wins a tournament of `size` candidates.
fn chances(size: i32, pressure: f64) -> [f64; 3] {
    std::array::from_fn(|parent| {
        let place = |rank: i32| {
            let better = parent as f64 / 3.0;
            let as_good = better + 1.0 / 3.0;
            at_least(rank + 1, size, as_good) - at_least(rank + 1, size, better)
        };
        let wins = |rank: i32| (1.0 - pressure).powi(rank) * if rank + 1 == size { 1.0 } else { pressure };
        (0..size).map(|rank| place(rank) * wins(rank)).sum()
    })
}

#[test]
fn tournaments_favour_the_novel() {
    for (size, pressure) in [(1, 0.9), (2, 1.0), (2, 0.5), (10, 0.9), (10, 0.1)] {
        let search = format!(
            "population = 30000\ncrossover = 0.0\nmutation = 0.0\ntournament = {size}\ntournament_pressure = {pressure}"
        );
        let parents = [
            parent(&[0.1; 4], 2.0),
            parent(&[0.2; 4], 9.0),
            parent(&[0.3; 4], 5.0),
        ];
        let children = propose(&single("", &search), 1, &parents).unwrap().controllers;
        for (speed, expected) in [0.2, 0.3, 0.1].into_iter().zip(chances(size, pressure)) {
            let founded = children.iter().filter(|child| child.genes() == [speed; 4]);
            check_share(founded.count(), 30_000, expected);
        }
    }
}

#[test]
fn equally_novel_parents_rank_by_their_place() {
    let always_best =
        "population = 200\ncrossover = 0.0\nmutation = 0.0\ntournament = 60\ntournament_pressure = 1.0";
    let equal = [parent(&[0.1; 4], 1.0), parent(&[0.2; 4], 1.0)];
    let children = propose(&single("", always_best), 1, &equal).unwrap().controllers;
    assert!(children.iter().all(|child| child.genes() == [0.1; 4]));
}

#[test]
fn crossover_cuts_once_and_takes_from_both() {
    let crossed = "population = 30000\ncrossover = 1.0\nmutation = 0.0\ntournament = 1";
    let two = [parent(&[0.1; 4], 0.0), parent(&[0.2; 4], 0.0)];
    let children = propose(&single("", crossed), 1, &two).unwrap().controllers;
    for (genes, expected) in [
        ([0.1, 0.1, 0.1, 0.1], 1.0 / 4.0),
        ([0.1, 0.1, 0.1, 0.2], 1.0 / 12.0),
        ([0.1, 0.1, 0.2, 0.2], 1.0 / 12.0),
        ([0.1, 0.2, 0.2, 0.2], 1.0 / 12.0),
        ([0.2, 0.1, 0.1, 0.1], 1.0 / 12.0),
        ([0.1, 0.2, 0.1, 0.2], 0.0),
    ] {
        let like_this = children.iter().filter(|child| child.genes() == genes);
        check_share(like_this.count(), 30_000, expected);
    }
}

#[test]
fn mutation_moves_within_its_step_and_flips_signs() {
    let search = "population = 10000\ncrossover = 0.0\nmutation = 0.5\nmutation_step = 0.2\nsign_flip = 0.25";
    let angle = ControllerSpace::paper_angles()[0];
    let founder = parent(&[0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, angle], 0.0);
    let spec = spec("two-sensor", "hand-crafted", "", search);
    let children = propose(&spec, 1, &[founder]).unwrap().controllers;
    let speeds: Vec<f64> = children
        .iter()
        .flat_map(|child| child.genes()[..8].to_vec())
        .collect();
    assert!(speeds.iter().all(|speed| (0.3..=0.7).contains(&speed.abs())));
    let share = |expected, is: &dyn Fn(f64) -> bool| {
        check_share(
            speeds.iter().filter(|&&speed| is(speed)).count(),
            80_000,
            expected,
        );
    };
    share(0.125, &|speed| speed < 0.0);
    // With rounding to the grid, each end of the grid gets half a step, and each other value a whole step.
    share(0.5 * 0.75 / 8.0, &|speed| speed == 0.3);
    share(0.5 * 0.75 / 4.0, &|speed| speed == 0.4);
    share(0.5 + 0.5 * 0.75 / 4.0, &|speed| speed == 0.5);
    let kept = children.iter().filter(|child| child.genes()[8] == angle);
    check_share(kept.count(), 10_000, 0.5 + 0.5 / 10.0);
}

#[test]
fn what_cannot_be_bred_is_said() {
    let plain = single("", "");
    assert_eq!(
        propose(&plain, 1, &[]),
        Err(ProposeError::NoParents { generation: 1 })
    );
    let mixed = [parent(&[0.5; 4], 1.0), parent(&[0.5; 9], 1.0)];
    let foreign = ProposeError::ForeignParent {
        parent: 1,
        given: Preset::TwoSensor.into(),
        expected: Preset::SingleSensor.into(),
    };
    assert_eq!(propose(&plain, 1, &mixed), Err(foreign));
    let stuck = single("filter = true", "mutation = 0.0");
    let still = [parent(&[0.0; 4], 1.0)];
    assert_eq!(
        propose(&stuck, 2, &still),
        Err(ProposeError::AllFiltered { generation: 2 })
    );
}

/// Robots of all kinds, in the syntax of campaign files.
const ROBOTS: [&str; 5] = [
    "model = \"single-sensor\"",
    "model = \"two-sensor\"",
    "model = \"flockbots\"",
    "robot.sensors = [{ angle = \"free\", angle_range = [-0.5, 1.0], half_angle = 0.3 }, { angle = \"free\", angles = [0.1, 2.0] }, \
     {}]",
    "ratios = [[12, 12], [8, 16], [3, 21]]\nspecies = [{ name = \"a\", model = \"two-sensor\" }, { name = \"b\", robot = { drive = \
     \"unicycle\", max_speed = 5, max_turn = 0.5, sensors = [{ sees = [\"a\"] }] } }]",
];

proptest! {
    #[test]
    fn a_generation_fills_the_population_from_the_space(
        seed in 0..1000u64,
        robots in prop::sample::select(ROBOTS.to_vec()),
        filter: bool,
        step in prop::sample::select(vec![0.0, 0.1, 0.25, 1.0]),
        generation in 0..3u32,
        population in 1..40u32,
        rates in prop::array::uniform3(0.05..=1.0f64),
    ) {
        let [crossover, mutation, sign_flip] = rates;
        let top = format!("seed = {seed}\nfilter = {filter}\ncontrollers = {{ step = {step} }}\ntaxonomy = {{ medoids = 1 }}");
        let search = format!(
            "population = {population}\ncrossover = {crossover}\nmutation = {mutation}\nsign_flip = {sign_flip}"
        );
        let text = format!("method = \"hand-crafted\"\n{top}\n{robots}\n[search]\n{search}\n");
        let spec = CampaignSpec::from_toml(&text).unwrap();
        let first = propose(&spec, 0, &[]).unwrap().controllers;
        let parents: Vec<Parent> = (0..).zip(first)
            .map(|(i, controller)| Parent { controller, novelty: f64::from(i % 7) })
            .collect();
        let proposal = propose(&spec, generation, &parents).unwrap();
        prop_assert_eq!(proposal.controllers.len(), population as usize);
        for controller in &proposal.controllers {
            prop_assert_eq!(controller.model(), spec.model());
            prop_assert!(is_in(spec.controllers(), controller), "{} is not in the space", controller);
            prop_assert!(!filter || Score::of(controller).passes());
        }
        prop_assert!(filter || proposal.filtered == 0);
        prop_assert_eq!(propose(&spec, generation, &parents), Ok(proposal));
    }
}

#[test]
fn the_first_generation_begins_with_the_named_controllers_whatever_the_filter_says() {
    let with = |initial: &str| {
        single(
            &format!("filter = true\n[controllers]\n{initial}"),
            "population = 5\ngenerations = 3",
        )
    };
    let plain = propose(&with(""), 0, &[]).unwrap().controllers;
    let named = with("initial = [[0.05, 0, 0, 0], [0.05, 0, 0, 0]]");
    let begun = propose(&named, 0, &[]).unwrap().controllers;
    let genes = [0.05, 0.0, 0.0, 0.0];
    assert!(!Score::of(&begun[0]).passes(), "the test would show nothing");
    assert!(begun[..2].iter().all(|controller| controller.genes() == genes));
    // The other controllers are sampled as in a campaign without named controllers.
    assert_eq!(begun[2..], plain[..3]);
    let parents = parents("single-sensor", 5);
    assert_eq!(propose(&named, 1, &parents), propose(&with(""), 1, &parents));
}

#[test]
fn the_seed_of_a_start_follows_from_the_index_or_is_that_of_a_substitute() {
    let spec = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"random\"").unwrap();
    let own = start_seed(&spec, 7);
    let (controller, seed) = substitute(&spec, 7, 1).unwrap();
    let (other, _) = substitute(&spec, 7, 2).unwrap();
    assert!(is_start_of(&spec, 7, &other, own));
    assert!(is_start_of(&spec, 7, &controller, seed));
    for (index, controller, seed) in [(7, &other, seed), (8, &controller, seed), (7, &other, own ^ 1)] {
        assert!(!is_start_of(&spec, index, controller, seed));
    }
}

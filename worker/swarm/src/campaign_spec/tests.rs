//! Campaign files: their defaults, and errors in them.

use super::*;
use crate::Controller;
use proptest::prelude::*;

#[track_caller]
fn check_refused(text: &str, expected: &str) {
    let error = CampaignSpec::from_toml(text).unwrap_err().to_string();
    assert!(error.contains(expected), "{error:?} does not say {expected:?}");
}

const MINIMAL: &str = "model = \"single-sensor\"\nmethod = \"hand-crafted\"\n";

#[test]
fn what_is_not_said_takes_its_default() {
    let spec = CampaignSpec::from_toml(MINIMAL).unwrap();
    assert_eq!(spec.search().evaluations(), 10_000);
    assert_eq!((spec.medoids(), spec.search().neighbours()), (12, 15));
    assert_eq!(spec.name().as_str(), "single-sensor");
}

#[test]
fn what_is_wrong_is_named() {
    check_refused("model = ", "line 1");
    check_refused(
        "method = \"random\"",
        "model is missing: must be \"single-sensor\" or \"two-sensor\" or \"flockbots\" or \"turbopi\", unless a robot is described",
    );
    check_refused(
        "model = \"three-sensor\"\nmethod = \"random\"",
        "model = \"three-sensor\": must be",
    );
    check_refused(&format!("{MINIMAL}sed = 3"), "unknown field `sed`");
    check_refused(&format!("{MINIMAL}name = \"a b\""), "name = \"a b\"");
    check_refused(&format!("{MINIMAL}name = \"-x\""), "name = \"-x\"");
    check_refused(
        &format!("{MINIMAL}[search]\npopulation = 0"),
        "search.population = 0: must be a whole number from 1",
    );
    check_refused(
        &format!("{MINIMAL}[search]\nmutation = nan"),
        "search.mutation = NaN",
    );
    check_refused(
        &format!("{MINIMAL}[search]\npopulation = 1\ngenerations = 3\n[taxonomy]\nmedoids = 12"),
        "taxonomy.medoids = 12",
    );
    let few = CampaignSpec::from_toml(&format!("{MINIMAL}[search]\npopulation = 1\ngenerations = 3"));
    assert_eq!(few.unwrap().medoids(), 3);
    check_refused(
        &format!("{MINIMAL}[world]\nwidth = 30"),
        "world.width = 30: must be at least 2 (radius + padding) = 40",
    );
    check_refused(
        &format!("{MINIMAL}[image]\nresolution = 501"),
        "image.resolution = 501: must be a whole number from 1 to 500",
    );
    check_refused(
        &format!("{MINIMAL}[controllers]\nangles = [1.0]"),
        "controllers.angles",
    );
}

const THREE: &str = "method = \"random\"\n[robot]\nradius = 6\nsensors = [\n  { angle = 0.0 },\n  { angle = \"free\", \
                     angles = [0.5, -0.5], half_angle = 0.2, range = 120 },\n  { angle = 1.5, range = 40, sees = \
                     [\"walls\"] },\n]\n";

#[test]
fn a_described_robot_is_read_and_written() {
    let spec = CampaignSpec::from_toml(THREE).unwrap();
    assert_eq!((spec.model().genes(), spec.world().radius()), (17, 6.0));
    assert_eq!((spec.name().as_str(), spec.medoids()), ("robot", 16));
    assert_eq!(CampaignSpec::from_toml(&spec.to_toml()).unwrap(), spec);
    let of_list = THREE.replace("angles = [0.5, -0.5], ", "");
    check_refused(
        &of_list,
        "robot.sensors[1].angle = free: must be free with exactly one",
    );
    let spec = CampaignSpec::from_toml(&format!("{of_list}[controllers]\nangles = [0.5]")).unwrap();
    assert_eq!(spec.controllers().genes()[16], crate::GeneSpace::Among(vec![0.5]));
    assert_eq!(CampaignSpec::from_toml(&spec.to_toml()).unwrap(), spec);
    check_refused(
        &format!("model = \"two-sensor\"\n{THREE}"),
        "model = \"two-sensor\": must be absent",
    );
    check_refused(&THREE.replace("0.2", "3.2"), "robot.sensors[1].half_angle = 3.2");
    check_refused(
        &THREE.replace("\"walls\"", "\"cats\""),
        "robot.sensors[2].sees = \"cats\"",
    );
    check_refused(
        &THREE.replace("0.5, -0.5", "\"x\""),
        "robot.sensors[1].angles[0] must be a number",
    );
}

const TWO: &str = "method = \"random\"\nratios = [[12, 12], [8, 16]]\n[[species]]\nname = \"a\"\nmodel = \"two-sensor\"\n\
                   [[species]]\nname = \"b\"\nrobot.sensors = [{ sees = [\"a\"] }]\n";

#[test]
fn species_are_read_and_written() {
    let spec = CampaignSpec::from_toml(TWO).unwrap();
    assert_eq!((spec.model().genes(), spec.world().agents()), (14, 24));
    assert_eq!(spec.model().to_string(), "swarm of a and b");
    assert_eq!(CampaignSpec::from_toml(&spec.to_toml()).unwrap(), spec);
    check_refused(
        &format!("{TWO}[world]\nagents = 9"),
        "world.agents = 9: must be 24",
    );
    check_refused(
        &TWO.replace("\"a\"]", "\"c\"]"),
        "species[1].robot.sensors[0].sees = \"c\"",
    );
    check_refused(
        &TWO.replace("ratios = [[12, 12], [8, 16]]\n", ""),
        "species[0].count is missing",
    );
    check_refused(
        &TWO.replace("name = \"b\"", "name = \"b\"\ncount = 3"),
        "species[1].count = 3",
    );
    let spec = CampaignSpec::from_toml(&format!("{TWO}[image]\nchannels = \"species\"")).unwrap();
    assert_eq!(spec.image().shape().to_string(), "2 channels of 50 x 50");
    assert_eq!(CampaignSpec::from_toml(&spec.to_toml()).unwrap(), spec);
    check_refused(
        &format!("{TWO}[image]\nchannels = \"robots\""),
        "image.channels = \"robots\": must be \"one\" or \"species\"",
    );
    check_refused(
        &format!("{MINIMAL}[image]\nchannels = \"species\""),
        "image.channels = \"species\": must be \"one\": all robots are of one species",
    );
    check_refused(
        &format!(
            "{TWO}[image]\nchannels = \"species\"\nresolution = 700\n[search]\npopulation = 5000\n[world]\nwidth = \
             1000\nheight = 1000"
        ),
        "search.population = 5000: must be at most 4382 where image.resolution = 700 in 2 channels",
    );
    check_refused(
        &format!(
            "{TWO}[image]\nchannels = \"species\"\nresolution = 1000\n[world]\nwidth = 1000\nheight = 1000"
        ),
        "image.resolution = 1000: must be at most 707 in 2 channels",
    );
    let shares = TWO
        .replace("ratios = [[12, 12], [8, 16]]\n", "")
        .replace("name = ", "share = 0.5\nname = ");
    let spec = CampaignSpec::from_toml(&shares).unwrap();
    assert_eq!(spec.model().ratios(), [[12, 12]]);
    check_refused(&shares.replace("0.5", "0.3"), "species[0].share = 0.3");
    check_refused(
        &shares.replace("0.5", "0.25"),
        "species[0].share = 0.25: must be such that all species have a share, and all shares come to 1, not 0.5",
    );
    check_refused(
        &shares.replacen("share = 0.5", "count = 3", 1),
        "species[1].share = 0.5",
    );
    let none = shares.replace("share = 0.5", "count = 0");
    check_refused(
        &none,
        "species[0].count = 0: must be a whole number from 1 to 10000",
    );
}

#[test]
fn medoids_by_class_take_an_embedding_that_learns() {
    let latent = MINIMAL.replace("hand-crafted", "latent");
    let by_class = "[taxonomy]\nchoose = \"by-class\"";
    let spec = CampaignSpec::from_toml(&format!("{latent}{by_class}")).unwrap();
    assert_eq!(spec.choice(), Choice::ByClass);
    assert_eq!(CampaignSpec::from_toml(&spec.to_toml()).unwrap(), spec);
    check_refused(
        &format!("{MINIMAL}{by_class}"),
        "taxonomy.choose = \"by-class\": must be \"coverage\" or \"medoids\": the space \"features\" has no embedding",
    );
    check_refused(
        &format!("{latent}[taxonomy]\nchoose = \"best\""),
        "taxonomy.choose = \"best\": must be \"coverage\" or \"medoids\" or \"by-class\"",
    );
}

#[test]
fn a_method_has_the_spaces_that_it_can_be_measured_in() {
    let of = |method: &str, space: &str| {
        let text = MINIMAL.replace("hand-crafted", method);
        CampaignSpec::from_toml(&format!("{space}\n{text}")).map(|spec| spec.space())
    };
    assert_eq!(of("latent", "").unwrap(), BehaviourSpace::Both);
    assert_eq!(of("random", "").unwrap(), BehaviourSpace::Features);
    assert_eq!(of("random", "space = \"both\"").unwrap(), BehaviourSpace::Both);
    assert_eq!(
        of("latent", "space = \"embedding\"").unwrap(),
        BehaviourSpace::Embedding
    );
    let refused = of("hand-crafted", "space = \"both\"").unwrap_err().to_string();
    assert_eq!(
        refused,
        "space = \"both\": must be \"features\" with the method \"hand-crafted\""
    );
}

#[test]
fn what_cannot_be_held_at_once_is_refused_with_the_sum() {
    let large = "[world]\nwidth = 1000\nheight = 1000\n";
    check_refused(
        &format!("{MINIMAL}{large}[image]\nresolution = 1000\n[search]\npopulation = 100000"),
        "search.population = 100000: must be at most 4294 where image.resolution = 1000: the pictures of a \
         generation come to 100000000000 bytes, and at most 4294967296 are held at once",
    );
    check_refused(
        &format!("{MINIMAL}{large}[image]\nresolution = 1000\n[taxonomy]\nmedoids = 1000"),
        "taxonomy.medoids = 1000: must be at most",
    );
    check_refused(
        &format!("{MINIMAL}[world]\nagents = 10000\n[taxonomy]\nmedoids = 100"),
        "taxonomy.medoids = 100: must be at most 29 where image.resolution = 50 and world.agents = 10000",
    );
    let fits = [
        "[image]\nresolution = 1000\n[search]\npopulation = 4000\ngenerations = 3",
        "[image]\nresolution = 1000\n[taxonomy]\nmedoids = 900",
    ];
    for more in fits {
        CampaignSpec::from_toml(&format!("{MINIMAL}{large}{more}")).unwrap();
    }
    CampaignSpec::from_toml(&format!("{MINIMAL}[search]\npopulation = 100000")).unwrap();
}

#[test]
fn rounds_count_into_what_a_campaign_may_be() {
    let latent =
        "model = \"single-sensor\"\nmethod = \"latent\"\n[search]\npopulation = 1000\ngenerations = 1000\n";
    let rounds = |rounds, generations| {
        let text = format!("{latent}[feedback]\nrounds = {rounds}\ngenerations = {generations}");
        CampaignSpec::from_toml(&text)
    };
    assert_eq!(rounds(9, 1000).unwrap().evaluations(), Search::MAX_EVALUATIONS);
    assert!(rounds(0, 10_000).is_ok());
    for (many, long) in [(9, 1001), (10, 1000), (0, 10_001), (1000, 100_000)] {
        let error = rounds(many, long).unwrap_err().to_string();
        assert!(error.contains("at most 10000000 evaluations in all"), "{error}");
    }
}

proptest! {
    #[test]
    fn a_written_specification_reads_back(seed in 0..=i64::MAX as u64, width in 50.0..10_000.0f64, two: bool, filter: bool) {
        let model = if two { "two-sensor" } else { "single-sensor" };
        let text = format!("model = \"{model}\"\nmethod = \"random\"\nseed = {seed}\nfilter = {filter}\n[world]\nwidth = {width}\nradius = 4");
        let spec = CampaignSpec::from_toml(&text).unwrap();
        prop_assert_eq!(CampaignSpec::from_toml(&spec.to_toml()).unwrap(), spec);
    }

    #[test]
    fn any_text_is_read_or_refused(text in ".{0,200}") {
        let _ = CampaignSpec::from_toml(&text);
    }
}

#[test]
fn no_robot_leaps() {
    let spec = |text: &str| CampaignSpec::from_toml(&format!("method = \"random\"\n{text}"));
    let refused =
        spec("[robot]\nsensors = [{}]\nmax_speed = 1000.0\nwheel_radius = 1000.0\n[world]\ndt = 1000.0");
    assert_eq!(
        refused.unwrap_err().to_string(),
        "world.dt = 1000: must be at most 1e-2: robots drive up to 1e6 world units a unit of time, and may drive 10000 in a step"
    );
    let refused = spec("[robot]\nsensors = [{}]\nradius = 1e-300")
        .unwrap_err()
        .to_string();
    assert_eq!(
        refused,
        "robot.radius = 1e-300: must be a number from 0.001 to 1000"
    );
    spec("[robot]\nsensors = [{}]\nmax_speed = 1000.0\nradius = 0.001").unwrap();
}

#[test]
fn several_starts_are_refused_where_they_would_be_alike_or_too_many() {
    let spec = |text: &str| {
        let text = format!("model = \"single-sensor\"\nmethod = \"random\"\n{text}");
        CampaignSpec::from_toml(&text).map_err(|error| error.to_string())
    };
    assert_eq!(spec("").unwrap().starts(), Starts::ONE);
    let four = spec("[evaluation]\nstarts = 4").unwrap();
    assert_eq!((four.starts().get(), four.individual_bytes()), (4, 10_000));
    assert_eq!(CampaignSpec::from_toml(&four.to_toml()).unwrap(), four);

    let refused = spec("[evaluation]\nstarts = 17").unwrap_err();
    assert_eq!(
        refused,
        "evaluation.starts = 17: must be a whole number from 1 to 16"
    );
    let posed = "agents = 1\n[world.start]\nshape = \"poses\"\nposes = [[100.0, 100.0, 0.0]]\n[evaluation]\nstarts = 4";
    let refused = spec(&format!("[world]\n{posed}")).unwrap_err();
    assert!(
        refused.starts_with("evaluation.starts = 4: must be 1: all trials would be alike"),
        "{refused}"
    );
    spec(&format!("[world]\nnoise.slip = 0.1\n{posed}")).unwrap();
    let refused = spec("[image]\nresolution = 400\n[evaluation]\nstarts = 8").unwrap_err();
    assert!(
        refused.starts_with("evaluation.starts = 8: must be at most 6 where image.resolution = 400"),
        "{refused}"
    );
    let refused =
        spec("[search]\npopulation = 1000\ngenerations = 1000\n[evaluation]\nstarts = 11").unwrap_err();
    assert!(
        refused.starts_with("evaluation.starts = 11: must be at most 10 for 1000000 evaluations"),
        "{refused}"
    );
}

#[test]
fn a_first_generation_may_begin_with_named_controllers() {
    let named = |genes: &str, search: &str| {
        format!("{MINIMAL}[controllers]\ninitial = {genes}\n[search]\n{search}\n")
    };
    // The second controller is off the grid.
    let spec = CampaignSpec::from_toml(&named("[[-0.7, 0.3, 1, 1], [0.123, 0, 0, 0]]", "")).unwrap();
    let genes: Vec<_> = spec
        .controllers()
        .initial()
        .iter()
        .map(Controller::genes)
        .collect();
    assert_eq!(genes, [[-0.7, 0.3, 1.0, 1.0], [0.123, 0.0, 0.0, 0.0]]);
    assert_eq!(CampaignSpec::from_toml(&spec.to_toml()).unwrap(), spec);
    check_refused(
        &named("[[1, 1, 2, 0]]", ""),
        "controllers.initial[0].left_1 = 2: must be a number from -1 to 1",
    );
    check_refused(
        &named("[[1, 1, 0]]", ""),
        "controllers.initial[0] = [1.0, 1.0, 0.0]: must be 4 values",
    );
    let three = "[[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]]";
    check_refused(
        &named(three, "population = 2"),
        "controllers.initial = 3 controllers: must be at most 2 controllers where search.population = 2",
    );
    let many = format!("[{}]", "[0, 0, 0, 0],".repeat(1001));
    check_refused(
        &named(&many, "population = 2000"),
        "controllers.initial = 1,001 controllers: must be at most 1000",
    );
    assert!(
        !CampaignSpec::from_toml(MINIMAL)
            .unwrap()
            .to_toml()
            .contains("initial")
    );
}

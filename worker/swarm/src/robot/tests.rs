//! Robots that are allowed, and the names of their genes.

use super::*;
use std::f64::consts::PI;

fn sensor(described: SensorDescription) -> Result<Sensor, Invalid> {
    Sensor::try_from(described)
}

const DEFAULTS: Defaults = Defaults {
    radius: 5.0,
    wheel_radius: 2.0,
    agents: 24,
};

fn plain() -> SensorDescription {
    SensorDescription::default()
}

fn wheels() -> Drive {
    Drive::differential(2.0, 1.0).unwrap()
}

fn robot(sensors: usize) -> Result<Robot, Invalid> {
    Robot::new(vec![sensor(plain()).unwrap(); sensors], 5.0, wheels())
}

fn name(name: &str) -> SpeciesName {
    SpeciesName::parse("name", name).unwrap()
}

fn refused<T: std::fmt::Debug>(result: Result<T, Invalid>, expected: &str) {
    assert_eq!(result.unwrap_err().to_string(), expected);
}

#[test]
fn a_robot_has_one_to_six_sensors_and_a_body() {
    for sensors in 1..=6 {
        assert_eq!(robot(sensors).unwrap().states(), 1 << sensors);
    }
    refused(robot(7), "sensors = 7 sensors: must be 1 to 6 sensors");
    refused(robot(0), "sensors = 0 sensors: must be 1 to 6 sensors");
    let flat = Robot::new(vec![sensor(plain()).unwrap()], 0.0, wheels());
    refused(flat, "radius = 0: must be a number from 0.001 to 1000");
}

#[test]
fn what_a_sensor_cannot_be_is_named() {
    let cone = |half_angle| SensorDescription {
        half_angle,
        ..plain()
    };
    refused(
        sensor(cone(3.2)),
        "half_angle = 3.2: must be a number from 0 to 3.141592653589793",
    );
    refused(
        sensor(cone(45.0)),
        "half_angle = 45: must be a number from 0 to 3.141592653589793, in radians: 45 degrees are 0.7854",
    );
    assert!(sensor(cone(PI)).is_ok());
    let range = SensorDescription {
        range: Some(0.0),
        ..plain()
    };
    refused(
        sensor(range),
        "range = 0: must be a number over 0 and at most 1000000",
    );
    let sees = |sees: &[&str], range, wall_range| {
        let sees = sees.iter().map(|seen| seen.parse().unwrap()).collect();
        sensor(SensorDescription {
            sees,
            range,
            wall_range,
            ..plain()
        })
    };
    refused(
        sees(&["walls"], None, None),
        "range is missing: must be given, or wall_range, for a sensor that sees walls: without a limit it would always see a wall",
    );
    refused(
        sees(&["robots"], None, Some(9.0)),
        "wall_range = 9: must be absent from a sensor that does not see walls",
    );
    refused(
        sees(&["robots", "b"], None, None),
        "sees = robots, b: must be all robots or one species, not both",
    );
    refused(
        sees(&["walls", "walls"], Some(1.0), None),
        "sees = walls, walls: must be without a second \"walls\"",
    );
    refused(
        sees(&[], None, None),
        "sees is missing: must be robots, a species, walls or obstacles",
    );
    assert_eq!(
        sees(&["walls"], Some(40.0), None).unwrap().wall_range(),
        Some(40.0)
    );
    let both = sees(&["b", "walls", "obstacles"], None, Some(40.0)).unwrap();
    assert_eq!((both.range(), both.wall_range()), (None, Some(40.0)));
    assert_eq!(both.robots(), &SeenRobots::Species(name("b")));
    assert!(both.sees_obstacles() && !both.is_plain_ray());
}

#[test]
fn a_free_angle_has_a_range_or_a_list() {
    let neither = "angle = free: must be free with exactly one of angle_range and angles";
    refused(SensorAngle::free(None, &[]), neither);
    refused(SensorAngle::free(Some([0.0, 1.0]), &[0.5]), neither);
    refused(
        SensorAngle::free(Some([1.0, 1.0]), &[]),
        "angle_range = [1, 1]: must be a lower and a higher angle",
    );
    assert_eq!(
        SensorAngle::free(None, &[0.0, 7.0]).unwrap_err().field,
        "angles[1]"
    );
    assert_eq!(SensorAngle::fixed(f64::NAN).unwrap_err().field, "angle");
    let within = SensorAngle::free(Some([-1.0, 1.0]), &[]).unwrap();
    assert_eq!(within.chosen("gene", 1.0), Ok(1.0));
    refused(
        within.chosen("gene", 1.1),
        "gene = 1.1: must be a number from -1 to 1",
    );
    let among = SensorAngle::free(None, &[0.5, -0.5]).unwrap();
    assert_eq!(among.chosen("gene", -0.5 + 1e-12), Ok(-0.5));
    refused(
        among.chosen("gene", 0.4),
        "gene = 0.4: must be one of [0.5, -0.5]",
    );
}

#[test]
fn genes_are_named_by_what_the_sensors_see() {
    let second = sensor(SensorDescription {
        angle: SensorAngle::free(None, &[0.3]).unwrap(),
        ..plain()
    });
    let sensors = vec![sensor(plain()).unwrap(), second.unwrap()];
    let differential = Robot::new(sensors.clone(), 5.0, wheels()).unwrap();
    let names = [
        "left_00", "right_00", "left_01", "right_01", "left_10", "right_10", "left_11", "right_11", "angle_2",
    ];
    assert_eq!(differential.gene_names(), names);
    let unicycle = Robot::new(sensors[..1].to_vec(), 5.0, Drive::unicycle(20.0, 2.0).unwrap()).unwrap();
    let species = vec![
        Species::new(name("a"), unicycle),
        Species::new(name("b"), differential),
    ];
    let both = CapabilityModel::new(species, vec![vec![2, 1], vec![1, 2]]).unwrap();
    let names = both.gene_names();
    assert_eq!(names[..4], ["a.speed_0", "a.turn_0", "a.speed_1", "a.turn_1"]);
    assert_eq!(
        (names[4].as_str(), names[12].as_str()),
        ("b.left_00", "b.angle_2")
    );
    assert_eq!((both.genes(), names.len()), (14, 14));
    assert_eq!((names[13].as_str(), both.robots()), ("ratio", Some(3)));
}

#[test]
fn species_see_only_species_that_there_are() {
    let sees = |seen: &str| {
        sensor(SensorDescription {
            sees: vec![seen.parse().unwrap()],
            ..plain()
        })
    };
    let with = |called, seen| {
        let robot = Robot::new(vec![sees(seen).unwrap()], 5.0, wheels()).unwrap();
        Species::new(name(called), robot)
    };
    let swarm = |species: Vec<Species>, counts: &[u32]| CapabilityModel::new(species, vec![counts.to_vec()]);
    refused(
        swarm(vec![with("a", "robots"), with("b", "c")], &[1, 1]),
        "species[1].robot.sensors[0].sees = \"c\": must be robots, walls, obstacles, or one of the species a, b",
    );
    refused(
        swarm(vec![with("a", "a"), with("a", "a")], &[1, 1]),
        "species[1].name = a: must be a name that no other species has",
    );
    refused(
        swarm(Vec::new(), &[]),
        "species = 0 species: must be 1 to 8 species",
    );
    refused(
        CapabilityModel::of_one(with("a", "b").robot().clone()),
        "sensors[0].sees = \"b\": must be robots, walls or obstacles: this swarm has no species",
    );
    for bad in ["", "walls", "2b", "a.b", "a b", &"a".repeat(33)] {
        assert!(SpeciesName::parse("name", bad).is_err(), "{bad}");
    }
}

#[test]
fn ratios_are_of_all_species_and_of_one_number_of_robots() {
    let robot = || robot(1).unwrap();
    let with = |ratios: &[&[u32]]| {
        let species = vec![Species::new(name("a"), robot()), Species::new(name("b"), robot())];
        CapabilityModel::new(species, ratios.iter().map(|counts| counts.to_vec()).collect())
    };
    refused(with(&[]), "ratios = 0 ratios: must be 1 to 1000 ratios");
    let numbers = "must be 2 numbers, one for each species, each at least 1";
    refused(with(&[&[1]]), &format!("ratios[0] = [1]: {numbers}"));
    refused(
        with(&[&[1, 1], &[2, 0]]),
        &format!("ratios[1] = [2, 0]: {numbers}"),
    );
    refused(
        with(&[&[1, 2], &[2, 2]]),
        "ratios[1] = [2, 2]: must be 3 robots in all, as in the first ratio",
    );
    refused(
        with(&[&[u32::MAX, 1]]),
        "ratios[0] = [4294967295, 1]: must be at most 10000 robots in all",
    );
    refused(
        with(&[&[1, 2], &[1, 2]]),
        "ratios[1] = [1, 2]: must be a ratio that is not given twice",
    );
    let model = with(&[&[12, 12], &[8, 16]]).unwrap();
    let mut genes = vec![0.5; 9];
    genes[8] = 1.0;
    let controller = Controller::new(&model, &genes).unwrap();
    assert_eq!(controller.counts(24), [8, 16]);
    for bad in [-1.0, 0.5, 2.0, f64::NAN] {
        genes[8] = bad;
        let error = Controller::new(&model, &genes).unwrap_err();
        assert_eq!(error.allowed, "the place of a ratio: a whole number from 0 to 1");
    }
}

#[test]
fn a_controller_keeps_to_the_limits_of_its_robot() {
    let check = |genes: &[f64], expected: &str| refused(Controller::new(Preset::Flockbots, genes), expected);
    check(
        &[20.0, 2.0, -20.0, 2.1],
        "controller.turn_1 = 2.1: must be a number from -2 to 2",
    );
    check(
        &[21.0, 2.0, -20.0, 2.0],
        "controller.speed_0 = 21: must be a number from -20 to 20",
    );
    let genes = [0.1, -0.0, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, -1.5];
    let controller = Controller::new(Preset::TwoSensor, &genes).unwrap();
    let robot = controller.robots().next().unwrap();
    assert_eq!(robot.angles().collect::<Vec<_>>(), [0.0, -1.5]);
    assert_eq!(robot.pairs()[2], [0.4, 0.5]);
    assert_eq!(
        controller.to_string(),
        "[0.1, 0, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, -1.5000]"
    );
    let species = |called| Species::new(name(called), Preset::TwoSensor.robot());
    let both = CapabilityModel::new(vec![species("a"), species("b")], vec![vec![3, 3]]).unwrap();
    let mut twice = [genes, genes].concat();
    let controller = Controller::new(&both, &twice).unwrap();
    assert_eq!(controller.genes(), twice);
    assert!(controller.robots().all(|robot| robot.genes() == genes));
    twice[17] = 4.0;
    assert_eq!(
        Controller::new(both, &twice).unwrap_err().field,
        "controller.b.angle_2"
    );
}

#[test]
fn a_model_is_the_same_after_its_message() {
    let cone = sensor(SensorDescription {
        angle: SensorAngle::free(Some([-1.0, 1.0]), &[]).unwrap(),
        half_angle: 0.2,
        range: Some(120.0),
        sees: vec!["b".parse().unwrap(), Seen::Walls],
        wall_range: Some(40.0),
    });
    let among = sensor(SensorDescription {
        angle: SensorAngle::free(None, &[0.5, -0.5]).unwrap(),
        ..plain()
    });
    let sensors = vec![cone.unwrap(), among.unwrap()];
    let a = Robot::new(sensors, 7.0, Drive::unicycle(20.0, 2.0).unwrap()).unwrap();
    let species = vec![
        Species::new(name("a"), a),
        Species::new(name("b"), robot(3).unwrap()),
    ];
    let several = CapabilityModel::new(species, vec![vec![3, 1], vec![2, 2]]).unwrap();
    for model in Preset::ALL
        .map(CapabilityModel::from)
        .into_iter()
        .chain([several])
    {
        let message = murmuration_proto::v1::CapabilityModel::from(&model);
        assert_eq!(CapabilityModel::try_from(message).as_ref(), Ok(&model));
        let line = model.to_line();
        assert!(!line.contains('\n'), "{line}");
        assert_eq!(
            CapabilityModel::of_line("robots", &line, &DEFAULTS),
            Ok(model),
            "{line}"
        );
    }
    let read = |line| {
        CapabilityModel::of_line("robots", line, &DEFAULTS)
            .unwrap_err()
            .field
    };
    assert_eq!(read("{ model = \"turbopi\", ratios = [[1]] }"), "robots.ratios");
    assert_eq!(
        read("{ model = \"turbopi\", species = [{ name = \"a\", count = 1, model = \"turbopi\" }] }"),
        "robots.model"
    );
    assert_eq!(read("turbopi"), "robots");
    let large = CapabilityModel::of_one(Preset::TwoSensor.sized(9.0, 1.0).unwrap()).unwrap();
    assert_eq!(large.preset(), Some(Preset::TwoSensor));
}

#[test]
fn every_preset_is_a_robot_and_is_found_by_its_name() {
    for preset in Preset::ALL {
        assert_eq!(preset.name().parse::<Preset>(), Ok(preset));
        assert!(preset.robot().genes() >= 4);
    }
    assert_eq!(Preset::SingleSensor.robot().genes(), 4);
    assert_eq!(Preset::TwoSensor.robot().genes(), 9);
    refused(
        "three".parse::<Preset>(),
        "model = \"three\": must be \"single-sensor\" or \"two-sensor\" or \"flockbots\" or \"turbopi\"",
    );
}

#[test]
fn one_kind_of_things_to_see_needs_no_list() {
    let read = |sees: &str| {
        let text = format!(
            "method = \"random\"\n[[species]]\nname = \"prey\"\ncount = 3\nrobot.sensors = [{{ sees = {sees} }}]\n\
             [[species]]\nname = \"predator\"\ncount = 2\nmodel = \"single-sensor\"\n"
        );
        crate::CampaignSpec::from_toml(&text).map(|spec| spec.model().clone())
    };
    assert_eq!(read("\"predator\"").unwrap(), read("[\"predator\"]").unwrap());
    assert!(
        read("3")
            .unwrap_err()
            .to_string()
            .contains("what the sensor sees, such as \"robots\"")
    );
}

#[test]
fn an_angle_in_degrees_is_told_in_radians() {
    let message = |sensor: &str| {
        let text = format!("method = \"random\"\nrobot.sensors = [{{ {sensor} }}]");
        crate::CampaignSpec::from_toml(&text).unwrap_err().to_string()
    };
    for (field, limits) in [
        ("angle", "-6.283185307179586 to 6.283185307179586"),
        ("half_angle", "0 to 3.141592653589793"),
    ] {
        assert_eq!(
            message(&format!("{field} = 45")),
            format!(
                "robot.sensors[0].{field} = 45: must be a number from {limits}, in radians: 45 degrees are 0.7854"
            )
        );
    }
}

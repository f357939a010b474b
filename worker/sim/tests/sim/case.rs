//! Tests of cases that lack keys, and of cases that cannot be simulated.

use murmuration_sim::case::{Case, CaseError};
use serde_json::{Value, json};
use std::num::NonZeroU32;

/// The smallest case, with additional keys.
fn case(more: Value) -> Value {
    let mut case = json!({"controller": [0.6, 1.0, 0.4, 0.5], "initial": [[100, 100.5, 0], [300, 200, 1.5]]});
    for (key, value) in more.as_object().unwrap() {
        case[key] = value.clone();
    }
    case
}

fn run(case: &Value) -> Result<Value, CaseError> {
    Case::from_json(&case.to_string())?.run()
}

#[test]
fn what_is_missing_has_the_papers_value_and_comes_at_the_end() {
    let ours = run(&case(json!({"steps": 30, "name": "small"}))).unwrap();
    let keys: Vec<_> = ours.as_object().unwrap().keys().map(String::as_str).collect();
    let added = [
        "jitter_events",
        "checkpoints",
        "features",
        "image",
        "image_raw",
        "reference",
    ];
    assert_eq!(keys[..4], ["controller", "initial", "steps", "name"]);
    assert_eq!(keys[4..], added);
    let steps: Vec<_> = ours["checkpoints"].as_object().unwrap().keys().cloned().collect();
    assert_eq!(steps, ["1", "2", "5", "10", "20", "30"]);
    assert_eq!(ours["checkpoints"]["30"].as_array().unwrap().len(), 2);
    let spelled_out = json!({
        "model": "single_sensor", "agents": 2, "agent_radius": 5, "wheel_radius": 2.0, "dt": 1, "world": [500, 500.0],
        "padding": 15, "steps": 30.0, "jitter": "disabled", "image": null,
    });
    assert_eq!(
        run(&case(spelled_out)).unwrap()["checkpoints"],
        ours["checkpoints"]
    );
}

#[test]
fn the_keys_keep_their_order_and_what_is_not_ours_is_passed_on() {
    let document = case(json!({
        "features": "?", "notes": [1, {"a": null}], "reference": "theirs", "steps": 3, "checkpoints": {"3": 0, "0": []},
    }));
    let ours = run(&document).unwrap();
    let order = |value: &Value| value.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    assert_eq!(order(&ours)[..order(&document).len()], order(&document));
    assert_eq!(ours["notes"], document["notes"]);
    assert_eq!(ours["initial"], document["initial"]);
    assert_eq!(order(&ours["checkpoints"]), ["3", "0"]);
    assert_eq!(
        ours["checkpoints"]["0"][0],
        json!([100.0, 100.5, 0.0, 0, 0.0, 0.0])
    );
    assert_eq!(ours["features"].as_array().unwrap().len(), 5);
    assert_eq!(
        ours["reference"],
        format!(
            "murmuration, simulator version {}",
            murmuration_proto::SIMULATOR_VERSION
        )
    );
}

#[test]
fn worlds_of_other_sizes_are_simulated() {
    for world in [json!([700.5, 300]), json!([60, 45]), json!([1000, 1000])] {
        let ours = run(&case(
            json!({"world": world, "steps": 20, "padding": 0, "agent_radius": 2.5, "dt": 0.5}),
        ));
        assert!(ours.is_ok(), "{world}");
    }
}

#[test]
fn an_error_names_the_key() {
    let check = |more: Value, expected: &str| {
        assert_eq!(run(&case(more)).unwrap_err().to_string(), expected);
    };
    check(
        json!({"controller": null}),
        "controller is missing: must be given",
    );
    check(
        json!({"controller": [0.1, 2, 0, 0]}),
        "controller.right_0 = 2: must be a number from -1 to 1",
    );
    check(
        json!({"controller": [0.1, "a", 0, 0]}),
        "controller[1] = \"a\": must be a number",
    );
    check(
        json!({"controller": [0.1]}),
        "controller = 1 value: must be 4 values for the single-sensor model or 9 for the two-sensor model",
    );
    check(
        json!({"model": "two_sensor"}),
        "controller = [0.6, 1.0, 0.4, 0.5]: must be 9 values for the two-sensor model",
    );
    check(
        json!({"model": "three"}),
        "model = \"three\": must be \"single_sensor\" or \"two_sensor\"",
    );
    check(
        json!({"initial": [[1, 2]]}),
        "initial[0] = [1,2]: must be [x, y, theta]",
    );
    check(
        json!({"initial": []}),
        "agents = 0: must be a whole number from 1 to 10000",
    );
    check(
        json!({"agents": 3}),
        "initial = 2 poses: must be one for each of 3 agents",
    );
    check(json!({"world": 500}), "world = 500: must be an array");
    check(
        json!({"world": [500, 0]}),
        "world[1] = 0: must be a number from 1 to 10000",
    );
    check(
        json!({"agent_radius": -1}),
        "agent_radius = -1: must be a number from 0.001 to 1000",
    );
    check(json!({"steps": 1.5}), "steps = 1.5: must be a whole number");
    check(
        json!({"steps": 0}),
        "steps = 0: must be a whole number from 1 to 10000000",
    );
    check(
        json!({"steps": 9, "checkpoints": {"10": []}}),
        "checkpoints = \"10\": must be a whole number from 0 to 9",
    );
    check(
        json!({"jitter": 1}),
        "jitter = 1: must be \"disabled\" or \"enabled\"",
    );
}

#[test]
fn what_is_no_object_is_no_case() {
    assert!(matches!(Case::from_json("{"), Err(CaseError::Syntax(_))));
    let error = Case::from_json("[1]").unwrap_err();
    assert_eq!(error.to_string(), "case = [1]: must be a JSON object");
}

/// A case of two species, the first with additional keys.
fn of_species(more: Value) -> Value {
    let sensor =
        json!({"angle": 0.1, "half_angle": 0.2, "range": 90, "sees_species": "all", "sees_walls": false});
    let mut first = json!({
        "name": "a", "count": 1, "radius": 5, "drive": {"kind": "unicycle"}, "sensors": [sensor],
        "controller": [9.5, 0.3, -20.0, 1],
    });
    for (key, value) in more.as_object().unwrap() {
        first[key] = value.clone();
    }
    let second = json!({
        "name": "b", "count": 1, "radius": 3, "drive": {"kind": "differential", "wheel_radius": 2},
        "sensors": [{"sees_species": "a"}, {"angle": 1, "sees_species": "none", "wall_range": 9.5}],
        "controller": [1, 1, 1, 1, 1, 1, 1, 1],
    });
    json!({
        "physics": "head", "species": [first, second], "species_of_agent": [0, 1], "steps": 40, "walls": false,
        "initial": [[400, 400.5, 0], [490, 460, 0]],
    })
}

#[test]
fn robots_of_several_species_are_simulated() {
    let ours = run(&of_species(json!({}))).unwrap();
    let end = &ours["checkpoints"]["40"];
    let x = end[1][0].as_f64().unwrap();
    assert!(x > 500.0, "no wall stops robot 1: {end}");
    assert_eq!(ours["physics"], "feb2023");
    assert_eq!(ours["features"].as_array().unwrap().len(), 5);
    let mut walled = of_species(json!({}));
    walled["walls"] = json!(true);
    let end = run(&walled).unwrap();
    // With the padding 15 and its radius 3, robot 1 stops 18 units before the edge. The robot sees the wall.
    assert_eq!(end["checkpoints"]["40"][1][0], json!(482.0));
    assert_eq!(end["checkpoints"]["40"][1][3].as_u64().unwrap() % 2, 1);
    let case = Case::from_json(&walled.to_string()).unwrap();
    assert_eq!(case.controller().counts(2), [1, 1]);
    let replay = case.replay(NonZeroU32::new(8).unwrap()).unwrap();
    assert_eq!((replay.steps().len(), case.world().agents()), (6, 2));
}

#[test]
fn an_error_names_the_key_of_a_species() {
    let check = |more: Value, expected: &str| {
        assert_eq!(run(&of_species(more)).unwrap_err().to_string(), expected);
    };
    let sensors = |more: Value| json!({"sensors": [more]});
    check(
        sensors(json!({"half_angle": 4})),
        "species[0].sensors[0].half_angle = 4: must be a number from 0 to 3.141592653589793",
    );
    check(
        sensors(json!({"sees_walls": true})),
        "species[0].sensors[0].range is missing: must be given, or wall_range, for a sensor that sees walls: without a limit it would always see a wall",
    );
    check(
        sensors(json!({"false_negative": 0.1})),
        "species[0].sensors[0].false_negative = 0.1: must be 0: false readings are not simulated",
    );
    check(
        sensors(json!({"goal_range": 9})),
        "species[0].sensors[0].goal_range = given: must be absent: goals are not simulated",
    );
    check(
        sensors(json!({"sees_species": "c"})),
        "species[0].robot.sensors[0].sees = \"c\": must be robots, walls, obstacles, or one of the species a, b",
    );
    check(
        json!({"sensors": [{}, {}, {}, {}, {}, {}, {}]}),
        "species[0].sensors = 7 sensors: must be 1 to 6 sensors",
    );
    check(
        json!({"controller": [1, 2]}),
        "species[0].controller = 2 values: must be 4 values, two for each state of 1 sensor",
    );
    check(
        json!({"drive": {"kind": "legs"}}),
        "species[0].drive.kind = \"legs\": must be \"differential\" or \"unicycle\"",
    );
    check(
        json!({"drive": {}}),
        "species[0].drive.kind is missing: must be given",
    );
    check(
        json!({"count": 2}),
        "species_of_agent = [0,1]: must be the species of each agent, in the order of the species, `count` agents each",
    );
    let mut goal = of_species(json!({}));
    goal["goal"] = json!({"center": [1, 1], "radius": 20});
    assert_eq!(
        run(&goal).unwrap_err().to_string(),
        "goal = given: must be absent: goals are not simulated"
    );
}

//! Worlds of RobotSwarmSimulator become campaign files, and what these cannot have is named.

use super::*;
use murmuration_proto::Controller;

fn agent(kind: &str, dt: f64, controller: &str, sensor: &str) -> String {
    format!(
        "{{\"type\": \"{kind}\", \"x\": null, \"seed\": null, \"dt\": {dt:?}, \"agent_radius\": 7, \"wheel_radius\": 2.0, \
         \"controller\": {controller}, \"sensors\": {{\"sensors\": [{sensor}], \"custom_state_decision\": null}}}}"
    )
}

const RAY: &str = r#"{"type": "BinaryLOSSensor", "angle": 0, "history_length": 50}"#;
const CONE: &str = r#"{"type": "BinaryFOVSensor", "theta": 0.12, "bias": 0.07, "fp": 0.1, "fn": 0.05, "use_goal_state": false, "wall_sensing_range": 60.4, "agent_sensing_range": 200.0}"#;

fn world(agents: &str, more: &str) -> Result<Converted, String> {
    let text = format!(
        "{{\"behavior\": [], \"w\": 700, \"h\": 500, \"population_size\": 3, \"seed\": null, \"padding\": 15, \
         \"agent_config\": {agents}, \"show_walls\": true, \"collide_walls\": true, \"stop_at\": null, \"objects\": [], \
         \"goals\": []{more}}}"
    );
    let world: SavedWorld = serde_json::from_str(&text).map_err(|error| error.to_string())?;
    world.convert()
}

/// The specification, and whether its robots take the controller that its comment has.
fn spec(converted: &Converted) -> CampaignSpec {
    let spec = CampaignSpec::from_toml(&converted.text).unwrap();
    let line = converted
        .text
        .lines()
        .find_map(|line| line.strip_prefix("# --controller "));
    let genes: Vec<f64> = line
        .unwrap()
        .split(',')
        .map(|gene| gene.parse().unwrap())
        .collect();
    Controller::new(spec.model(), &genes).unwrap();
    spec
}

#[test]
fn a_world_of_one_species_is_a_campaign() {
    let agents = agent("DiffDriveAgentConfig", 1.0, "[-0.7, 0.3, 1.0, 1.0]", RAY);
    let converted = world(
        &agents,
        ", \"agent_init\": [[100, 91, 5.25], [100, 293, 1], [9, 9, 0]]",
    )
    .unwrap();
    let spec = spec(&converted);
    let world = spec.world();
    assert_eq!((world.agents(), world.horizon()), (3, 1200));
    assert_eq!(spec.model().species()[0].robot().radius(), 7.0);
    assert!(converted.text.contains("shape = \"poses\""), "{}", converted.text);
    assert_eq!(converted.left_out.len(), 1, "{:?}", converted.left_out);
}

#[test]
fn two_species_keep_their_sensors_drives_counts_and_speeds() {
    let one = agent("UnicycleAgentConfig", 0.13, "[-2.0, -0.6, -20.0, -0.5]", CONE);
    let other = agent("MazeAgentConfig", 0.13, "[5, 0.3, 12.0, 0.0, 16.0, 0.02]", CONE);
    let agents = format!(
        "{{\"type\": \"HeterogeneousSwarmConfig\", \"sub_population_configs\": [{one}, {other}], \"counts\": [20, 10]}}"
    );
    let converted = world(&agents, "").unwrap();
    let spec = spec(&converted);
    assert_eq!((spec.model().species().len(), spec.world().agents()), (2, 30));
    let first = spec.model().species()[0].robot();
    assert_eq!(first.gene_names(), ["speed_0", "turn_0", "speed_1", "turn_1"]);
    let said = converted.left_out.join("; ");
    for what in [
        "false readings",
        "population_size",
        "pairs of a controller for goals",
        "wall_sensing_range of a sensor",
    ] {
        assert!(said.contains(what), "{said}");
    }
}

#[test]
fn whatever_may_have_moved_a_robot_is_said_to_be_left_out() {
    let ray = RAY.replace("50}", "50, \"time_step_between_sensing\": 2, \"invert\": true}");
    let agents = agent("DiffDriveAgentConfig", 1.0, "[-0.7, 0.3, 1.0, 1.0]", &ray)
        .replace(
            "\"custom_state_decision\": null",
            "\"custom_state_decision\": \"mine\"",
        )
        .replace("\"x\": null", "\"x\": 3, \"stop_on_collision\": true");
    let left_out = |agents: &str, goals: &str| {
        let more = format!(", \"gravity\": 9.8, \"wind\": 0, \"background_color\": [0, 0, 0]{goals}");
        world(agents, &more).unwrap().left_out
    };
    assert_eq!(
        left_out(&agents, ""),
        [
            "custom_state_decision of an agent's sensors",
            "gravity of the world",
            "invert of a sensor",
            "stop_on_collision of an agent",
            "time_step_between_sensing of a sensor",
        ]
    );
    let plain = agent("DiffDriveAgentConfig", 1.0, "[-0.7, 0.3, 1.0, 1.0]", RAY);
    let text = format!(
        "{{\"w\": 700, \"h\": 500, \"population_size\": 3, \"padding\": 15, \"agent_config\": {plain}, \
         \"collide_walls\": true, \"stop_at\": null, \"goals\": [{{\"type\": \"CylinderGoal\"}}]}}"
    );
    let unsensed: SavedWorld = serde_json::from_str(&text).unwrap();
    assert_eq!(
        unsensed.convert().unwrap().left_out,
        ["goals, which no sensor sees"]
    );
}

#[test]
fn what_cannot_be_a_campaign_is_named() {
    let short = agent("DiffDriveAgentConfig", 1.0, "[-0.7, 0.3]", RAY);
    assert!(
        world(&short, "")
            .unwrap_err()
            .contains("2 numbers, and 4 are needed")
    );
    let blind = agent("DiffDriveAgentConfig", 1.0, "[]", "");
    assert!(world(&blind, "").unwrap_err().contains("sensors: 0 of them"));
    let [one, other] = [1.0, 0.5].map(|dt| agent("DiffDriveAgentConfig", dt, "[1, 1, 1, 1]", RAY));
    let several = |counts: &str| {
        let agents = format!(
            "{{\"type\": \"HeterogeneousSwarmConfig\", \"sub_population_configs\": [{one}, {other}], \"counts\": {counts}}}"
        );
        world(&agents, "").unwrap_err()
    };
    assert!(several("[1, 2]").contains("dt: its species differ"));
    assert!(several("[3]").contains("counts"));
    let flying = agent("DroneAgentConfig", 1.0, "[1, 1, 1, 1]", RAY);
    assert!(world(&flying, "").is_err());
}

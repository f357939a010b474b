//! Worlds in campaign files: reading, writing and errors.

use crate::{CampaignSpec, Noise, Obstacle, StartShape, World};

fn world(text: &str) -> Result<World, String> {
    let text = format!("model = \"single-sensor\"\nmethod = \"random\"\n{text}");
    let spec = CampaignSpec::from_toml(&text).map_err(|error| error.to_string())?;
    let again = CampaignSpec::from_toml(&spec.to_toml()).map_err(|error| error.to_string())?;
    assert_eq!(again, spec, "what is written reads back");
    Ok(spec.world().clone())
}

#[track_caller]
fn check_refused(text: &str, expected: &str) {
    let error = world(text).unwrap_err();
    assert!(error.contains(expected), "{error:?} does not say {expected:?}");
}

#[test]
fn noise_is_read_and_written() {
    let noisy =
        world("[world.noise]\nslip = 0.05\ngain = 0.1\nmissed = 0.02\nfalse_detection = 0.01\ndelay = 3");
    let noise = noisy.unwrap().noise();
    assert_eq!((noise.slip(), noise.gain(), noise.delay()), (0.05, 0.1, 3));
    assert_eq!((noise.missed(), noise.false_detection()), (0.02, 0.01));
    assert!((noise.largest_factor() - 1.2 * 1.4).abs() < 1e-12);
    assert_eq!(world("[world]\nnoise = {}").unwrap().noise(), Noise::default());
    check_refused(
        "[world.noise]\nslip = -1",
        "world.noise.slip = -1: must be a number from 0 to 1",
    );
    check_refused("[world.noise]\nmissed = 1.5", "world.noise.missed = 1.5: must be");
    check_refused(
        "[world.noise]\ndelay = 1001",
        "world.noise.delay = 1001: must be a whole number from 0",
    );
    check_refused(
        "[world.noise]\ndelay = 1.5",
        "world.noise.delay must be a whole number",
    );
    check_refused(
        "[world.noise]\nslips = 1",
        "unknown field `slips` in [world.noise]: did you mean `slip`?",
    );
}

#[test]
fn starts_are_read_and_written() {
    let start = |text: &str| {
        world(&format!("[world]\nagents = 2\n[world.start]\n{text}")).map(|world| world.start().clone())
    };
    assert_eq!(World::default().start(), &StartShape::Uniform);
    assert_eq!(start("shape = \"uniform\""), Ok(StartShape::Uniform));
    assert_eq!(
        start("shape = \"disc\"\nradius = 100"),
        Ok(StartShape::Disc { radius: 100.0 })
    );
    assert_eq!(
        start("shape = \"line\"\nlength = 0"),
        Ok(StartShape::Line { length: 0.0 })
    );
    let poses = start("shape = \"poses\"\nposes = [[1, 2.5, -3], [500, 0, 4]]");
    assert_eq!(
        poses,
        Ok(StartShape::Poses([[1.0, 2.5, -3.0], [500.0, 0.0, 4.0]].into()))
    );
    let refused = |text: &str, expected: &str| {
        let error = start(text).unwrap_err();
        assert!(error.contains(expected), "{error:?} does not say {expected:?}");
    };
    refused(
        "shape = \"ring\"",
        "world.start.shape = \"ring\": must be \"uniform\" or \"disc\"",
    );
    refused("shape = \"disc\"", "world.start.radius is missing: must be given");
    refused(
        "shape = \"disc\"\nradius = 251",
        "world.start.radius = 251: must be a number over 0 and at most 250",
    );
    refused("shape = \"line\"\nlength = 501", "world.start.length = 501");
    refused(
        "radius = 3",
        "world.start.radius = given: must be absent: shape is not \"disc\"",
    );
    refused(
        "shape = \"poses\"\nposes = [[1, 2, 3]]",
        "world.start.poses = 1 pose: must be 2 poses, one for each agent",
    );
    refused(
        "shape = \"poses\"\nposes = [[1, 2, 3], [4, 501, 6]]",
        "world.start.poses[1][1] = 501: must be a number from 0 to 500",
    );
    refused("shape = \"poses\"\nposes = [[1, 2], [4, 5]]", "world.start.poses");
}

#[test]
fn obstacles_are_read_and_written() {
    let disc = "{ x = 100, y = 120, radius = 30 }";
    let of = |listed: &str| {
        world(&format!("[world]\nobstacles = [{listed}]")).map(|world| world.obstacles().to_vec())
    };
    let both = of(&format!(
        "{disc}, {{ x = 300, y = 500, width = 10, height = 40 }}"
    ))
    .unwrap();
    let expected = [
        Obstacle::Disc {
            centre: [100.0, 120.0],
            radius: 30.0,
        },
        Obstacle::Box {
            centre: [300.0, 500.0],
            size: [10.0, 40.0],
        },
    ];
    assert_eq!(both, expected);
    let table = world("[[world.obstacles]]\nx = 100\ny = 120\nradius = 30").unwrap();
    assert_eq!(table.obstacles(), &expected[..1]);
    let refused = |last: &str, words: &str| {
        let error = of(&format!("{disc}, {disc}, {last}")).unwrap_err();
        assert!(error.contains(words), "{error:?} does not say {words:?}");
    };
    refused(
        "{ x = 1, y = 1, radius = 0 }",
        "world.obstacles[2].radius = 0: must be a number over 0",
    );
    refused(
        "{ x = 1, y = 1 }",
        "world.obstacles[2].radius is missing: must be given for a disc, or width",
    );
    refused(
        "{ x = 1, y = 1, width = 3 }",
        "world.obstacles[2].height is missing: must be given for a box",
    );
    refused(
        "{ x = 1, y = 1, width = 3, radius = 1 }",
        "world.obstacles[2].radius = 1: must be absent",
    );
    refused(
        "{ x = 540, y = 1, radius = 39 }",
        "world.obstacles[2].x = 540: must be such that at least a part",
    );
    refused(
        "{ x = 1, y = -20, width = 5, height = 39 }",
        "world.obstacles[2].y = -20: must be such",
    );
    refused("{ x = nan, y = 1, radius = 39 }", "world.obstacles[2].x = NaN");
    refused(
        "{ x = 250, y = 250, radius = 360 }",
        "world.obstacles[2].radius = 360: must be small enough",
    );
    refused("{ x = 9, y = 9, size = 3 }", "unknown field `size`");
    let halves = |x: f64| {
        format!(
            "{{ x = 120, y = 250, width = 240, height = 500 }}, {{ x = {x:?}, y = 250, width = 252, height = 500 }}"
        )
    };
    refused(
        &halves(374.0),
        "world.obstacles = 4 obstacles: must be such that a robot fits",
    );
    of(&halves(386.0)).unwrap();
    let many = vec![disc; 101].join(", ");
    assert!(
        of(&many)
            .unwrap_err()
            .contains("world.obstacles = 101: must be at most 100")
    );
    assert_eq!(of(&vec![disc; 100].join(", ")).unwrap().len(), 100);
}

#[test]
fn a_torus_is_a_boundary() {
    let torus = world("[world]\nboundary = \"torus\"").unwrap();
    assert_eq!(torus.boundary(), crate::Boundary::Torus);
    check_refused(
        "[world]\nboundary = \"ring\"",
        "must be \"walls\" or \"open\" or \"torus\"",
    );
}

#[test]
fn the_way_around_a_torus_is_the_shorter_one() {
    let check = |boundary: &str, expected: [f64; 2]| {
        let text = format!("[world]\nwidth = 100\nheight = 60\nboundary = \"{boundary}\"\nagents = 2\n");
        assert_eq!(
            world(&text).unwrap().way([95.0, 5.0], [5.0, 40.0]),
            expected,
            "{boundary}"
        );
    };
    check("torus", [10.0, -25.0]);
    check("open", [-90.0, 35.0]);
    check("walls", [-90.0, 35.0]);
}

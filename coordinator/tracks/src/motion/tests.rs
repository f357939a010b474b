//! Tests of gaps, units, and headings that are missing in a file of tracks.

use super::*;
use crate::{Axes, Origin, Reading, TracksFile, YAxis};
use murmuration_model::csv_file::ColumnNames;
use murmuration_swarm::World;
use std::{f64::consts::FRAC_PI_2, path::Path};

fn file(text: &[u8]) -> TracksFile<&[u8]> {
    TracksFile::open(Path::new("t.csv"), text, ColumnNames::default()).unwrap()
}

fn tracks(text: &str) -> Tracks {
    Tracks::read(file(text.as_bytes()), Reading::default()).unwrap()
}

/// The tracks of robot 0: `frames` has the number of each frame and the robot's x; its y is always 100.
fn line(frames: &[(u32, f64)]) -> Tracks {
    let rows: String = frames
        .iter()
        .map(|(frame, x)| format!("{frame},0,{x},100\n"))
        .collect();
    tracks(&format!("frame,robot,x,y\n{rows}"))
}

fn xs(motion: &[Vec<[f64; 3]>]) -> Vec<f64> {
    motion.iter().map(|poses| poses[0][0]).collect()
}

#[test]
fn what_is_missing_between_two_frames_is_interpolated() {
    let world = World::default();
    let film = line(&[(5, 10.0), (6, 11.0), (9, 17.0), (10, 17.0)]);
    let motion = film.ending(100, &Filmed::new(&world)).unwrap();
    assert_eq!(xs(&motion), [10.0, 11.0, 13.0, 15.0, 17.0, 17.0]);
    let end = film.ending(2, &Filmed::new(&world)).unwrap();
    assert_eq!(xs(&end), [15.0, 17.0, 17.0]);
}

#[test]
fn a_gap_that_is_too_long_is_refused_unless_it_is_before_what_is_looked_at() {
    let world = World::default();
    let filmed = Filmed::new(&world);
    let film = |after: u32| line(&[(0, 0.0), (after, 1.0), (after + 1, 2.0)]);
    assert!(film(26).ending(100, &filmed).is_ok());
    let error = film(27).ending(100, &filmed).unwrap_err();
    assert_eq!(
        error.to_string(),
        "t.csv: robot 0 is missing from frames 1 to 26; only gaps of up to 25 frames are interpolated"
    );
    assert_eq!(xs(&film(27).ending(1, &filmed).unwrap()), [1.0, 2.0]);
}

#[test]
fn a_robot_stands_still_before_its_first_frame_and_after_its_last() {
    let world = World::default();
    let rows = "0,0,1,1\n4,0,5,1\n1,1,2,2\n2,1,3,2\n";
    let motion = tracks(&format!("frame,robot,x,y\n{rows}")).ending(9, &Filmed::new(&world));
    let second: Vec<f64> = motion.unwrap().iter().map(|poses| poses[1][0]).collect();
    assert_eq!(second, [2.0, 2.0, 3.0, 3.0, 3.0]);
    let late = "0,0,1,1\n30,0,5,1\n29,1,2,2\n30,1,2,2\n15,0,1,1\n";
    let error = tracks(&format!("frame,robot,x,y\n{late}")).ending(99, &Filmed::new(&world));
    assert!(
        error
            .unwrap_err()
            .to_string()
            .contains("robot 1 is missing from frames 0 to 28")
    );
}

#[test]
fn frames_come_at_their_own_pace_and_arenas_in_their_own_units() {
    let world = World::default();
    let film = line(&[(0, 0.0), (10, 1.0), (20, 2.0), (30, 3.0)]);
    // With four frames per step, the last moment is at frame 30, the first at frame 2.
    let slow = Filmed::new(&world).with_frame_time(0.25).unwrap();
    let motion = film.ending(99, &slow).unwrap();
    assert_eq!(motion.len(), 8);
    assert!((xs(&motion)[0] - 0.2).abs() < 1e-12 && xs(&motion)[7] == 3.0);
    // The arena is 4 m by 2 m: a metre is 125 world units, and 125 world units of the world are free above the arena and below
    // it.
    let metres = Filmed::new(&world).with_arena([4.0, 2.0]).unwrap();
    assert_eq!(metres.scale(), 125.0);
    let film = tracks("frame,robot,x,y\n0,0,0,0\n1,0,4,2\n");
    let motion = film.ending(1, &metres).unwrap();
    assert_eq!(motion[0][0][..2], [0.0, 125.0]);
    assert_eq!(motion[1][0][..2], [500.0, 375.0]);
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(Filmed::new(&world).with_frame_time(bad).is_err(), "{bad}");
        assert!(Filmed::new(&world).with_arena([bad, 1.0]).is_err(), "{bad}");
    }
    let moment = line(&[(3, 1.0)]).ending(9, &Filmed::new(&world)).unwrap_err();
    assert!(moment.to_string().contains("less than one step"), "{moment}");
}

#[test]
fn headings_are_the_cameras_or_else_those_of_the_motion() {
    let world = World::default();
    let filmed = Filmed::new(&world);
    // The robot moves down once, and later to the left, with a small error of the camera.
    let rows = |frame: u32| match frame {
        0..4 => "0,0",
        4..16 => "0.3,2",
        _ => "-2,2",
    };
    let rows: String = (0..20)
        .map(|frame| format!("{frame},0,{}\n", rows(frame)))
        .collect();
    let film = tracks(&format!("frame,robot,x,y\n{rows}"));
    let headings: Vec<f64> = film
        .ending(99, &filmed)
        .unwrap()
        .iter()
        .map(|poses| poses[0][2])
        .collect();
    let [down, left] = [FRAC_PI_2, 2.0 * FRAC_PI_2];
    let is =
        |step: usize, heading: f64| assert!((headings[step] - heading).abs() < 0.2, "{step}: {headings:?}");
    (0..11).for_each(|step| is(step, down));
    (11..20).for_each(|step| is(step, left));
    // Known headings are kept, and a robot turns the shorter way between them.
    let film = tracks("frame,robot,x,y,heading\n0,0,9,0,3\n2,0,9,0,-3\n3,0,9,9,\n");
    let headings: Vec<f64> = film
        .ending(9, &filmed)
        .unwrap()
        .iter()
        .map(|poses| poses[0][2])
        .collect();
    assert_eq!((headings[0], headings[2], headings[3]), (3.0, -3.0, down));
    assert!((headings[1] - TAU / 2.0).abs() < 1e-12, "{headings:?}");
    // A robot that never moves heads to the right.
    let still = line(&[(0, 3.0), (1, 3.0)]).ending(9, &filmed).unwrap();
    assert_eq!(still[1][0], [3.0, 100.0, 0.0]);
}

#[test]
fn a_robot_crosses_the_edge_of_a_torus_the_shorter_way() {
    let world = World::try_from(murmuration_proto::v1::World {
        boundary: Some("torus".to_owned()),
        ..World::default().into()
    })
    .unwrap();
    let film = line(&[(0, 490.0), (2, 10.0)]);
    let motion = film.ending(9, &Filmed::new(&world)).unwrap();
    assert_eq!(motion[1][0], [500.0, 100.0, 0.0]);
}

#[test]
fn axes_may_begin_in_the_middle_and_y_may_point_up() {
    let world = World::default();
    let arena = |origin, y| {
        let filmed = Filmed::new(&world).with_arena([4.0, 2.0]).unwrap();
        filmed.with_axes(Axes { origin, y })
    };
    let place = |film: &str, filmed: &Filmed<'_>| tracks(film).ending(1, filmed).unwrap()[0][0];
    // The arena's height is half its width, so 125 world units are free above it and below it.
    let film = "frame,robot,x,y,heading\n0,0,1,0.5,0.25\n1,0,1,0.5,0.25\n";
    let corner = |y| place(film, &arena(Origin::Corner, y));
    assert_eq!(corner(YAxis::Down), [125.0, 187.5, 0.25]);
    assert_eq!(corner(YAxis::Up), [125.0, 312.5, -0.25]);
    let centre = |y| place(film, &arena(Origin::Centre, y));
    assert_eq!(centre(YAxis::Down), [375.0, 312.5, 0.25]);
    assert_eq!(centre(YAxis::Up), [375.0, 187.5, -0.25]);
}

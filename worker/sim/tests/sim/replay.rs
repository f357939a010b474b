//! Recordings of motions.

use murmuration_proto::v1;
use murmuration_sim::{
    replay::{replay, replay_frames},
    simulate::Start,
};
use murmuration_swarm::{Controller, Frames, Invalid, Preset, Replay, World};
use std::num::NonZeroU32;

fn recorded(horizon: u32, stride: u32) -> Result<Replay, Invalid> {
    let message = v1::World {
        horizon: Some(horizon),
        ..World::default().into()
    };
    let controller = Controller::new(Preset::SingleSensor, &[0.6, 1.0, 0.4, 0.5])?;
    let world = World::try_from(message)?;
    replay(
        &controller,
        &world,
        &Start::seeded(4),
        NonZeroU32::new(stride).unwrap(),
    )
}

#[test]
fn there_is_a_frame_of_the_start_of_every_stride_and_of_the_end() {
    let check = |horizon, stride, expected: &[u32]| {
        assert_eq!(recorded(horizon, stride).unwrap().steps(), expected);
    };
    check(10, 4, &[0, 4, 8, 10]);
    check(8, 4, &[0, 4, 8]);
    check(3, 1, &[0, 1, 2, 3]);
    check(3, u32::MAX, &[0, 3]);
}

#[test]
fn the_frames_are_the_same_whatever_the_stride() {
    let (coarse, fine) = (recorded(300, 100).unwrap(), recorded(300, 1).unwrap());
    let fine: Vec<_> = fine.frames().step_by(100).collect();
    assert!(coarse.frames().eq(fine));
}

#[test]
fn the_end_of_a_motion_is_the_same_whether_or_not_more_is_recorded() {
    let whole = recorded(1200, 4).unwrap();
    let controller = Controller::new(Preset::SingleSensor, &[0.6, 1.0, 0.4, 0.5]).unwrap();
    let world = World::default();
    let frames = Frames::of_end(160, NonZeroU32::new(4).unwrap(), &world);
    let end = replay_frames(&controller, &world, &Start::seeded(4), &frames).unwrap();
    assert_eq!(end.steps().len(), 42);
    assert_eq!((end.steps()[0], end.steps()[1]), (0, 1040));
    let whole: Vec<_> = whole.frames().collect();
    let end: Vec<_> = end.frames().collect();
    assert_eq!(end[0], whole[0]);
    assert_eq!(end[1..], whole[1040 / 4..]);
}

#[test]
fn what_would_not_fit_in_memory_is_refused() {
    let error = recorded(10_000_000, 1).unwrap_err();
    assert_eq!(error.field, "stride");
}

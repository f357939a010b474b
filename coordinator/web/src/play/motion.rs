//! The motion of a swarm, one piece at a time.
//!
//! A piece begins where the piece before it ended, so that the pieces together are one motion, bit for bit. The last few swarms
//! are kept in memory for this purpose. A swarm that is no longer kept is simulated again from its start, to the same bits.
//!
//! A piece can also have moments: the features and the verdict of an evaluation that ends there. Therefore every kept swarm keeps its
//! recent past, which is at most half a megabyte for 1,000 robots.

use super::address::Play;
use murmuration_access::Client;
use murmuration_search::interrupt::Interrupt;
use murmuration_sim::{
    moments::Moments,
    simulate::{Agent, Start, Swarm},
};
use murmuration_swarm::{Features, Invalid, Verdict, World};
use std::{
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};
use tonic::Status;

/// The last step that a piece can begin with.
pub(super) const MOST_STEPS: u32 = 1_000_000;
/// Maximum number of frames of a piece, and of poses in all these frames.
const MOST_FRAMES: usize = 600;
const MOST_POSES: usize = 120_000;
/// Maximum number of robots for a frame at every step; larger swarms have a frame only at every other step.
const EVERY_STEP: u32 = 256;
/// Number of kept swarms: enough for 16 people who play at the same time. Another swarm takes the place of the oldest swarm of the
/// client that has most swarms.
const MOST_KEPT: usize = 16;
/// Maximum simulation time of a request before its piece begins. If the time is too short, the next request continues the
/// simulation.
const TIME_LIMIT: Duration = Duration::from_secs(2);
/// Maximum simulation time of a piece; the piece of a slow swarm has fewer frames.
const PIECE_LIMIT: Duration = Duration::from_millis(250);
/// Number of steps of a small swarm between two checks of the clock.
const PATIENCE_STEPS: u32 = 8;
const VERSION: u32 = 2;

/// Whether a piece has moments.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Detail {
    Frames,
    FramesAndMoments,
}

/// The features and the verdict of an evaluation that ends at this step.
#[derive(Debug, Clone, PartialEq)]
struct Moment {
    step: u32,
    /// The judge's name of the motion; `None` if the motion is too short or has too few robots.
    verdict: Option<Verdict>,
    features: Features,
}

/// A piece of a motion: frames at every step or at every other step.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Piece {
    first: u32,
    stride: u32,
    robots: u32,
    /// The x, y and heading of each robot of each frame.
    poses: Vec<[f32; 3]>,
    /// The last state of the sensors of each robot of each frame.
    sensed: Vec<u8>,
    /// The moments after the first frame; the next piece has the following ones.
    moments: Vec<Moment>,
}

/// A swarm with its recent past.
#[derive(Debug)]
pub(super) struct Watched {
    swarm: Swarm,
    past: Moments,
}

#[derive(Debug)]
struct KeptSwarm {
    client: Client,
    play: Play,
    watched: Watched,
}

/// The latest simulated swarms, and the time limits of requests.
#[derive(Debug)]
pub(super) struct Kept {
    /// The swarms, the latest last.
    swarms: Mutex<Vec<KeptSwarm>>,
    /// The time limits before a piece begins, and during the piece.
    limits: [Duration; 2],
}

impl Default for Kept {
    fn default() -> Self {
        Self::within([TIME_LIMIT, PIECE_LIMIT])
    }
}

impl Watched {
    pub(super) fn new(play: &Play) -> Result<Self, Invalid> {
        let swarm = Swarm::new(&play.controller, &play.world, &Start::seeded(play.seed))?;
        let mut past = Moments::new(&play.controller, &play.world);
        past.observe(&swarm);
        Ok(Self { swarm, past })
    }

    fn step(&mut self) {
        self.swarm.step();
        self.past.observe(&self.swarm);
    }

    /// Advances to the step `steps`; returns false if the time was too short.
    pub(super) fn advance(&mut self, steps: u32, is_time: impl Fn() -> bool) -> bool {
        // One step of many robots among obstacles can take a large part of a second.
        let patience = match self.swarm.agents().len() as u32 {
            0..=EVERY_STEP => PATIENCE_STEPS,
            _ => 1,
        };
        while self.swarm.steps() < steps {
            if !is_time() {
                return false;
            }
            for _ in 0..patience.min(steps - self.swarm.steps()) {
                self.step();
            }
        }
        true
    }

    pub(super) fn agents(&self) -> impl Iterator<Item = Agent> {
        self.swarm.agents()
    }

    /// The judge's name of the last steps; `None` if the motion is too short or has too few robots.
    pub(super) fn verdict(&self) -> Option<Verdict> {
        self.past.verdict()
    }

    fn moment(&self) -> Moment {
        Moment {
            step: self.swarm.steps(),
            verdict: self.verdict(),
            features: self.past.features(),
        }
    }
}

/// Number of steps between two moments in `world`. Judging takes as long as many steps, and the time grows with the square of the
/// number of robots.
const fn moment_steps(world: &World) -> u32 {
    match world.agents() {
        0..=64 => 40,
        65..=EVERY_STEP => 120,
        _ => 240,
    }
}

impl Piece {
    fn begun(play: &Play, first: u32) -> Self {
        Self {
            first,
            stride: if play.world.agents() > EVERY_STEP { 2 } else { 1 },
            robots: play.world.agents(),
            ..Self::default()
        }
    }

    fn frames(&self) -> usize {
        self.sensed.len() / self.robots.max(1) as usize
    }

    fn is_whole(&self) -> bool {
        let most = MOST_POSES / self.robots.max(1) as usize;
        self.frames() >= most.clamp(2, MOST_FRAMES)
    }

    fn push(&mut self, agents: impl Iterator<Item = Agent>) {
        for agent in agents {
            let [x, y] = agent.position;
            self.poses.push([x, y, agent.theta].map(|value| value as f32));
            self.sensed.push(agent.sensed);
        }
    }

    /// The piece in little-endian. First come six whole numbers of 32 bits: version, first step, steps between frames, frames,
    /// robots, moments. Then come, for each robot of each frame, x, y and heading as floats of 32 bits. Next come, for each moment,
    /// its step and the number of its verdict (0 without a verdict) as whole numbers of 32 bits, and its features as floats of 32
    /// bits. Last come, for each robot of each frame, a byte with the state of its sensors; the first sensor has the highest bit.
    pub(super) fn bytes(&self) -> Vec<u8> {
        let header = [
            VERSION,
            self.first,
            self.stride,
            self.frames() as u32,
            self.robots,
            self.moments.len() as u32,
        ];
        let header = header.into_iter().flat_map(u32::to_le_bytes);
        let poses = self.poses.as_flattened().iter();
        let poses = poses.flat_map(|value| value.to_le_bytes());
        let moments = self.moments.iter().flat_map(Moment::bytes);
        let sensed = self.sensed.iter().copied();
        header.chain(poses).chain(moments).chain(sensed).collect()
    }
}

impl Moment {
    fn bytes(&self) -> impl Iterator<Item = u8> {
        let verdict = self.verdict.map_or(0, Verdict::number);
        let features = self.features.map(|value| (value as f32).to_le_bytes());
        let words = [self.step, verdict.into()].map(u32::to_le_bytes);
        words.into_iter().chain(features).flatten()
    }
}

impl Kept {
    const fn within(limits: [Duration; 2]) -> Self {
        Self {
            swarms: Mutex::new(Vec::new()),
            limits,
        }
    }

    /// The piece of a motion that begins with the step `first`.
    ///
    /// # Errors
    /// If the swarm cannot be simulated or did not reach the step within the time limit, or if the client has left.
    pub(super) fn piece(
        &self,
        client: Client,
        play: &Play,
        (first, detail): (u32, Detail),
        interrupt: &Interrupt,
    ) -> Result<Piece, Status> {
        let mut watched = self.reached(play, first)?;
        let mut piece = Piece::begun(play, first);
        let [before, during] = self.limits;
        if watched.advance(first, is_time_for(before, interrupt)) {
            piece.push(watched.swarm.agents());
            let is_time = is_time_for(during, interrupt);
            let moment_steps = moment_steps(&play.world);
            // The clock is checked only at frames, so that the next piece can go on from the swarm that is kept.
            while !piece.is_whole() && is_time() {
                for _ in 0..piece.stride {
                    watched.step();
                    if detail == Detail::FramesAndMoments
                        && watched.swarm.steps().is_multiple_of(moment_steps)
                    {
                        piece.moments.push(watched.moment());
                    }
                }
                piece.push(watched.swarm.agents());
            }
        }
        let reached = watched.swarm.steps();
        self.keep(client, play, watched);
        match piece.frames() {
            0 | 1 => Err(Status::unavailable(format!(
                "the simulation has reached step {reached}: try again"
            ))),
            _ => Ok(piece),
        }
    }

    /// The kept swarm that is nearest before a step, or a new swarm at its start.
    fn reached(&self, play: &Play, step: u32) -> Result<Watched, Invalid> {
        let mut kept = self.swarms.lock().unwrap_or_else(PoisonError::into_inner);
        let before =
            |(_, kept): &(usize, &KeptSwarm)| kept.play == *play && kept.watched.swarm.steps() <= step;
        let found = kept.iter().enumerate().filter(before);
        let found = found.max_by_key(|(_, kept)| kept.watched.swarm.steps());
        match found.map(|(place, _)| place) {
            Some(place) => Ok(kept.remove(place).watched),
            None => Watched::new(play),
        }
    }

    fn keep(&self, client: Client, play: &Play, watched: Watched) {
        let mut kept = self.swarms.lock().unwrap_or_else(PoisonError::into_inner);
        kept.push(KeptSwarm {
            client,
            play: play.clone(),
            watched,
        });
        while kept.len() > MOST_KEPT {
            let of = |client: Client| kept.iter().filter(|kept| kept.client == client).count();
            // `max_by_key` returns the last of several equal maxima, so `rev` puts the oldest swarm last.
            let oldest = kept
                .iter()
                .enumerate()
                .rev()
                .max_by_key(|(_, kept)| of(kept.client));
            let place = oldest.map_or(0, |(place, _)| place);
            kept.remove(place);
        }
    }
}

/// Returns a function that is true until the time limit or the interrupt.
fn is_time_for(limit: Duration, interrupt: &Interrupt) -> impl Fn() -> bool + use<'_> {
    let until = Instant::now() + limit;
    move || Instant::now() < until && interrupt.check().is_ok()
}

#[cfg(test)]
mod tests {
    use super::{super::address::Address, *};
    use murmuration_proto::v1;
    use murmuration_sim::evaluate::Evaluator;
    use murmuration_swarm::{Evaluation, ImageFormat, Pattern};

    fn play(robots: &str, seed: &str) -> Play {
        described(&[("robots", robots), ("seed", seed)])
    }

    fn described(parameters: &[(&str, &str)]) -> Play {
        let owned = |(name, text): &(&str, &str)| ((*name).to_owned(), (*text).to_owned());
        let parameters = parameters.iter().map(owned).collect();
        Address::read(&parameters).strictly().unwrap()
    }

    /// A cache whose pieces have the same frames on a busy and on an idle machine.
    fn unhurried() -> Kept {
        Kept::within([Duration::from_secs(3600); 2])
    }

    fn piece(kept: &Kept, play: &Play, first: u32) -> Piece {
        let wanted = (first, Detail::FramesAndMoments);
        kept.piece(Client::UNKNOWN, play, wanted, &Interrupt::default())
            .unwrap()
    }

    fn swarm(play: &Play) -> Swarm {
        Swarm::new(&play.controller, &play.world, &Start::seeded(play.seed)).unwrap()
    }

    #[test]
    fn the_bytes_of_a_piece_are_the_poses_of_the_swarm() {
        let play = play("24", "5");
        let bytes = piece(&unhurried(), &play, 7).bytes();
        let (words, rest) = bytes.split_at(4 * (6 + 3 * 600 * 24));
        let (moments, sensed) = rest.split_at(4 * 7 * 15);
        let words: Vec<[u8; 4]> = words.as_chunks().0.to_vec();
        let header: Vec<u32> = words[..6].iter().map(|&word| u32::from_le_bytes(word)).collect();
        assert_eq!(header, [2, 7, 1, 600, 24, 15]);
        // The judge needs 160 steps.
        let steps = moments.chunks(4 * 7).map(|moment| [moment[0], moment[4].min(1)]);
        assert!(
            steps
                .take(5)
                .eq([40, 80, 120, 160, 200].map(|step| [step, u8::from(step >= 160)]))
        );
        assert_eq!(sensed.len(), 600 * 24);
        let mut swarm = swarm(&play);
        swarm.advance(7);
        let mut poses = words[6..].chunks(3);
        let mut sensed = sensed.iter();
        for _ in 0..600 {
            for agent in swarm.agents() {
                let pose = poses.next().unwrap().iter().map(|&word| f32::from_le_bytes(word));
                let [x, y] = agent.position;
                assert!(pose.eq([x as f32, y as f32, agent.theta as f32]));
                assert_eq!(*sensed.next().unwrap(), agent.sensed);
            }
            swarm.step();
        }
    }

    #[test]
    fn pieces_are_one_motion_whether_the_swarm_is_kept_or_not() {
        for (robots, stride) in [("24", 1), ("600", 2)] {
            let (kept, play) = (unhurried(), play(robots, "2"));
            let first = piece(&kept, &play, 0);
            assert_eq!(first.stride, stride);
            let last = stride * (first.frames() as u32 - 1);
            let second = piece(&kept, &play, last);
            assert_eq!(
                second.poses[..play.world.agents() as usize],
                first.poses[first.poses.len() - play.world.agents() as usize..]
            );
            assert_eq!(second, piece(&unhurried(), &play, last));
            let mut swarm = swarm(&play);
            swarm.advance(last + stride * (second.frames() as u32 - 1));
            let end: Vec<_> = swarm.agents().map(|agent| agent.sensed).collect();
            assert!(second.sensed.ends_with(&end));
        }
    }

    /// The evaluation of a swarm that ends at the step `horizon`.
    fn evaluated(play: &Play, horizon: u32) -> Evaluation {
        let message = v1::World {
            horizon: Some(horizon),
            ..play.world.clone().into()
        };
        let world = World::try_from(message).unwrap();
        let mut evaluator = Evaluator::new(&world, &ImageFormat::default())
            .unwrap()
            .judging(true);
        evaluator
            .evaluate(&play.controller, &Start::seeded(play.seed))
            .unwrap()
    }

    #[test]
    fn a_moment_is_what_an_evaluation_that_ends_there_finds() {
        let (kept, play) = (unhurried(), play("24", "3"));
        let pieces = [0, 599, 1198].map(|first| piece(&kept, &play, first));
        let moments: Vec<_> = pieces.iter().flat_map(|piece| &piece.moments).collect();
        let steps = moments.iter().map(|moment| moment.step);
        assert!(steps.eq((40..=1797).step_by(40)), "each moment is in one piece");
        for moment in moments
            .into_iter()
            .filter(|moment| moment.step % 400 == 0 || moment.step == 80)
        {
            let evaluation = evaluated(&play, moment.step);
            assert_eq!(moment.features, *evaluation.features(), "step {}", moment.step);
            let verdict = evaluation.verdict().filter(|_| moment.step >= 160);
            assert_eq!(moment.verdict, verdict, "step {}", moment.step);
        }
        let few = super::tests::play("2", "3");
        assert!(
            piece(&kept, &few, 0)
                .moments
                .iter()
                .all(|moment| moment.verdict.is_none())
        );
        let species = "ratios = [[12, 12], [8, 16]]\n[[species]]\nname = \"a\"\nrobot.sensors = [{ sees = [\"a\"] }]\n[[species]]\nname = \"b\"\n\
                       robot.sensors = [{ sees = [\"a\"] }, { angle = \"free\", angle_range = [-3.14, 3.14], sees = [\"b\"] }]\n";
        let mill = "0.8,0.7,-0.1,0.4,-1,-0.9,0.9,0.7,-0.8,0.1,0.8,0.8,2.9958084837187218,1";
        let mill = described(&[
            ("robot", species),
            ("genes", mill),
            ("seed", "4533673710576819531"),
        ]);
        let moments = piece(&kept, &mill, 601).moments;
        let last = moments.last().unwrap();
        assert_eq!(last.verdict, Some(Verdict::Pattern(Pattern::TwoColouredMill)));
        assert_eq!(last.verdict, evaluated(&mill, last.step).verdict());
        let plain = (0, Detail::Frames);
        let plain = kept.piece(Client::UNKNOWN, &play, plain, &Interrupt::default());
        assert!(plain.unwrap().moments.is_empty());
    }

    #[test]
    fn the_swarm_after_a_piece_without_enough_time_is_kept_for_the_next_piece() {
        let (kept, play) = (
            Kept::within([Duration::from_secs(3600), Duration::from_millis(20)]),
            play("900", "1"),
        );
        let piece = piece(&kept, &play, 1);
        let last = 1 + 2 * (piece.frames() as u32 - 1);
        assert_eq!(kept.reached(&play, last).unwrap().swarm.steps(), last);
    }

    #[test]
    fn a_few_swarms_are_kept_and_none_for_another_seed() {
        let kept = unhurried();
        for seed in 0..20 {
            piece(&kept, &play("24", &seed.to_string()), 0);
        }
        let steps = |kept: &Kept| kept.swarms.lock().unwrap().len();
        assert_eq!(steps(&kept), MOST_KEPT);
        let again = piece(&kept, &play("24", "19"), 0);
        assert_eq!(again, piece(&unhurried(), &play("24", "19"), 0));
    }

    #[test]
    fn a_client_with_many_swarms_does_not_displace_those_of_others() {
        let kept = unhurried();
        let own = play("24", "1000");
        piece(&kept, &own, 0);
        let guest = Client::at([10, 0, 0, 1].into());
        for seed in 0..40 {
            let swarm = play("24", &seed.to_string());
            let wanted = (0, Detail::Frames);
            kept.piece(guest, &swarm, wanted, &Interrupt::default()).unwrap();
        }
        let swarms = kept.swarms.lock().unwrap();
        assert_eq!(swarms.len(), MOST_KEPT);
        assert!(swarms.iter().any(|kept| kept.play == own));
    }

    #[test]
    fn what_nobody_wants_any_more_is_not_simulated() {
        let (kept, interrupt) = (unhurried(), Interrupt::default());
        interrupt.raise();
        let refused = kept
            .piece(
                Client::UNKNOWN,
                &play("1000", "1"),
                (500_000, Detail::Frames),
                &interrupt,
            )
            .unwrap_err();
        assert_eq!(refused.code(), tonic::Code::Unavailable);
        assert_eq!(refused.message(), "the simulation has reached step 0: try again");
    }

    #[test]
    fn a_piece_of_many_robots_is_no_larger_than_one_of_few() {
        let few = piece(&unhurried(), &play("24", "1"), 0).bytes().len();
        let many = piece(&unhurried(), &play("1000", "1"), 0).bytes().len();
        assert!((100_000..2_000_000).contains(&few), "{few}");
        assert!((100_000..2_000_000).contains(&many), "{many}");
    }
}

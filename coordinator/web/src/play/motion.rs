//! The motion of a swarm, one piece at a time.
//!
//! A piece begins where the piece before it ended, so that the pieces together are one motion, bit for bit. The last few swarms
//! are kept in memory for this purpose. A swarm that is no longer kept is simulated again from its start, to the same bits.

use super::address::Play;
use murmuration_access::Client;
use murmuration_search::interrupt::Interrupt;
use murmuration_sim::simulate::{Agent, Start, Swarm};
use murmuration_swarm::Invalid;
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
const VERSION: u32 = 1;

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
}

#[derive(Debug)]
struct KeptSwarm {
    client: Client,
    play: Play,
    swarm: Swarm,
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

    /// The piece in little-endian. First come five whole numbers of 32 bits: version, first step, steps between frames, frames,
    /// robots. Then come, for each robot of each frame, x, y and heading as floats of 32 bits. Last come, for each robot of each
    /// frame, a byte with the state of its sensors; the first sensor has the highest bit.
    pub(super) fn bytes(&self) -> Vec<u8> {
        let header = [
            VERSION,
            self.first,
            self.stride,
            self.frames() as u32,
            self.robots,
        ];
        let header = header.into_iter().flat_map(u32::to_le_bytes);
        let poses = self.poses.as_flattened().iter();
        let poses = poses.flat_map(|value| value.to_le_bytes());
        header.chain(poses).chain(self.sensed.iter().copied()).collect()
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
        first: u32,
        interrupt: &Interrupt,
    ) -> Result<Piece, Status> {
        let mut swarm = self.reached(play, first)?;
        let mut piece = Piece::begun(play, first);
        let [before, during] = self.limits;
        if advanced(&mut swarm, first, is_time_for(before, interrupt)) {
            piece.push(swarm.agents());
            let is_time = is_time_for(during, interrupt);
            while !piece.is_whole() {
                let next = swarm.steps() + piece.stride;
                if !advanced(&mut swarm, next, &is_time) {
                    break;
                }
                piece.push(swarm.agents());
            }
        }
        let reached = swarm.steps();
        self.keep(client, play, swarm);
        match piece.frames() {
            0 | 1 => Err(Status::unavailable(format!(
                "the simulation has reached step {reached}: try again"
            ))),
            _ => Ok(piece),
        }
    }

    /// The kept swarm that is nearest before a step, or a new swarm at its start.
    fn reached(&self, play: &Play, step: u32) -> Result<Swarm, Invalid> {
        let mut kept = self.swarms.lock().unwrap_or_else(PoisonError::into_inner);
        let before = |(_, kept): &(usize, &KeptSwarm)| kept.play == *play && kept.swarm.steps() <= step;
        let found = kept.iter().enumerate().filter(before);
        let found = found.max_by_key(|(_, kept)| kept.swarm.steps());
        match found.map(|(place, _)| place) {
            Some(place) => Ok(kept.remove(place).swarm),
            None => Swarm::new(&play.controller, &play.world, &Start::seeded(play.seed)),
        }
    }

    fn keep(&self, client: Client, play: &Play, swarm: Swarm) {
        let mut kept = self.swarms.lock().unwrap_or_else(PoisonError::into_inner);
        kept.push(KeptSwarm {
            client,
            play: play.clone(),
            swarm,
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

/// Advances a swarm to the step `steps`; returns false if the time was too short.
fn advanced(swarm: &mut Swarm, steps: u32, is_time: impl Fn() -> bool) -> bool {
    // One step of many robots among obstacles can take a large part of a second.
    let patience = match swarm.agents().len() as u32 {
        0..=EVERY_STEP => PATIENCE_STEPS,
        _ => 1,
    };
    while swarm.steps() < steps {
        if !is_time() {
            return false;
        }
        swarm.advance((steps - swarm.steps()).min(patience));
    }
    true
}

#[cfg(test)]
mod tests {
    use super::{super::address::Address, *};

    fn play(robots: &str, seed: &str) -> Play {
        let parameters = [("robots", robots), ("seed", seed)];
        let owned = parameters.map(|(name, text)| (name.to_owned(), text.to_owned()));
        Address::read(&owned.to_vec()).strictly().unwrap()
    }

    /// A cache whose pieces have the same frames on a busy and on an idle machine.
    fn unhurried() -> Kept {
        Kept::within([Duration::from_secs(3600); 2])
    }

    fn piece(kept: &Kept, play: &Play, first: u32) -> Piece {
        kept.piece(Client::UNKNOWN, play, first, &Interrupt::default())
            .unwrap()
    }

    fn swarm(play: &Play) -> Swarm {
        Swarm::new(&play.controller, &play.world, &Start::seeded(play.seed)).unwrap()
    }

    #[test]
    fn the_bytes_of_a_piece_are_the_poses_of_the_swarm() {
        let play = play("24", "5");
        let bytes = piece(&unhurried(), &play, 7).bytes();
        let (words, sensed) = bytes.split_at(4 * (5 + 3 * 600 * 24));
        let words: Vec<[u8; 4]> = words.as_chunks().0.to_vec();
        let header: Vec<u32> = words[..5].iter().map(|&word| u32::from_le_bytes(word)).collect();
        assert_eq!(header, [1, 7, 1, 600, 24]);
        assert_eq!(sensed.len(), 600 * 24);
        let mut swarm = swarm(&play);
        swarm.advance(7);
        let mut poses = words[5..].chunks(3);
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
            kept.piece(guest, &swarm, 0, &Interrupt::default()).unwrap();
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
            .piece(Client::UNKNOWN, &play("1000", "1"), 500_000, &interrupt)
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

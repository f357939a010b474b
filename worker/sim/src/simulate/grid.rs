//! The agents of a large swarm in the cells of a grid, so that tests for contacts and rays check a few cells and not all agents.
//!
//! Cells only select candidates. The tests use the operations of [`sight`](super::sight), so the grid changes no bits.

use super::{
    gaze::{Gaze, Group},
    sight::{Observer, Reach},
};
use murmuration_swarm::World;

/// Minimum number of agents for which a grid is faster, measured with `cargo bench -p murmuration-sim --bench many_robots`.
pub(super) const WORTH: u32 = 512;
/// Approximate number of cells per agent.
const CELLS_AN_AGENT: f64 = 0.25;
/// Room for rounding, relative to the largest coordinate c. The length of a ray's vector differs from 1 by at most 10^-12.
/// Squares of distances are at most 8 c^2 and have smaller relative errors. Roots of these errors are below 3 * 10^-6 c.
const ROUNDING: f64 = 1e-5;

/// The agents of a swarm by cells. Cells at the border include agents beyond the border.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    /// Length of a cell's side, and its inverse, because division is slow.
    side: f64,
    inverse: f64,
    /// Numbers of columns and rows.
    cells: [usize; 2],
    /// Agents of each cell, by column, then row.
    members: Vec<Vec<Member>>,
    positions: Vec<[f64; 2]>,
    /// Lower and upper bound of all coordinates so far, by axis.
    range: [[f64; 2]; 2],
    /// Radius of the largest body.
    radius: f64,
}

#[derive(Debug, Clone, Copy)]
struct Member {
    agent: usize,
    at: [f64; 2],
}

/// A ray as a function of its main axis: the axis along which the ray advances faster.
#[derive(Debug, Clone, Copy)]
struct Course {
    main: usize,
    from: [f64; 2],
    /// Whether the main coordinate grows.
    grows: bool,
    /// Change of the other coordinate for each unit along the main axis.
    slope: f64,
    /// Maximum distance, along the other axis, between the ray and the centre of a body that it meets.
    breadth: f64,
}

impl Grid {
    /// The grid of agents at `positions`, whose bodies have at most this radius.
    pub(super) fn new(world: &World, radius: f64, positions: &[[f64; 2]]) -> Self {
        let size = [world.width(), world.height()];
        let share = (size[0] * size[1] / (CELLS_AN_AGENT * positions.len() as f64)).sqrt();
        let side = share.max(2.0 * radius);
        let cells = size.map(|length| ((length / side).ceil() as usize).max(1));
        let mut grid = Self {
            side,
            inverse: side.recip(),
            cells,
            members: vec![Vec::new(); cells[0] * cells[1]],
            positions: positions.to_vec(),
            range: [[0.0, size[0]], [0.0, size[1]]],
            radius,
        };
        for (agent, &at) in positions.iter().enumerate() {
            grid.widen(at);
            let cell = grid.cell_of(at);
            grid.members[cell].push(Member { agent, at });
        }
        grid
    }

    /// Number of agents.
    pub(super) const fn count(&self) -> usize {
        self.positions.len()
    }

    /// Position of agent `i`.
    pub(super) fn get(&self, i: usize) -> [f64; 2] {
        self.positions[i]
    }

    /// Moves agent `i`.
    pub(super) fn set(&mut self, i: usize, at: [f64; 2]) {
        self.widen(at);
        let (old, new) = (self.cell_of(self.positions[i]), self.cell_of(at));
        self.positions[i] = at;
        if let Some(place) = self.members[old].iter().position(|member| member.agent == i) {
            if old == new {
                self.members[old][place].at = at;
            } else {
                self.members[old].swap_remove(place);
                self.members[new].push(Member { agent: i, at });
            }
        }
    }

    /// Whether an agent other than `me` touches a body at `at`.
    pub(super) fn touches_any(&self, me: usize, at: [f64; 2], reach: Reach) -> bool {
        self.touching(me, at, reach).next().is_some()
    }

    /// The agents other than `me` that touch a body at `at`, in no particular order.
    pub(super) fn touching(&self, me: usize, at: [f64; 2], reach: Reach) -> impl Iterator<Item = usize> {
        let near = self.near(at, 2.0 * self.radius);
        let touching = near.filter(move |member| member.agent != me && reach.touches(member.at, at));
        touching.map(|member| member.agent)
    }

    /// All agents that are at most `distance` from `at`, and some other agents.
    fn near(&self, at: [f64; 2], distance: f64) -> impl Iterator<Item = &Member> {
        let room = distance + self.slack();
        let [columns, rows] = [0, 1].map(|axis| self.span(axis, at[axis] - room, at[axis] + room));
        (columns.0..=columns.1).flat_map(move |column| {
            let first = column * self.cells[1];
            self.members[first + rows.0..=first + rows.1].iter().flatten()
        })
    }

    /// The sensor state of `observer`: a bit for each sensor, S1 the highest.
    pub(super) fn sense<const SENSORS: usize>(&self, observer: &Observer<SENSORS>, reach: Reach) -> u8 {
        let hit = |ray: &[f64; 2]| u8::from(self.meets(observer.index, observer.at, *ray, reach));
        observer.rays.iter().fold(0, |state, ray| 2 * state + hit(ray))
    }

    /// Whether an agent of `group` other than `me` is seen from `at`. For a ray without limit, checks the agents along the ray;
    /// otherwise, checks the agents in range.
    pub(super) fn sees(&self, gaze: &Gaze, group: &Group, me: usize, at: [f64; 2]) -> bool {
        let body = group.radius * group.radius;
        let seen =
            |member: &Member| member.agent != me && group.has(member.agent) && gaze.sees(member.at, at, body);
        match gaze.ray() {
            Some(ray) if gaze.range() == f64::INFINITY => self.any_along(at, ray, seen),
            _ => self.near(at, gaze.range()).any(seen),
        }
    }

    /// Whether the ray from `at` along the unit vector `ray` meets an agent other than `me`.
    fn meets(&self, me: usize, at: [f64; 2], ray: [f64; 2], reach: Reach) -> bool {
        self.any_along(at, ray, |member| {
            member.agent != me && reach.meets(member.at, at, ray)
        })
    }

    /// Whether `wanted` accepts any agent that the ray from `at` can meet.
    fn any_along(&self, at: [f64; 2], ray: [f64; 2], wanted: impl Fn(&Member) -> bool) -> bool {
        let course = Course::new(at, ray, self.radius);
        let slack = self.slack();
        let last = self.cells[course.main] - 1;
        let behind = self.radius + slack;
        let begin = at[course.main] + if course.grows { -behind } else { behind };
        let mut slice = self.cell(course.main, begin);
        loop {
            let across = course.across(self.bounds(course.main, slice), slack);
            let rows = self.span(1 - course.main, across[0], across[1]);
            for row in rows.0..=rows.1 {
                let cell = if course.main == 0 {
                    slice * self.cells[1] + row
                } else {
                    row * self.cells[1] + slice
                };
                if self.members[cell].iter().any(&wanted) {
                    return true;
                }
            }
            match (course.grows, slice) {
                (true, slice) if slice == last => return false,
                (false, 0) => return false,
                (true, _) => slice += 1,
                (false, _) => slice -= 1,
            }
        }
    }

    /// Upper bound of the rounding errors of all numbers that the grid computes from coordinates.
    fn slack(&self) -> f64 {
        let [x, y] = self.range.map(|[low, high]| high.max(-low));
        ROUNDING * x.max(y)
    }

    fn widen(&mut self, at: [f64; 2]) {
        for (range, value) in self.range.iter_mut().zip(at) {
            *range = [range[0].min(value), range[1].max(value)];
        }
    }

    /// Least and largest coordinate of agents in the cells with this number along an axis.
    fn bounds(&self, axis: usize, number: usize) -> [f64; 2] {
        let [low, high] = self.range[axis];
        [
            if number == 0 {
                low
            } else {
                number as f64 * self.side
            },
            if number + 1 == self.cells[axis] {
                high
            } else {
                (number + 1) as f64 * self.side
            },
        ]
    }

    fn cell_of(&self, at: [f64; 2]) -> usize {
        self.cell(0, at[0]) * self.cells[1] + self.cell(1, at[1])
    }

    /// Number, along an axis, of the cell that contains a coordinate.
    fn cell(&self, axis: usize, value: f64) -> usize {
        // The cast turns negative numbers into 0.
        ((value * self.inverse) as usize).min(self.cells[axis] - 1)
    }

    /// Numbers of the first and the last cell between two coordinates along an axis.
    fn span(&self, axis: usize, low: f64, high: f64) -> (usize, usize) {
        (self.cell(axis, low), self.cell(axis, high))
    }
}

impl Course {
    fn new(from: [f64; 2], ray: [f64; 2], radius: f64) -> Self {
        let main = usize::from(ray[1].abs() > ray[0].abs());
        let slope = ray[1 - main] / ray[main];
        Self {
            main,
            from,
            grows: ray[main] > 0.0,
            slope,
            // Half the width of a strip about the ray, measured along the other axis. The strip extends slightly more than the
            // radius to either side.
            breadth: 1.000_001 * radius * (1.0 + slope * slope).sqrt(),
        }
    }

    /// Smallest and largest coordinate, along the other axis, of centres that the ray meets, if their main coordinate is in
    /// `bounds`.
    fn across(&self, bounds: [f64; 2], slack: f64) -> [f64; 2] {
        let at = |main: f64| self.from[1 - self.main] + self.slope * (main - self.from[self.main]);
        let ends = bounds.map(at);
        let room = self.breadth + 2.0 * slack;
        [ends[0].min(ends[1]) - room, ends[0].max(ends[1]) + room]
    }
}

//! How many workers and trainers the open work could use.

use crate::campaign::{CampaignStatus, Campaigns};
use murmuration_dispatch::{Load, embedding_cost, simulation_cost};
use murmuration_model::Stage;
use std::{num::NonZeroU32, time::Duration};

/// Time in which the open work should be done, unless the request says otherwise: long compared with the start of a worker.
pub const WITHIN: Duration = Duration::from_secs(300);

/// How many workers and trainers the open work could use.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Demand {
    pub workers: u32,
    pub trainers: u32,
    /// Tasks that are not done, including those of later generations.
    pub tasks: u64,
    /// Time of these tasks on one thread, seconds; `None` before the first result.
    pub thread_seconds: Option<f64>,
}

/// Open work whose tasks can all be done at the same time, or `width` of them.
#[derive(Debug, Clone, Copy, PartialEq)]
struct OpenWork {
    tasks: u64,
    width: u64,
    /// Cost of a task, in steps of an agent.
    cost: u64,
}

impl OpenWork {
    /// The open work of a campaign in its current stage; `None` if workers have nothing to do in this stage.
    fn of(status: &CampaignStatus) -> Option<Self> {
        let spec = &status.record.spec;
        let progress = status.progress()?;
        let tasks = progress.total.saturating_sub(progress.done);
        let simulation = simulation_cost(spec.world());
        let (cost, width) = match status.stage {
            Stage::Evolve => {
                let cost = simulation.saturating_mul(spec.starts().get() as u64);
                (cost, u64::from(spec.search().population()))
            }
            Stage::Dataset => (simulation, tasks),
            Stage::Embed => (embedding_cost(spec.starts()), tasks),
            Stage::Pretrain | Stage::Label | Stage::FineTune | Stage::Taxonomy => return None,
        };
        (tasks > 0).then_some(Self { tasks, width, cost })
    }

    /// Number of threads that do the work within this time.
    fn threads(&self, seconds_per_step: f64, within: Duration) -> u64 {
        let seconds = self.tasks as f64 * self.cost as f64 * seconds_per_step;
        let threads = (seconds / within.as_secs_f64()).ceil();
        // A conversion to an integer saturates.
        (threads as u64).clamp(1, self.width.max(1))
    }
}

impl Demand {
    /// How many workers of `threads` threads the campaigns at work and other requests could use, if their work should be done
    /// `within` this time. By default, a worker has as many threads as the connected workers on average.
    pub async fn of(
        campaigns: &Campaigns,
        at_work: &[CampaignStatus],
        threads: Option<NonZeroU32>,
        within: Duration,
    ) -> Self {
        let load = campaigns.load().await;
        let mean = || {
            let mean = load.threads.checked_div(load.workers).unwrap_or(1);
            u32::try_from(mean)
                .ok()
                .and_then(NonZeroU32::new)
                .unwrap_or(NonZeroU32::MIN)
        };
        Self::of_all(at_work, &load, threads.unwrap_or_else(mean), within)
    }

    fn of_all(statuses: &[CampaignStatus], load: &Load, threads: NonZeroU32, within: Duration) -> Self {
        let trains = |status: &&CampaignStatus| matches!(status.stage, Stage::Pretrain | Stage::FineTune);
        let at_work = || statuses.iter().filter(|status| status.active);
        let mut open: Vec<_> = at_work().filter_map(OpenWork::of).collect();
        if let Some(cost) = load.steps.checked_div(load.tasks as u64) {
            let tasks = load.tasks as u64;
            open.push(OpenWork {
                tasks,
                width: tasks,
                cost,
            });
        }
        Self {
            trainers: u32::try_from(at_work().filter(trains).count()).unwrap_or(u32::MAX),
            ..Self::of_work(&open, load.seconds_per_step, threads, within)
        }
    }

    fn of_work(
        open: &[OpenWork],
        seconds_per_step: Option<f64>,
        threads: NonZeroU32,
        within: Duration,
    ) -> Self {
        // One worker measures how long the work takes.
        let wanted = match seconds_per_step {
            Some(pace) => open.iter().map(|work| work.threads(pace, within)).sum(),
            None => u64::from(!open.is_empty()),
        };
        let steps = open.iter().map(|work| work.tasks as f64 * work.cost as f64);
        Self {
            workers: u32::try_from(wanted.div_ceil(threads.get().into())).unwrap_or(u32::MAX),
            trainers: 0,
            tasks: open.iter().map(|work| work.tasks).sum(),
            thread_seconds: seconds_per_step.map(|pace| pace * steps.sum::<f64>()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn workers(open: &[OpenWork], pace: Option<f64>, threads: u32) -> u32 {
        Demand::of_work(open, pace, NonZeroU32::new(threads).unwrap(), WITHIN).workers
    }

    #[test]
    fn as_many_workers_are_wanted_as_the_time_asks_for_and_the_tasks_allow() {
        let generation = OpenWork {
            tasks: 10_000,
            width: 100,
            cost: 20_000,
        };
        // 10,000 tasks of 0.2 s are 2,000 s: 7 threads do them in five minutes.
        assert_eq!(workers(&[generation], Some(1e-5), 1), 7);
        assert_eq!(workers(&[generation], Some(1e-5), 4), 2);
        assert_eq!(workers(&[generation, generation], Some(1e-5), 4), 4);
        // A generation of 100 keeps 100 threads busy at most.
        assert_eq!(workers(&[generation], Some(1e-2), 1), 100);
        assert_eq!(workers(&[generation], Some(1e-2), 32), 4);
        // A little work wants one worker, and so does work whose cost is unknown.
        assert_eq!(workers(&[generation], Some(1e-12), 8), 1);
        assert_eq!(workers(&[generation], None, 8), 1);
        assert_eq!(workers(&[], Some(1e-5), 1), 0);
        let demand = Demand::of_work(&[generation], Some(1e-5), NonZeroU32::MIN, WITHIN);
        assert!((demand.thread_seconds.unwrap() - 2000.0).abs() < 1e-6);
        assert_eq!(demand.tasks, 10_000);
    }
}

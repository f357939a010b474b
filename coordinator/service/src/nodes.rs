//! Nodes: the connected workers and trainers, and how many of them the open work could use.

use super::{Streamed, in_parts};
use crate::status::OrStatus as _;
use murmuration_dispatch::{ConnectedMachine, WorkInHand, WorkKind};
use murmuration_engine::{
    campaign::Campaigns,
    demand::{Demand, WITHIN},
};
use murmuration_proto::{parts::parts, v1};
use murmuration_swarm::{Invalid, counted};
use std::{num::NonZeroU32, ops::RangeInclusive, time::Duration};
use tonic::{Request, Response, Status};

const SECONDS: RangeInclusive<f64> = 1.0..=1e6;
const THREADS: RangeInclusive<u32> = 1..=65_536;

/// Implements `murmuration.v1.NodeService`.
#[derive(Debug, Clone)]
pub struct NodeApi {
    pub campaigns: Campaigns,
}

#[tonic::async_trait]
impl v1::node_service_server::NodeService for NodeApi {
    type ListNodesStream = Streamed<v1::ListNodesResponse>;

    async fn list_nodes(
        &self,
        _: Request<v1::ListNodesRequest>,
    ) -> Result<Response<Self::ListNodesStream>, Status> {
        let (workers, trainers) = self.campaigns.machines().await;
        let workers = workers.into_iter().map(|one| node(one, v1::NodeKind::Worker));
        let trainers = trainers.into_iter().map(|one| node(one, v1::NodeKind::Trainer));
        let part = |nodes| v1::ListNodesResponse { nodes };
        Ok(in_parts(parts(workers.chain(trainers), part)))
    }

    async fn get_demand(
        &self,
        request: Request<v1::GetDemandRequest>,
    ) -> Result<Response<v1::Demand>, Status> {
        let v1::GetDemandRequest { threads, seconds } = request.into_inner();
        let (threads, within) = (threads_of(threads)?, within_of(seconds)?);
        let demand = demand_of(&self.campaigns, threads, within).await?;
        Ok(Response::new(message(demand)))
    }
}

/// The demand of the work of all campaigns and requests.
pub(super) async fn demand_of(
    campaigns: &Campaigns,
    threads: Option<NonZeroU32>,
    within: Duration,
) -> Result<Demand, Status> {
    let statuses = campaigns.at_work().await.or_status()?;
    Ok(Demand::of(campaigns, &statuses, threads, within).await)
}

/// The threads of a wanted worker, as a request names them.
pub(super) fn threads_of(threads: Option<u32>) -> Result<Option<NonZeroU32>, Invalid> {
    let read = |threads| {
        let valid = NonZeroU32::new(threads).filter(|threads| THREADS.contains(&threads.get()));
        valid.ok_or_else(|| Invalid::new("threads", threads, "1 to 65,536"))
    };
    threads.map(read).transpose()
}

/// The time in which the work should be done, as a request names it.
pub(super) fn within_of(seconds: Option<f64>) -> Result<Duration, Invalid> {
    match seconds {
        None => Ok(WITHIN),
        Some(seconds) if SECONDS.contains(&seconds) => Ok(Duration::from_secs_f64(seconds)),
        Some(seconds) => Err(Invalid::new("seconds", seconds, "1 to 1,000,000")),
    }
}

fn message(demand: Demand) -> v1::Demand {
    let Demand {
        workers,
        trainers,
        tasks,
        thread_seconds,
    } = demand;
    v1::Demand {
        workers,
        trainers,
        tasks,
        thread_seconds,
    }
}

/// A connected worker or trainer, as a message.
#[must_use]
pub fn node(machine: ConnectedMachine, kind: v1::NodeKind) -> v1::Node {
    let work = |work: WorkInHand| v1::NodeWork {
        kind: of_work(work.kind).into(),
        campaign: work.campaign.map(|id| id.to_string()).unwrap_or_default(),
        tasks: work.tasks as u32,
    };
    v1::Node {
        name: machine.name,
        kind: kind.into(),
        threads: machine.capacity as u32,
        work: machine.work.into_iter().map(work).collect(),
    }
}

/// The current work of a node, in words.
#[must_use]
pub fn doing(node: &v1::Node) -> String {
    if node.work.is_empty() {
        return match node.threads {
            0 => "leaving".to_owned(),
            _ => "waiting for work".to_owned(),
        };
    }
    let words: Vec<String> = node.work.iter().map(in_words).collect();
    words.join("; ")
}

fn in_words(work: &v1::NodeWork) -> String {
    let tasks = u64::from(work.tasks);
    let what = match work.kind() {
        v1::WorkKind::Evaluation => format!("evaluates {}", counted(tasks, "controller")),
        v1::WorkKind::Embedding => format!("embeds {}", counted(tasks, "individual")),
        v1::WorkKind::Replay => "simulates a motion".to_owned(),
        v1::WorkKind::Training => "trains the embedder".to_owned(),
        v1::WorkKind::Unspecified => format!("works on {}", counted(tasks, "task")),
    };
    match work.campaign.as_str() {
        "" => what,
        campaign => format!("{what} of {campaign}"),
    }
}

const fn of_work(kind: WorkKind) -> v1::WorkKind {
    match kind {
        WorkKind::Evaluation => v1::WorkKind::Evaluation,
        WorkKind::Embedding => v1::WorkKind::Embedding,
        WorkKind::Replay => v1::WorkKind::Replay,
        WorkKind::Training => v1::WorkKind::Training,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_node_does_is_said_in_words() {
        let mut machine = ConnectedMachine {
            name: "bob".to_owned(),
            capacity: 2,
            work: Vec::new(),
        };
        let words = |machine: &ConnectedMachine| doing(&node(machine.clone(), v1::NodeKind::Worker));
        assert_eq!(words(&machine), "waiting for work");
        machine.work = [(WorkKind::Evaluation, 16), (WorkKind::Replay, 1)]
            .map(|(kind, tasks)| WorkInHand {
                kind,
                campaign: "small-1".parse().ok(),
                tasks,
            })
            .into();
        assert_eq!(
            words(&machine),
            "evaluates 16 controllers of small-1; simulates a motion of small-1"
        );
    }
}

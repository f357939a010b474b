//! `nodes`: the workers and trainers of a coordinator, and how many of them its work could use.

use super::{
    CliError, Global,
    connection::{self, Connection},
    json,
    table::{Table, left, right},
    validation::Validated as _,
};
use clap::builder::RangedU64ValueParser;
use murmuration_coordinator::local::InProcess;
use murmuration_link::errln;
use murmuration_proto::{parts::whole, v1};
use murmuration_service::nodes::doing;
use murmuration_swarm::{counted, grouped};

const EXAMPLES: &str = "\
Examples:
  murmuration nodes                              list the workers and trainers
  murmuration nodes --wanted --json              how many workers to start, for a script
  murmuration nodes --wanted --threads 32        the same for workers of 32 threads";

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Nodes {
    /// Show only how many workers and trainers the open work could use
    #[arg(long)]
    wanted: bool,
    /// Threads of a wanted worker [default: the mean of the connected workers, or 1]
    #[arg(long, value_name = "N", value_parser = RangedU64ValueParser::<u32>::new().range(1..=65_536))]
    threads: Option<u32>,
    /// Time in which the open work should be done, seconds [default: 300]
    #[arg(long, value_name = "SECONDS")]
    within: Option<f64>,
}

impl Nodes {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let ask = async |connection: &mut Connection| {
            let request = v1::GetDemandRequest {
                threads: self.threads,
                seconds: self.within,
            };
            let demand = connection.nodes.get_demand(request).await?.into_inner();
            if self.wanted {
                return Ok((demand, None));
            }
            let listed = connection.nodes.list_nodes(v1::ListNodesRequest {}).await?;
            let nodes = whole(listed.into_inner()).await?.nodes.validated()?;
            Ok((demand, Some(nodes)))
        };
        match (connection::with(global, InProcess::NONE, ask).await?, global.json) {
            ((demand, None), true) => json::print(json::Document(&demand))?,
            ((_, Some(nodes)), true) => json::print_all(nodes.iter().map(json::Document))?,
            ((demand, nodes), false) => {
                nodes.as_deref().map_or(Ok(()), show)?;
                errln!("{}", in_words(&demand));
            }
        }
        Ok(())
    }
}

fn show(nodes: &[v1::Node]) -> Result<(), CliError> {
    if nodes.is_empty() {
        errln!("no worker or trainer is connected");
        return Ok(());
    }
    let mut table = Table::new([left("NAME"), left("KIND"), right("THREADS"), left("NOW")]);
    for node in nodes {
        let kind = match node.kind() {
            v1::NodeKind::Trainer => "trainer",
            v1::NodeKind::Worker | v1::NodeKind::Unspecified => "worker",
        };
        let threads = node.threads.to_string();
        table.row([node.name.clone(), kind.to_owned(), threads, doing(node)]);
    }
    Ok(table.print()?)
}

/// The demand in a sentence.
fn in_words(demand: &v1::Demand) -> String {
    let wanted = format!(
        "wanted: {} and {}",
        counted(demand.workers.into(), "worker"),
        counted(demand.trainers.into(), "trainer")
    );
    match (demand.tasks, demand.thread_seconds) {
        (0, _) => format!("{wanted} (no open work)"),
        (tasks, None) => format!(
            "{wanted} (open work: {}, whose cost is not measured yet)",
            counted(tasks, "task")
        ),
        (tasks, Some(seconds)) => format!(
            "{wanted} (open work: {}, about {} s of one thread)",
            counted(tasks, "task"),
            grouped(seconds.ceil() as u64)
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn demand_is_said_in_words() {
        let mut demand = v1::Demand::default();
        assert_eq!(
            in_words(&demand),
            "wanted: 0 workers and 0 trainers (no open work)"
        );
        demand.workers = 7;
        demand.tasks = 10_000;
        assert!(in_words(&demand).contains("not measured yet"));
        demand.thread_seconds = Some(1999.5);
        assert_eq!(
            in_words(&demand),
            "wanted: 7 workers and 0 trainers (open work: 10,000 tasks, about 2,000 s of one thread)"
        );
    }
}

//! Following a campaign: a bar on a terminal, plain lines elsewhere, JSON lines for programs.

use super::{CliError, connection::Client, json};
use indicatif::{HumanCount, HumanDuration, ProgressBar, ProgressStyle};
use murmuration_proto::{CampaignSpec, v1};
use std::{
    io::IsTerminal as _,
    time::{Duration, Instant},
};

/// How progress is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Show {
    /// To a person, on stderr.
    Person,
    /// To a program: every status as a line of JSON on stdout.
    Lines,
}

/// Least time between two plain lines.
const LINE_INTERVAL: Duration = Duration::from_secs(2);

/// Follows a campaign until it stops; its last status.
pub(super) async fn follow(
    client: &mut Client,
    campaign: &str,
    show: Show,
) -> Result<v1::Campaign, CliError> {
    let request = v1::WatchCampaignRequest {
        campaign: campaign.to_owned(),
    };
    let mut statuses = client.watch_campaign(request).await?.into_inner();
    let mut view = View::new(show);
    let mut last = None;
    while let Some(status) = statuses.message().await? {
        view.draw(&status);
        last = Some(status);
    }
    view.end();
    last.ok_or_else(|| CliError::Failed(format!("the coordinator says nothing about campaign {campaign}")))
}

enum View {
    Bar(ProgressBar),
    Plain {
        next: Instant,
        generations_done: Option<u32>,
    },
    Json,
}

impl View {
    fn new(show: Show) -> Self {
        match show {
            Show::Lines => Self::Json,
            Show::Person if std::io::stderr().is_terminal() => Self::Bar(bar()),
            Show::Person => Self::Plain {
                next: Instant::now(),
                generations_done: None,
            },
        }
    }

    fn draw(&mut self, status: &v1::Campaign) {
        let total = evaluations(status);
        let done = evaluated(status);
        match self {
            Self::Json => json::print(&json::campaign(status)),
            Self::Bar(bar) => {
                bar.set_length(total);
                bar.set_position(done);
                bar.set_message(describe(status));
            }
            Self::Plain {
                next,
                generations_done,
            } => {
                let news = *generations_done != Some(status.generations_done);
                if (news && Instant::now() >= *next) || !status.active {
                    eprintln!(
                        "{}/{} evaluations · {}",
                        HumanCount(done),
                        HumanCount(total),
                        describe(status)
                    );
                    *next = Instant::now() + LINE_INTERVAL;
                    *generations_done = Some(status.generations_done);
                }
            }
        }
    }

    fn end(self) {
        if let Self::Bar(bar) = self {
            bar.abandon();
        }
    }
}

fn bar() -> ProgressBar {
    let bar = ProgressBar::new(0);
    if let Ok(style) = ProgressStyle::with_template("{wide_bar:.cyan/dim} {human_pos}/{human_len}\n{msg}") {
        bar.set_style(style);
    }
    bar
}

fn describe(status: &v1::Campaign) -> String {
    let generations = search(status).map_or(0, |search| search.generations());
    let mut parts = vec![format!("generation {}/{generations}", status.generations_done)];
    if let (Some(best), Some(mean)) = (status.best_novelty, status.mean_novelty) {
        parts.push(format!("novelty best {best:.4} mean {mean:.4}"));
    }
    if status.active {
        let left = evaluations(status) - evaluated(status);
        match (status.workers, status.evaluations_per_second) {
            (0, _) => parts.push("waiting for workers".to_owned()),
            (_, rate) if left == 0 && rate >= 0.0 => parts.push("clustering".to_owned()),
            (_, rate) if rate > 0.0 => {
                parts.push(format!("{rate:.0} evaluations/s"));
                let eta = Duration::try_from_secs_f64(left as f64 / rate).unwrap_or(Duration::MAX);
                parts.push(format!("{} left", HumanDuration(eta)));
            }
            _ => {}
        }
    }
    parts.join(" · ")
}

fn search(status: &v1::Campaign) -> Option<murmuration_proto::Search> {
    CampaignSpec::try_from(status.spec.clone()?)
        .ok()
        .map(|spec| *spec.search())
}

fn evaluations(status: &v1::Campaign) -> u64 {
    search(status).map_or(0, |search| search.evaluations())
}

fn evaluated(status: &v1::Campaign) -> u64 {
    let population = search(status).map_or(0, |search| search.population());
    u64::from(status.generations_done) * u64::from(population) + u64::from(status.evaluated_in_generation)
}

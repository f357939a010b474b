//! Following a campaign: a bar on a terminal, plain lines elsewhere, JSON lines for programs.

mod count;
mod status_line;

use super::{CliError, connection::Client, json, validation::Validated as _};
use indicatif::{HumanDuration, ProgressBar};
use murmuration_link::{OutputError, errln};
use murmuration_proto::v1;
use murmuration_swarm::{counted, grouped};
use std::{
    io::IsTerminal as _,
    time::{Duration, Instant},
};
pub use {
    count::{Count, bar},
    status_line::{StatusLine, name as stage_name},
};

/// The form in which progress is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Show {
    /// Progress for a person, on stderr.
    Person,
    /// Progress for a program: every status as a line of JSON on stdout.
    Lines,
}

/// Minimum time between two plain lines.
const LINE_INTERVAL: Duration = Duration::from_secs(2);

/// Follows a campaign until it stops. Returns its last status.
pub async fn follow(client: &mut Client, campaign: &str, show: Show) -> Result<v1::Campaign, CliError> {
    let mut view = View::new(show);
    let last = follow_with(client, campaign, |status| view.draw(status)).await?;
    view.end();
    Ok(last)
}

/// Follows a campaign until it stops, and calls `draw` with each status. Returns the last status.
pub async fn follow_with(
    client: &mut Client,
    campaign: &str,
    mut draw: impl FnMut(&v1::Campaign) -> Result<(), OutputError>,
) -> Result<v1::Campaign, CliError> {
    let request = v1::WatchCampaignRequest {
        campaign: campaign.to_owned(),
    };
    let mut statuses = client.watch_campaign(request).await?.into_inner();
    let mut last = None;
    while let Some(status) = statuses.message().await? {
        let status = status.validated()?;
        draw(&status)?;
        last = Some(status);
    }
    last.ok_or_else(|| {
        CliError::Failed(format!(
            "the coordinator sent no status of campaign {campaign}: try again, and look into its log"
        ))
    })
}

/// The progress shown so far, and its form.
pub struct View {
    to: Screen,
    /// The stage of the last status, and the time when this stage began.
    stage: Option<(v1::CampaignStage, Instant)>,
    /// Number of the last notice that was shown.
    noticed: u64,
}

enum Screen {
    Bar(ProgressBar),
    Plain {
        next: Instant,
        /// The campaign's stage and step in the last printed line, and whether the campaign waited.
        shown: Option<(v1::CampaignStage, u64, bool)>,
    },
    Json,
}

impl View {
    pub fn new(show: Show) -> Self {
        let to = match show {
            Show::Lines => Screen::Json,
            Show::Person if std::io::stderr().is_terminal() => {
                Screen::Bar(bar(0, "{wide_bar:.cyan/dim} {prefix}\n{msg}"))
            }
            Show::Person => Screen::Plain {
                next: Instant::now(),
                shown: None,
            },
        };
        Self {
            to,
            stage: None,
            noticed: 0,
        }
    }

    pub fn draw(&mut self, status: &v1::Campaign) -> Result<(), OutputError> {
        let line = StatusLine::of(status);
        self.end_stage(status.stage());
        self.notice(&status.notices);
        match &mut self.to {
            Screen::Json => json::print(json::Document(status))?,
            Screen::Bar(bar) => {
                bar.set_length(line.total);
                bar.set_position(line.done);
                bar.set_prefix(match line.total {
                    0 => String::new(),
                    total => format!("{}/{}", grouped(line.done), grouped(total)),
                });
                bar.set_message(line.text);
            }
            Screen::Plain { next, shown } => {
                let step = Some((status.stage(), line.step, !status.waiting.is_empty()));
                let due = step != *shown && Instant::now() >= *next;
                if due || !status.active {
                    errln!("{}{}", how_far(&line), line.text);
                    *next = Instant::now() + LINE_INTERVAL;
                    *shown = step;
                }
            }
        }
        Ok(())
    }

    /// Prints new notices about the campaign.
    fn notice(&mut self, notices: &[v1::Notice]) {
        for notice in notices.iter().filter(|notice| notice.number > self.noticed) {
            let line = format!("notice: {}", notice.text);
            match &self.to {
                Screen::Bar(bar) => bar.println(line),
                Screen::Plain { .. } => errln!("{line}"),
                Screen::Json => {}
            }
        }
        let latest = notices.last().map_or(0, |notice| notice.number);
        self.noticed = self.noticed.max(latest);
    }

    /// Prints the duration of a stage that has ended.
    fn end_stage(&mut self, now: v1::CampaignStage) {
        let Some((before, since)) = self.stage.replace((now, Instant::now())) else {
            return;
        };
        if before == now {
            self.stage = Some((before, since));
            return;
        }
        let line = format!(
            "{} done in {}",
            stage_name(before),
            HumanDuration(since.elapsed())
        );
        match &self.to {
            Screen::Bar(bar) => bar.println(line),
            Screen::Plain { .. } => errln!("{line}"),
            Screen::Json => {}
        }
    }

    pub fn end(self) {
        if let Screen::Bar(bar) = self.to {
            bar.abandon();
        }
    }
}

/// Progress of a stage; empty while the amount of work is unknown.
fn how_far(line: &StatusLine) -> String {
    if line.total == 0 {
        return String::new();
    }
    format!("{}/{} · ", grouped(line.done), counted(line.total, &line.unit))
}

//! Progress of a study: bars on a terminal, plain lines elsewhere.

use indicatif::{HumanDuration, MultiProgress, ProgressBar};
use murmuration_cli::follow::{StatusLine, bar};
use murmuration_link::errln;
use murmuration_proto::v1;
use murmuration_swarm::{counted, grouped};
use std::{
    io::IsTerminal as _,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::Instant,
};

/// Progress of a study; cheap to clone.
#[derive(Debug, Clone)]
pub(super) struct Progress {
    /// `None` without a terminal.
    bars: Option<(MultiProgress, ProgressBar)>,
    done: Arc<AtomicUsize>,
    all: usize,
}

/// Progress of a campaign of a study.
#[derive(Debug)]
pub(super) struct CellProgress {
    study: Progress,
    /// Name of the campaign's cell, in words.
    words: String,
    bar: Option<ProgressBar>,
    begun: Instant,
}

impl Progress {
    /// The progress of `all` campaigns.
    pub(super) fn of(all: usize) -> Self {
        let bars = std::io::stderr().is_terminal().then(|| {
            let bars = MultiProgress::new();
            let whole = bars.add(bar(all as u64, "{wide_bar:.cyan/dim} {pos}/{len} campaigns"));
            (bars, whole)
        });
        Self {
            bars,
            done: Arc::default(),
            all,
        }
    }

    /// Adds the progress of a campaign.
    pub(super) fn cell(&self, words: String) -> CellProgress {
        let bar = self
            .bars
            .as_ref()
            .map(|(bars, whole)| bars.insert_before(whole, bar(0, "{bar:24.cyan/dim} {prefix} · {msg}")));
        if let Some(bar) = &bar {
            bar.set_prefix(words.clone());
        }
        CellProgress {
            study: self.clone(),
            words,
            bar,
            begun: Instant::now(),
        }
    }

    /// Prints a line between the bars.
    pub(super) fn say(&self, line: &str) {
        match &self.bars {
            Some((bars, _)) => drop(bars.println(line)),
            None => errln!("{line}"),
        }
    }

    pub(super) fn end(&self) {
        if let Some((bars, _)) = &self.bars {
            drop(bars.clear());
        }
    }
}

impl CellProgress {
    /// Shows the id of the campaign, now that it is known.
    pub(super) fn begin(&self, campaign: &str) {
        if self.bar.is_none() {
            errln!("{}: campaign {campaign}", self.words);
        }
    }

    pub(super) fn draw(&self, status: &v1::Campaign) {
        if let Some(bar) = &self.bar {
            let line = StatusLine::of(status);
            bar.set_length(line.total);
            bar.set_position(line.done);
            bar.set_message(line.text);
        }
    }

    pub(super) fn now(&self, what: &'static str) {
        if let Some(bar) = &self.bar {
            bar.set_message(what);
        }
    }

    /// Ends the progress of the campaign.
    pub(super) fn end(self, how: &str) {
        let done = self.study.done.fetch_add(1, Ordering::Relaxed) + 1;
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
        if let Some((_, whole)) = &self.study.bars {
            whole.set_position(done as u64);
        }
        self.study.say(&format!(
            "{} of {}: {} {how} in {}",
            grouped(done as u64),
            counted(self.study.all as u64, "campaign"),
            self.words,
            HumanDuration(self.begun.elapsed())
        ));
    }
}

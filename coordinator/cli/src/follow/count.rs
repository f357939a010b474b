//! Progress over a known number of items.

use super::LINE_INTERVAL;
use indicatif::{ProgressBar, ProgressStyle};
use murmuration_link::errln;
use murmuration_swarm::{counted, grouped};
use std::{io::IsTerminal as _, time::Instant};

/// Progress over a known number of items: a bar on a terminal, a line from time to time elsewhere.
#[derive(Debug)]
pub struct Count {
    /// `None` without a terminal.
    bar: Option<ProgressBar>,
    done: u64,
    all: u64,
    /// The counted unit, in the singular.
    unit: &'static str,
    /// Earliest time of the next line.
    next: Instant,
}

impl Count {
    /// Begins with 0 of `all` items.
    pub fn of(all: u64, unit: &'static str) -> Self {
        let template = format!("{{wide_bar:.cyan/dim}} {{human_pos}}/{{human_len}} {unit}s · {{eta}} left");
        Self {
            bar: std::io::stderr().is_terminal().then(|| bar(all, &template)),
            done: 0,
            all,
            unit,
            next: Instant::now() + LINE_INTERVAL,
        }
    }

    /// Counts one more item.
    pub fn add(&mut self) {
        self.done += 1;
        match &self.bar {
            Some(bar) => bar.inc(1),
            None if Instant::now() >= self.next => {
                errln!("{}/{}", grouped(self.done), counted(self.all, self.unit));
                self.next = Instant::now() + LINE_INTERVAL;
            }
            None => {}
        }
    }

    pub fn end(self) {
        if let Some(bar) = self.bar {
            bar.finish_and_clear();
        }
    }
}

/// A bar with this `indicatif` template.
pub fn bar(length: u64, template: &str) -> ProgressBar {
    let bar = ProgressBar::new(length);
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar
}

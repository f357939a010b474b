//! How many of a known number of things are done.

use super::LINE_INTERVAL;
use indicatif::{ProgressBar, ProgressStyle};
use murmuration_link::errln;
use murmuration_proto::{counted, grouped};
use std::{io::IsTerminal as _, time::Instant};

/// How many of a known number of things are done: a bar on a terminal, a line from time to time elsewhere.
#[derive(Debug)]
pub struct Count {
    /// Present on a terminal.
    bar: Option<ProgressBar>,
    done: u64,
    all: u64,
    /// The unit that is counted, in the singular.
    unit: &'static str,
    /// When the next line is due.
    next: Instant,
}

impl Count {
    /// None of so many.
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

    /// One more is done.
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

/// A bar with this template of indicatif's.
pub fn bar(length: u64, template: &str) -> ProgressBar {
    let bar = ProgressBar::new(length);
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar
}

//! One task of a job: what workers said that its result is, and whether that settles it.

use super::{Agree, Instance, MOST_LOST, Settled};
use std::{collections::BTreeSet, time::Instant};

#[derive(Debug)]
pub(super) struct Task<R> {
    /// What each worker said, at most once; several where it is audited or disputed.
    pub(super) votes: Vec<(Instance, R)>,
    /// Who was lost while they held it, and has not been heard of since.
    pub(super) lost: BTreeSet<Instance>,
    /// Workers that have it in hand.
    pub(super) out: usize,
    /// Since when nobody is there who could decide a dispute about it.
    pub(super) alone_since: Option<Instant>,
    /// Whether one voice is not enough.
    audited: bool,
}

/// Where a task stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Verdict {
    /// It needs a worker.
    Open,
    /// The vote at this place is its result.
    Settled(usize),
    /// It took too many workers with it.
    SetAside,
}

impl Verdict {
    pub(super) const fn is_settled(self) -> bool {
        matches!(self, Self::Settled(_) | Self::SetAside)
    }
}

impl<R: Agree> Task<R> {
    pub(super) const fn new(audited: bool) -> Self {
        Self {
            votes: Vec::new(),
            lost: BTreeSet::new(),
            out: 0,
            alone_since: None,
            audited,
        }
    }

    /// One voice settles a task; two that agree one that is audited or disputed, so that whoever differs is outvoted.
    pub(super) fn verdict(&self) -> Verdict {
        let voices = |place: usize| self.agreeing(place).count();
        let Some(best) = (0..self.votes.len()).rev().max_by_key(|&place| voices(place)) else {
            return if self.lost.len() >= MOST_LOST {
                Verdict::SetAside
            } else {
                Verdict::Open
            };
        };
        let unanimous = voices(best) == self.votes.len();
        let wanted = if self.audited || !unanimous { 2 } else { 1 };
        if voices(best) >= wanted {
            Verdict::Settled(best)
        } else {
            Verdict::Open
        }
    }

    /// Whether this worker has said what it is.
    pub(super) fn has_voice(&self, instance: Instance) -> bool {
        self.votes.iter().any(|(by, _)| *by == instance)
    }

    /// Who has said what it is.
    pub(super) fn voices(&self) -> impl Iterator<Item = Instance> {
        self.votes.iter().map(|(by, _)| *by)
    }

    /// Whether workers differ about it.
    pub(super) fn is_disputed(&self) -> bool {
        !self.votes.is_empty() && self.agreeing(0).count() < self.votes.len()
    }

    /// Takes in a voice; false if the worker contradicts what it said itself.
    pub(super) fn hear(&mut self, by: Instance, result: R) -> bool {
        if let Some((_, before)) = self.votes.iter().find(|(instance, _)| *instance == by) {
            return before.agrees_with(&result);
        }
        self.votes.push((by, result));
        true
    }

    /// Forgets the voice of a worker; whether it had one.
    pub(super) fn unhear(&mut self, instance: Instance) -> bool {
        let before = self.votes.len();
        self.votes.retain(|(by, _)| *by != instance);
        self.votes.len() < before
    }

    /// One voice is enough from now on.
    pub(super) const fn waive_audit(&mut self) {
        self.audited = false;
    }

    /// Whose voices the settled result shows to be wrong.
    pub(super) fn wrong(&self) -> Vec<Instance> {
        let Verdict::Settled(place) = self.verdict() else {
            return Vec::new();
        };
        let result = &self.votes[place].1;
        let differs = |(_, other): &&(Instance, R)| !result.agrees_with(other);
        self.votes.iter().filter(differs).map(|(by, _)| *by).collect()
    }

    pub(super) fn into_settled(mut self) -> Option<Settled<R>> {
        match self.verdict() {
            Verdict::Open => None,
            Verdict::SetAside => Some(Settled::SetAside {
                lost: self.lost.into_iter().collect(),
            }),
            Verdict::Settled(place) => {
                let audited = self.agreeing(place).count() > 1;
                let (by, value) = self.votes.swap_remove(place);
                Some(Settled::Result { value, by, audited })
            }
        }
    }

    fn agreeing(&self, place: usize) -> impl Iterator<Item = &(Instance, R)> {
        let result = &self.votes[place].1;
        self.votes
            .iter()
            .filter(move |(_, other)| result.agrees_with(other))
    }
}

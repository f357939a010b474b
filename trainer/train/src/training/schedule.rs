//! The schedule of the learning rate, and the losses so far.

use murmuration_swarm::training::{RandomTriplets, Recipe};

/// The learning rate and the values that determine it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Schedule {
    pub(super) state: ScheduleState,
    plateau: Option<Plateau>,
}

/// The part of a schedule that changes.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ScheduleState {
    pub(super) learning_rate: f64,
    /// Mean losses of the last epochs, as many as the recipe needs.
    pub(super) losses: Vec<f64>,
    /// Lowest loss of an epoch.
    pub(super) lowest: f64,
    /// Epochs since the lowest loss, or since the learning rate fell.
    pub(super) waited: u64,
}

/// Lowers the learning rate by a factor when the loss does not fall (like PyTorch's `ReduceLROnPlateau`).
#[derive(Debug, Clone, PartialEq)]
struct Plateau {
    patience: u64,
    factor: f64,
    remembered: usize,
}

impl Plateau {
    const fn of(recipe: &RandomTriplets) -> Self {
        Self {
            patience: recipe.plateau,
            factor: recipe.plateau_factor,
            remembered: recipe.enough_over,
        }
    }
}

/// A loss counts as lower if it is lower by more than this share.
const THRESHOLD: f64 = 1e-4;

impl Schedule {
    pub(super) fn new(recipe: &Recipe) -> Self {
        let plateau = match recipe {
            Recipe::Paper(recipe) => Some(Plateau::of(recipe)),
            Recipe::PaperLabelled(recipe) => Some(Plateau::of(&recipe.triplets)),
            Recipe::InBatch(_) | Recipe::Labelled(_) | Recipe::Untrained => None,
        };
        Self {
            state: ScheduleState {
                learning_rate: recipe.learning_rate(),
                losses: Vec::new(),
                lowest: f64::INFINITY,
                waited: 0,
            },
            plateau,
        }
    }

    pub(super) const fn learning_rate(&self) -> f64 {
        self.state.learning_rate
    }

    /// Sets the learning rate, for recipes with a schedule of their own.
    pub(super) const fn set_learning_rate(&mut self, rate: f64) {
        self.state.learning_rate = rate;
    }

    /// Records the mean loss of a finished epoch.
    pub(super) fn after_epoch(&mut self, loss: f64) {
        let state = &mut self.state;
        let remembered = self.plateau.as_ref().map_or(1, |plateau| plateau.remembered);
        state.losses.push(loss);
        let forgotten = state.losses.len().saturating_sub(remembered);
        state.losses.drain(..forgotten);
        if loss < state.lowest * (1.0 - THRESHOLD) {
            state.lowest = loss;
            state.waited = 0;
        } else {
            state.waited += 1;
        }
        if let Some(plateau) = self
            .plateau
            .as_ref()
            .filter(|plateau| state.waited > plateau.patience)
        {
            state.learning_rate *= plateau.factor;
            state.waited = 0;
        }
    }

    /// Mean loss of the given number of last epochs; infinite while fewer epochs have ended.
    pub(super) fn mean_of_last(&self, epochs: usize) -> f64 {
        let losses = &self.state.losses;
        if losses.len() < epochs {
            return f64::INFINITY;
        }
        losses[losses.len() - epochs..].iter().sum::<f64>() / epochs as f64
    }

    pub(super) fn has_diverged(&self) -> bool {
        self.state.losses.last().is_some_and(|loss| !loss.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn schedule() -> Schedule {
        Schedule::new(&Recipe::Paper(RandomTriplets {
            plateau: 2,
            enough_over: 3,
            learning_rate: 1.0,
            ..RandomTriplets::default()
        }))
    }

    #[test]
    fn the_rate_falls_after_one_more_epoch_than_the_plateau() {
        let mut schedule = schedule();
        let rates = [5.0, 4.0, 4.0, 4.0, 4.0, 3.0, 3.0, 3.0, 2.9999, 1.0].map(|loss| {
            schedule.after_epoch(loss);
            schedule.learning_rate()
        });
        assert_eq!(
            rates,
            [1.0, 1.0, 1.0, 1.0, 0.1, 0.1, 0.1, 0.1, 0.1 * 0.1, 0.1 * 0.1]
        );
    }

    #[test]
    fn the_mean_is_over_the_last_epochs_only() {
        let mut schedule = schedule();
        let means = [8.0, 1.0, 3.0, 5.0].map(|loss| {
            schedule.after_epoch(loss);
            schedule.mean_of_last(3)
        });
        assert_eq!(means, [f64::INFINITY, f64::INFINITY, 4.0, 3.0]);
    }

    #[test]
    fn a_loss_that_is_no_number_is_noticed() {
        let mut schedule = schedule();
        schedule.after_epoch(f64::NAN);
        assert!(schedule.has_diverged());
    }
}

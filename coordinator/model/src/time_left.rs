//! Estimates how long a campaign still takes.

use crate::Stage;
use murmuration_swarm::{CampaignSpec, Feedback, counted};

/// The remaining work of a campaign, and its pace.
#[derive(Debug, Clone, Copy)]
pub struct WorkLeft<'a> {
    pub spec: &'a CampaignSpec,
    pub stage: Stage,
    pub generations_done: u32,
    /// Evaluations of the next generation that have arrived.
    pub arrived: u32,
    /// Rounds of feedback that are complete.
    pub rounds_done: u32,
    /// Whether a further round is in progress.
    pub is_learning: bool,
    /// Evaluations per second over the last seconds; in the dataset stage, simulations per second. 0 if unknown.
    pub per_second: f64,
    /// Remaining seconds of the stage, if known.
    pub stage_seconds: Option<f64>,
}

/// A remaining time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeLeft {
    /// Seconds that the known parts of the work take.
    pub seconds: f64,
    /// Whether further parts take an unknown time.
    pub is_least: bool,
}

impl WorkLeft<'_> {
    /// The remaining time of the whole campaign, without the clustering at its end, which takes seconds (half a minute for a
    /// million individuals). `None` if nothing is known. The pace of a search is known only during the search; the simulation of
    /// the dataset gives a lower bound of the search's time. The pace of a training is known only during the training.
    pub fn whole(&self) -> Option<TimeLeft> {
        let of_spec = self.spec.feedback().map_or(0, Feedback::rounds);
        let rounds = of_spec.max(self.rounds_done.saturating_add(self.is_learning.into()));
        let evaluations = self.evaluations(rounds);
        let has_rounds = rounds > self.rounds_done;
        let (seconds, is_least) = match self.stage {
            Stage::Taxonomy => return None,
            Stage::Evolve => (self.lasts(evaluations)?, has_rounds),
            // An evaluation takes at least one simulation for each start.
            Stage::Dataset => {
                let simulations = evaluations * self.spec.starts().get() as u64;
                (self.stage_seconds? + self.lasts(simulations)?, true)
            }
            Stage::Embed => (self.stage_seconds?, has_rounds || evaluations > 0),
            Stage::Pretrain | Stage::Label | Stage::FineTune => (self.stage_seconds?, true),
        };
        Some(TimeLeft { seconds, is_least })
    }

    /// Number of remaining evaluations, if the campaign has `rounds` rounds in total.
    fn evaluations(&self, rounds: u32) -> u64 {
        let search = self.spec.search();
        let further = self.spec.feedback().map_or(0, Feedback::generations);
        let generations = u64::from(search.generations()) + u64::from(further) * u64::from(rounds);
        let left = generations.saturating_sub(self.generations_done.into());
        let arrived = match self.stage {
            Stage::Evolve => self.arrived,
            _ => 0,
        };
        (left * u64::from(search.population())).saturating_sub(arrived.into())
    }

    fn lasts(&self, count: u64) -> Option<f64> {
        (self.per_second > 0.0).then(|| count as f64 / self.per_second)
    }
}

impl TimeLeft {
    /// A time without unknown parts.
    pub const fn about(seconds: f64) -> Self {
        Self {
            seconds,
            is_least: false,
        }
    }

    /// The time in words, such as `about 5 minutes` and `at least 2 hours`.
    pub fn in_words(self) -> String {
        let seconds = self.seconds;
        match self.is_least {
            false => match seconds {
                under if under < 60.0 => "under a minute".to_owned(),
                under if under < 3600.0 => {
                    format!("about {}", counted((under / 60.0).ceil() as u64, "minute"))
                }
                hours => format!("about {}", counted((hours / 3600.0).round() as u64, "hour")),
            },
            true => match seconds {
                under if under < 10.0 => format!("at least {}", counted(under as u64, "second")),
                under if under < 60.0 => format!("at least {} seconds", 10 * (under / 10.0) as u64),
                under if under < 3600.0 => format!("at least {}", counted((under / 60.0) as u64, "minute")),
                hours => format!("at least {}", counted((hours / 3600.0) as u64, "hour")),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spec(feedback: &str) -> CampaignSpec {
        let text = format!(
            "model = \"single-sensor\"\nmethod = \"latent\"\n[search]\npopulation = 10\ngenerations = 20\n\
             [evaluation]\nstarts = 3\n{feedback}"
        );
        CampaignSpec::from_toml(&text).unwrap()
    }

    fn left(spec: &CampaignSpec, stage: Stage) -> WorkLeft<'_> {
        WorkLeft {
            spec,
            stage,
            generations_done: 4,
            arrived: 5,
            rounds_done: 0,
            is_learning: false,
            per_second: 5.0,
            stage_seconds: Some(60.0),
        }
    }

    #[test]
    fn a_search_without_rounds_is_known_and_one_with_rounds_takes_at_least_its_evaluations() {
        let (plain, rounds) = (spec(""), spec("[feedback]\nrounds = 2\ngenerations = 10"));
        // 16 generations of 10 evaluations, without the 5 evaluations that have arrived.
        assert_eq!(left(&plain, Stage::Evolve).whole(), Some(TimeLeft::about(31.0)));
        let whole = left(&rounds, Stage::Evolve).whole().unwrap();
        assert_eq!((whole.seconds, whole.is_least), (71.0, true));
        let last = WorkLeft {
            rounds_done: 2,
            generations_done: 39,
            ..left(&rounds, Stage::Evolve)
        };
        assert_eq!(last.whole(), Some(TimeLeft::about(1.0)));
    }

    #[test]
    fn a_dataset_tells_the_pace_of_the_search_and_a_training_tells_none() {
        let spec = spec("");
        let dataset = WorkLeft {
            generations_done: 0,
            ..left(&spec, Stage::Dataset)
        };
        // 200 evaluations of three starts, at five simulations a second.
        let whole = dataset.whole().unwrap();
        assert_eq!((whole.seconds, whole.is_least), (180.0, true));
        let training = left(&spec, Stage::Pretrain).whole().unwrap();
        assert_eq!((training.seconds, training.is_least), (60.0, true));
    }

    #[test]
    fn the_search_after_a_round_that_is_learned_now_is_not_forgotten() {
        let spec = spec("[feedback]\nrounds = 0\ngenerations = 10");
        let embedding = WorkLeft {
            generations_done: 20,
            ..left(&spec, Stage::Embed)
        };
        assert_eq!(embedding.whole(), Some(TimeLeft::about(60.0)));
        let learned = WorkLeft {
            rounds_done: 1,
            ..embedding
        };
        assert!(learned.whole().unwrap().is_least);
    }

    #[test]
    fn nothing_is_said_where_nothing_is_known() {
        let spec = spec("");
        for stage in [Stage::Evolve, Stage::Dataset, Stage::FineTune, Stage::Taxonomy] {
            let unknown = WorkLeft {
                per_second: 0.0,
                stage_seconds: None,
                ..left(&spec, stage)
            };
            assert_eq!(unknown.whole(), None, "{stage:?}");
        }
    }

    #[test]
    fn a_least_time_is_rounded_down_and_another_up() {
        let message = |seconds| [false, true].map(|is_least| TimeLeft { seconds, is_least }.in_words());
        assert_eq!(message(4.0), ["under a minute", "at least 4 seconds"]);
        assert_eq!(message(59.0), ["under a minute", "at least 50 seconds"]);
        assert_eq!(message(61.0), ["about 2 minutes", "at least 1 minute"]);
        assert_eq!(message(7_100.0), ["about 2 hours", "at least 1 hour"]);
    }
}

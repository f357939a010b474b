//! A campaign's status in one line for people.

use indicatif::HumanDuration;
use murmuration_model::TimeLeft;
use murmuration_proto::v1;
use murmuration_swarm::{figure, grouped, rounded};
use std::time::Duration;

/// Progress of a campaign's stage, and a line about it.
pub struct StatusLine {
    pub done: u64,
    pub total: u64,
    /// The counted unit, in the singular.
    pub unit: String,
    /// A number that rises when the campaign has something new to print.
    pub step: u64,
    pub text: String,
}

/// A stage in a word.
pub const fn name(stage: v1::CampaignStage) -> &'static str {
    match stage {
        v1::CampaignStage::Unspecified => "nothing",
        v1::CampaignStage::Dataset => "dataset",
        v1::CampaignStage::Pretrain => "pretrain",
        v1::CampaignStage::Embed => "embed",
        v1::CampaignStage::Evolve => "evolve",
        v1::CampaignStage::Label => "label",
        v1::CampaignStage::FineTune => "fine-tune",
        v1::CampaignStage::Taxonomy => "taxonomy",
    }
}

impl StatusLine {
    /// The progress of the campaign or, if the campaign waits, the reason.
    pub fn of(status: &v1::Campaign) -> Self {
        let line = Self::of_stage(status);
        if status.waiting.is_empty() {
            return line;
        }
        Self {
            text: format!("waiting: {}", status.waiting),
            ..line
        }
    }

    fn of_stage(status: &v1::Campaign) -> Self {
        match status.stage() {
            v1::CampaignStage::Dataset => Self::counted(status, "simulations").with_whole(status),
            v1::CampaignStage::Pretrain | v1::CampaignStage::FineTune => Self::training(status),
            v1::CampaignStage::Label => Self::counted(status, "labels"),
            v1::CampaignStage::Embed => Self::counted(status, "embeddings"),
            v1::CampaignStage::Evolve | v1::CampaignStage::Taxonomy | v1::CampaignStage::Unspecified => {
                Self::evolution(status).with_whole(status)
            }
        }
    }

    /// Adds the minimum remaining time of the whole campaign, if further stages follow.
    fn with_whole(self, status: &v1::Campaign) -> Self {
        match status.time_left {
            Some(v1::TimeLeft {
                seconds,
                is_least: true,
            }) if self.done < self.total => {
                let whole = TimeLeft {
                    seconds,
                    is_least: true,
                };
                Self {
                    text: format!("{} · {} in all", self.text, whole.in_words()),
                    ..self
                }
            }
            _ => self,
        }
    }

    fn counted(status: &v1::Campaign, rate: &str) -> Self {
        let progress = status.progress.clone().unwrap_or_default();
        let mut parts = vec![name(status.stage()).to_owned()];
        parts.extend(pace(status, &progress, rate));
        Self::at(progress, parts)
    }

    /// A line with the progress of a stage and a text made from `parts`.
    fn at(progress: v1::StageProgress, parts: Vec<String>) -> Self {
        Self {
            step: progress.done,
            done: progress.done,
            total: progress.total,
            unit: progress.unit,
            text: parts.join(" · "),
        }
    }

    fn training(status: &v1::Campaign) -> Self {
        let progress = status.training.unwrap_or_default();
        let mut parts = vec![name(status.stage()).to_owned()];
        let mut say = |figure: Option<f64>, text: fn(f64) -> String| parts.extend(figure.map(text));
        say(progress.loss, |loss| format!("loss {}", figure(loss)));
        say(progress.learning_rate, |rate| {
            format!("learning rate {}", rounded(rate, 5))
        });
        say(progress.triplet_accuracy, |share| {
            format!("accuracy on held-out triplets {} %", rounded(100.0 * share, 1))
        });
        say(progress.triplets_per_second, |rate| {
            format!("{} triplets/s", grouped(rate as u64))
        });
        say(progress.seconds_left, |seconds| {
            let left = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
            format!("at most {} left", HumanDuration(left))
        });
        if status.active && status.training.is_none() && status.trainers > 0 {
            parts.push("the trainer begins".to_owned());
        }
        Self::at(status.progress.clone().unwrap_or_default(), parts)
    }

    fn evolution(status: &v1::Campaign) -> Self {
        let progress = status.progress.clone().unwrap_or_default();
        let mut parts = vec![format!(
            "{} of {} generations",
            grouped(status.generations_done.into()),
            grouped(status.generations.into())
        )];
        if let (Some(best), Some(mean)) = (status.best_novelty, status.mean_novelty) {
            parts.push(format!(
                "novelty of the last generation: best {}, mean {}",
                figure(best),
                figure(mean)
            ));
        }
        if status.active && status.evaluations_done >= status.evaluations && status.workers > 0 {
            parts.push("clustering".to_owned());
        } else {
            parts.extend(pace(status, &progress, "evaluations"));
        }
        Self {
            step: status.generations_done.into(),
            ..Self::at(progress, parts)
        }
    }
}

/// Rate and remaining time; empty without a rate.
fn pace(status: &v1::Campaign, progress: &v1::StageProgress, unit: &str) -> Vec<String> {
    let Some(seconds) = progress.seconds_left else {
        return Vec::new();
    };
    let left = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
    vec![
        format!(
            "{} {unit}/s",
            grouped(status.evaluations_per_second.round() as u64)
        ),
        format!("{} left", HumanDuration(left)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_campaign_with_rounds_to_come_says_how_long_all_of_it_takes_at_least() {
        let line = |is_least: bool| {
            let mut status = v1::Campaign {
                active: true,
                generations: 20,
                evaluations: 200,
                progress: Some(v1::StageProgress {
                    total: 200,
                    seconds_left: Some(200.0),
                    ..v1::StageProgress::default()
                }),
                time_left: Some(v1::TimeLeft {
                    seconds: 400.0,
                    is_least,
                }),
                evaluations_per_second: 1.0,
                workers: 1,
                ..v1::Campaign::default()
            };
            status.set_stage(v1::CampaignStage::Evolve);
            StatusLine::of(&status).text
        };
        let rounds = line(true);
        assert!(
            rounds.ends_with("3 minutes left · at least 6 minutes in all"),
            "{rounds}"
        );
        let none = line(false);
        assert!(none.ends_with("3 minutes left"), "{none}");
    }
}

//! What a campaign's status says to a person.

use indicatif::HumanDuration;
use murmuration_model::{Stage, WorkLeft};
use murmuration_proto::{CampaignSpec, EmbedderSource, Feedback, Search, figure, grouped, rounded, v1};
use std::time::Duration;

/// How far a campaign's stage has come, and a line about it.
pub struct StatusLine {
    pub done: u64,
    pub total: u64,
    /// The unit that is counted, in the singular.
    pub unit: &'static str,
    /// Rises when there is something to say again.
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
    /// The progress; while the campaign waits, what it waits for.
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
        let spec = status
            .spec
            .clone()
            .map(CampaignSpec::try_from)
            .and_then(Result::ok);
        match status.stage() {
            v1::CampaignStage::Dataset => {
                let total = spec.as_ref().map_or(0, pictures);
                let done = status.dataset_done.min(total);
                let line = Self::counted(status, (done, total), "picture", "simulations");
                line.with_whole(status, spec.as_ref(), Stage::Dataset)
            }
            v1::CampaignStage::Pretrain | v1::CampaignStage::FineTune => Self::training(status),
            v1::CampaignStage::Label => {
                let total = spec
                    .as_ref()
                    .and_then(CampaignSpec::feedback)
                    .map_or(0, Feedback::labels);
                let done = status.labelled.min(total);
                Self::counted(status, (done.into(), total.into()), "individual", "labels")
            }
            v1::CampaignStage::Embed => {
                let search = spec.as_ref().map(|spec| *spec.search());
                let total = u64::from(status.generations_done) * population(search);
                let done = status.embedded.min(total);
                Self::counted(status, (done, total), "picture", "embeddings")
            }
            v1::CampaignStage::Evolve | v1::CampaignStage::Taxonomy | v1::CampaignStage::Unspecified => {
                let line = Self::evolution(status, spec.as_ref().map(|spec| *spec.search()));
                line.with_whole(status, spec.as_ref(), Stage::Evolve)
            }
        }
    }

    /// Says too how long the whole campaign takes at least, where it has more to do than this stage.
    fn with_whole(self, status: &v1::Campaign, spec: Option<&CampaignSpec>, stage: Stage) -> Self {
        let rate = status.evaluations_per_second;
        let left = spec.map(|spec| WorkLeft {
            spec,
            stage,
            generations_done: status.generations_done,
            arrived: status.evaluated_in_generation,
            rounds_done: status.rounds_done,
            is_learning: false,
            per_second: rate,
            stage_seconds: (rate > 0.0).then(|| (self.total - self.done) as f64 / rate),
        });
        let whole = left.and_then(|left| left.whole());
        match whole.filter(|whole| status.active && whole.is_least && self.done < self.total) {
            Some(whole) => Self {
                text: format!("{} · {} in all", self.text, whole.in_words()),
                ..self
            },
            None => self,
        }
    }

    fn counted(status: &v1::Campaign, (done, total): (u64, u64), unit: &'static str, rate: &str) -> Self {
        let mut parts = vec![name(status.stage()).to_owned()];
        parts.extend(pace(status, total - done, rate));
        Self {
            done,
            total,
            unit,
            step: done,
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
        Self {
            done: progress.epoch,
            total: progress.epochs,
            unit: "epoch",
            step: progress.epoch,
            text: parts.join(" · "),
        }
    }

    fn evolution(status: &v1::Campaign, search: Option<Search>) -> Self {
        let generations = status.generations;
        let total = u64::from(generations) * population(search);
        let done = u64::from(status.generations_done) * population(search)
            + u64::from(status.evaluated_in_generation);
        let done = done.min(total);
        let mut parts = vec![format!(
            "{} of {} generations",
            grouped(status.generations_done.into()),
            grouped(generations.into())
        )];
        if let (Some(best), Some(mean)) = (status.best_novelty, status.mean_novelty) {
            parts.push(format!(
                "novelty of the last generation: best {}, mean {}",
                figure(best),
                figure(mean)
            ));
        }
        if status.active && done == total && status.workers > 0 {
            parts.push("clustering".to_owned());
        } else {
            parts.extend(pace(status, total - done, "evaluations"));
        }
        Self {
            done,
            total,
            unit: "evaluation",
            step: status.generations_done.into(),
            text: parts.join(" · "),
        }
    }
}

/// How fast it goes and how long it will take, if it goes at all.
fn pace(status: &v1::Campaign, left: u64, unit: &str) -> Vec<String> {
    match (status.active, status.evaluations_per_second) {
        (true, rate) if rate > 0.0 => {
            let eta = Duration::try_from_secs_f64(left as f64 / rate).unwrap_or(Duration::MAX);
            vec![
                format!("{} {unit}/s", grouped(rate.round() as u64)),
                format!("{} left", HumanDuration(eta)),
            ]
        }
        _ => Vec::new(),
    }
}

/// Pictures of the dataset; 0 if there is none.
fn pictures(spec: &CampaignSpec) -> u64 {
    match spec.embedder() {
        Some(EmbedderSource::Trained { dataset, .. }) => dataset.pictures(),
        Some(EmbedderSource::Published(_)) | None => 0,
    }
}

fn population(search: Option<Search>) -> u64 {
    search.map_or(0, |search| search.population().into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_campaign_with_rounds_to_come_says_how_long_all_of_it_takes_at_least() {
        let line = |feedback: &str| {
            let text = format!(
                "model = \"single-sensor\"\nmethod = \"latent\"\n[search]\npopulation = 10\ngenerations = 20\n{feedback}"
            );
            let spec = CampaignSpec::from_toml(&text).unwrap();
            let mut status = v1::Campaign {
                spec: Some((&spec).into()),
                active: true,
                generations: 20,
                evaluations_per_second: 1.0,
                workers: 1,
                ..v1::Campaign::default()
            };
            status.set_stage(v1::CampaignStage::Evolve);
            StatusLine::of(&status).text
        };
        let rounds = line("[feedback]\nrounds = 1\ngenerations = 20");
        assert!(
            rounds.ends_with("3 minutes left · at least 6 minutes in all"),
            "{rounds}"
        );
        let none = line("");
        assert!(none.ends_with("3 minutes left"), "{none}");
    }
}

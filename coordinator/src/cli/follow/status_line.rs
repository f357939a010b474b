//! What a campaign's status says to a person.

use indicatif::HumanDuration;
use murmuration_proto::{CampaignSpec, EmbedderSource, Feedback, Search, figure, grouped, v1};
use std::time::Duration;

/// How far a campaign's stage has come, and a line about it.
pub(in crate::cli) struct StatusLine {
    pub(in crate::cli) done: u64,
    pub(in crate::cli) total: u64,
    /// What is counted, in the singular.
    pub(in crate::cli) unit: &'static str,
    /// Rises when there is something to say again.
    pub(in crate::cli) step: u64,
    pub(in crate::cli) text: String,
}

/// A stage in a word.
pub(in crate::cli) const fn name(stage: v1::CampaignStage) -> &'static str {
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
    /// What there is to say; while the campaign waits for something, what for.
    pub(in crate::cli) fn of(status: &v1::Campaign) -> Self {
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
                Self::counted(status, (done, total), "picture", "simulations")
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
                Self::evolution(status, spec.as_ref().map(|spec| *spec.search()))
            }
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
        say(progress.learning_rate, |rate| format!("learning rate {rate:.5}"));
        say(progress.triplet_accuracy, |share| {
            format!("accuracy on held-out triplets {:.1} %", 100.0 * share)
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

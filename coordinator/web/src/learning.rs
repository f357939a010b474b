//! The button that begins a round of learning, with the effects on the campaign and the expected duration.

use super::{Web, asked::Query, layout::Part, page_error::PageError};
use axum::{
    extract::{Path, State},
    response::Redirect,
};
use maud::{Markup, html};
use murmuration_model::{CampaignRecord, CampaignState, TimeLeft};
use murmuration_store::{Store, StoreError, TaxonomyVersion};
use murmuration_swarm::{Feedback, counted};

/// The button that starts learning from the labels, on the page of `part`; empty if the campaign has no embedding.
pub(super) async fn button(web: &Web, record: &CampaignRecord, part: Part) -> Result<Markup, PageError> {
    if !record.spec.space().embeds() || record.state == CampaignState::Cancelled {
        return Ok(Markup::default());
    }
    let of = record.clone();
    let estimate = web.store.run(move |store| Estimate::read(store, &of)).await?;
    let page = if part == Part::Map { "?page=map" } else { "" };
    Ok(html! {
        form.learn method="post" action={ "/campaigns/" (record.id) "/refine" (page) } data-ask=(announcement(record, estimate)) {
            button { "Learn from all answers" }
            p #doing.reason role="status" {}
            p.reason { a href={ "/campaigns/" (record.id) "#pause" } { "Progress" } " shows how far it is, and can pause it." }
        }
    })
}

/// The parameters of the address of [`begin`].
#[derive(Debug, serde::Deserialize)]
pub(super) struct Asked {
    page: Option<String>,
}

/// Starts to learn from the labels, and leads to the page Progress. A person who began on the map stays there.
pub(super) async fn begin(
    State(web): State<Web>,
    Path(id): Path<String>,
    Query(asked): Query<Asked>,
) -> Result<Redirect, PageError> {
    let refined = web.campaigns.refine(&id).await?;
    let page = if asked.page.as_deref() == Some("map") {
        "/map"
    } else {
        ""
    };
    Ok(Redirect::to(&format!("/campaigns/{}{page}", refined.record.id)))
}

/// Duration of a round, estimated from the last round.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Estimate {
    /// Seconds of training.
    training: f64,
    /// Seconds from the end of the training to the taxonomy, scaled to the current number of individuals; `None` if the last
    /// round made no taxonomy.
    after: Option<f64>,
}

impl Estimate {
    /// Reads the times of the last round; `None` before the first round, and for imported campaigns.
    fn read(store: &Store, record: &CampaignRecord) -> Result<Option<Self>, StoreError> {
        let round = record.rounds.done;
        if round == 0 {
            return Ok(None);
        }
        let times = store.epoch_times(&record.id, round)?;
        let (Some(training), Some(&trained_ms)) = (lasted(&times), times.last()) else {
            return Ok(None);
        };
        let versions = store.taxonomy_versions(&record.id)?;
        let made = versions.iter().find(|version| version.rounds == round);
        let after = made.and_then(|made| until_made(trained_ms, made, record.individuals()));
        Ok(Some(Self { training, after }))
    }

    fn in_words(self) -> String {
        let message = |seconds| TimeLeft::about(seconds).in_words();
        match self.after {
            Some(after) => format!(
                "As long as the last round: {}, with {} of training, and {} to embed, search and cluster.",
                message(self.training + after),
                message(self.training),
                message(after)
            ),
            None => format!(
                "As in the last round, the training takes {}; then the campaign embeds, searches and clusters.",
                message(self.training)
            ),
        }
    }
}

/// Seconds of a training, from the times at which its epochs ended, in milliseconds. The result is the median duration of an
/// epoch times the number of epochs, so that a pause does not count. Returns `None` for fewer than two epochs.
fn lasted(times: &[u64]) -> Option<f64> {
    let mut epochs: Vec<u64> = times
        .windows(2)
        .map(|pair| pair[1].saturating_sub(pair[0]))
        .collect();
    epochs.sort_unstable();
    let median = *epochs.get(epochs.len() / 2)?;
    Some(median as f64 / 1000.0 * times.len() as f64)
}

/// Seconds from the end of a training to the taxonomy `made` after it, scaled from the taxonomy's number of individuals to `now`
/// individuals; `None` if the time of the taxonomy is unknown.
fn until_made(trained_ms: u64, made: &TaxonomyVersion, now: u64) -> Option<f64> {
    let took = made.made_ms?.saturating_sub(trained_ms) as f64 / 1000.0;
    Some(took * now as f64 / made.individuals.max(1) as f64)
}

/// The question before a round, with its effects and its duration, in the format of `ask.js`.
fn announcement(record: &CampaignRecord, estimate: Option<Estimate>) -> String {
    let further = record.spec.feedback().map_or(0, Feedback::generations);
    let search = match further {
        0 => String::new(),
        further => format!(
            " Then it searches for {} more.",
            counted(further.into(), "generation")
        ),
    };
    let takes = estimate.map_or_else(
        || "That takes from seconds to some minutes.".to_owned(),
        Estimate::in_words,
    );
    format!(
        "Learn from all answers?\n\
         - The campaign fine-tunes its embedder on all labels, and embeds the {} again.{search}\n\
         - The clusters and their order change. Your labels stay.\n\
         - The page Progress shows the training, and can pause it. Resume continues after the last epoch.\n\
         {takes}",
        counted(record.individuals(), "individual")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_training_takes_its_median_epoch_as_often_as_it_had_epochs() {
        // The training paused for an hour between two epochs.
        assert_eq!(lasted(&[1_000, 3_000, 3_603_000, 3_605_000]), Some(8.0));
        assert_eq!(lasted(&[1_000]), None);
        assert_eq!(lasted(&[]), None);
        // A clock that was set back gives a duration of 0.
        assert_eq!(lasted(&[5_000, 1_000]), Some(0.0));
    }

    #[test]
    fn what_comes_after_the_training_grows_with_the_archive() {
        let made = |made_ms, individuals| TaxonomyVersion {
            version: 1,
            stands: true,
            made_ms,
            checkpoint: None,
            rounds: 1,
            generations: 1,
            individuals,
        };
        assert_eq!(until_made(10_000, &made(Some(70_000), 100), 150), Some(90.0));
        assert_eq!(until_made(70_000, &made(Some(10_000), 0), 150), Some(0.0));
        assert_eq!(until_made(70_000, &made(None, 100), 150), None);
    }

    #[test]
    fn the_last_round_says_how_long_the_next_takes() {
        let whole = Estimate {
            training: 100.0,
            after: Some(500.0),
        };
        assert_eq!(
            whole.in_words(),
            "As long as the last round: about 10 minutes, with about 2 minutes of training, and about 9 minutes to embed, search and \
             cluster."
        );
        let cut = Estimate { after: None, ..whole };
        assert!(
            cut.in_words().contains("the training takes about 2 minutes"),
            "{}",
            cut.in_words()
        );
    }
}

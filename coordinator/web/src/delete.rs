//! Deleting a campaign: the page first lists the data that would be deleted.

use super::{Web, asked::Form, layout::layout, of_campaign::OfCampaign, page_error::PageError, parts};
use axum::{
    extract::{Path, State},
    response::Redirect,
};
use maud::{Markup, html};
use murmuration_model::{CampaignRecord, CampaignState, study_name};
use murmuration_store::Deletion;
use serde::Deserialize;

pub(super) async fn page(OfCampaign { web, record, visitor }: OfCampaign) -> Result<Markup, PageError> {
    let deletion = web.campaigns.deletion(&record.id).await?;
    Ok(layout(
        "Delete a campaign",
        &visitor,
        question(&record, &deletion),
    ))
}

/// The question on the page: the data that would be deleted, and the button. If the campaign belongs to a study, its form names
/// the study, because the deletion requires this name.
fn question(record: &CampaignRecord, deletion: &Deletion) -> Markup {
    let id = record.id.as_str();
    html! {
        h1 { "Delete " (id) "?" }
        @if record.state == CampaignState::Running {
            p.lead { "This campaign is running. Cancel it first." }
        } @else {
            p.lead {
                "This deletes " (deletion.in_words()) ". It cannot be undone. Checkpoints stay. To keep a copy, export the campaign first."
            }
            @if let Some(study) = &record.study {
                p {
                    "The campaign belongs to the study " strong { (study.as_str()) } ". What the study has measured of it stays. If it has not "
                    "been measured yet, the next " code { "murmuration lab study run" } " runs it again from the beginning."
                }
            }
            form method="post" action={ "/campaigns/" (id) "/delete" } {
                @if let Some(study) = &record.study { input type="hidden" name="study" value=(study.as_str()); }
                button.danger #delete { "Delete the campaign" }
            }
        }
        p { a href={ "/campaigns/" (id) } { "Back to the campaign" } " · " a href="/" { "All campaigns" } }
    }
}

/// The fields of the form that deletes a campaign.
#[derive(Debug, Deserialize)]
pub(super) struct Named {
    /// The study that the campaign belongs to; empty if the campaign belongs to no study.
    #[serde(default)]
    study: String,
}

pub(super) async fn delete(
    State(web): State<Web>,
    Path(id): Path<String>,
    Form(named): Form<Named>,
) -> Result<Redirect, PageError> {
    let study = study_name(named.study)?;
    web.campaigns.delete(id.parse()?, study).await?;
    Ok(Redirect::to("/"))
}

/// The menu of a campaign that does not run: start another one like it, or delete it. The link to the page of this module does not
/// list the data, because counting them takes too long for a page that is sent after every change.
pub(super) fn menu(record: &CampaignRecord) -> Markup {
    let id = record.id.as_str();
    html! {
        @if record.state != CampaignState::Running {
            (parts::menu(id, &html! {
                a href={ "/new?from=" (id) } { "Start another with this specification" }
                a.delete href={ "/campaigns/" (id) "/delete" } { "Delete" span.unseen { " " (id) } }
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples;

    #[test]
    fn a_campaign_of_a_study_is_deleted_on_the_page_that_says_what_becomes_of_its_figures() {
        let deletion = Deletion {
            individuals: 100,
            pictures: 0,
            labelled: 3,
            taxonomy: true,
        };
        let cell = CampaignRecord {
            state: CampaignState::Completed,
            study: study_name("phase".to_owned()).unwrap(),
            ..samples::record("model = \"single-sensor\"\nmethod = \"random\"")
        };
        let page = question(&cell, &deletion).into_string();
        for expected in [
            "the study <strong>phase</strong>",
            "name=\"study\" value=\"phase\"",
            "100 individuals",
            "cannot be undone",
        ] {
            assert!(page.contains(expected), "{expected} is not in {page}");
        }
        let alone = CampaignRecord { study: None, ..cell };
        assert!(!question(&alone, &deletion).into_string().contains("study"));
    }

    #[test]
    fn a_campaign_that_runs_is_cancelled_first() {
        let running = samples::record("model = \"single-sensor\"\nmethod = \"random\"");
        let nothing = Deletion {
            individuals: 0,
            pictures: 0,
            labelled: 0,
            taxonomy: false,
        };
        let page = question(&running, &nothing).into_string();
        assert!(
            page.contains("Cancel it first.") && !page.contains("<form"),
            "{page}"
        );
        assert!(menu(&running).into_string().is_empty());
    }
}

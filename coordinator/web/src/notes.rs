//! The tags and the note of a campaign: chips that filter the list of campaigns, and the form that changes both.

use super::{Web, asked::Form, found::Wanted, page_error::PageError};
use axum::{
    extract::{Path, State},
    response::Redirect,
};
use maud::{Markup, html};
use murmuration_model::{CampaignRecord, Note, NotesChange, Tag, Tags};
use serde::Deserialize;
use std::collections::BTreeSet;

/// The characters of tags, and those between them, as browsers check them before they send the form.
const PATTERN: &str = r"[\p{L}\p{N}\-_.:,\s]*";

/// Links to the lists of campaigns with these tags, which are otherwise as `wanted`.
pub(super) fn chips(tags: &Tags, wanted: &Wanted) -> Markup {
    let list = |tag: &Tag| {
        let wanted = Wanted {
            tag: tag.to_string(),
            ..wanted.clone()
        };
        wanted.address("/", 0)
    };
    html! {
        @if !tags.is_empty() {
            ul.tags aria-label="Tags" { @for tag in tags.iter() { li { a.tag href=(list(tag)) { (tag) } } } }
        }
    }
}

/// The tags and the note on a campaign's page, with the form that changes them.
pub(super) fn section(record: &CampaignRecord) -> Markup {
    let notes = &record.notes;
    html! {
        section.notes aria-label="Tags and note" {
            (chips(&notes.tags, &Wanted::default()))
            @if !notes.note.as_str().is_empty() { p.note { (notes.note.as_str()) } }
            details {
                summary { "Change tags and note" }
                form #notes method="post" action={ "/campaigns/" (record.id) "/notes" } {
                    input type="hidden" name="former" value=(notes.tags);
                    input type="hidden" name="former_note" value=(notes.note.as_str());
                    label for="tags" { "Tags" }
                    input #tags name="tags" value=(notes.tags) pattern=(PATTERN) autocomplete="off" spellcheck="false" aria-describedby="tags-hint"
                        title="Letters, digits, and the characters - _ . : within a word";
                    p.reason #tags-hint { "At most " (Tags::MOST) " words of at most " (Tag::MOST) " characters, with spaces between them." }
                    label for="note" { "Note" }
                    textarea #note name="note" rows="4" maxlength=(Note::MOST) { (notes.note.as_str()) }
                    button { "Save" }
                }
            }
        }
    }
}

/// The form's fields.
#[derive(Debug, Deserialize)]
pub(super) struct Noted {
    /// The tags and the note that the page showed. The request changes only what the person changed, so that what others have
    /// written since stays.
    former: String,
    former_note: String,
    tags: String,
    note: String,
}

impl TryFrom<Noted> for NotesChange {
    type Error = PageError;

    fn try_from(noted: Noted) -> Result<Self, PageError> {
        let [former, wanted] = [&noted.former, &noted.tags].map(|tags| tags.parse::<Tags>());
        let [former, wanted]: [BTreeSet<Tag>; 2] =
            [former?, wanted?].map(|tags| tags.iter().cloned().collect());
        let [former_note, note] = [&noted.former_note, &noted.note].map(|note| note.parse::<Note>());
        let (former_note, note) = (former_note?, note?);
        Ok(Self {
            add: &wanted - &former,
            remove: &former - &wanted,
            note: (note != former_note).then_some(note),
            former_note: Some(former_note),
        })
    }
}

pub(super) async fn change(
    State(web): State<Web>,
    Path(id): Path<String>,
    Form(noted): Form<Noted>,
) -> Result<Redirect, PageError> {
    let noted = web.campaigns.note(&id, noted.try_into()?).await?;
    Ok(Redirect::to(&format!("/campaigns/{}", noted.record.id)))
}

//! The page of a campaign's classes: people rename, merge, colour and delete classes, give keys to classes, and undo changes.

use super::{
    Web, keys,
    layout::{Part, campaign_page},
    of_campaign::OfCampaign,
    page_error::{PageError, Refused},
    parts,
};
use axum::{
    Json,
    extract::{Path, State},
};
use maud::{Markup, html};
use murmuration_engine::blocking::in_background;
use murmuration_model::{
    Timestamp,
    labels::{Action, Answer, ClassName, Labels, Shortcut},
};
use murmuration_proto::v1::{self, change_class_request::Change, label_service_server::LabelService as _};
use murmuration_service::OrStatus as _;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use tonic::Request;

/// Maximum number of pictures in the row of a class.
const PICTURES: usize = 6;
/// Maximum number of changes on the page.
const CHANGES: usize = 20;

const KEYS: [(&str, &str); 3] = [
    ("Tab", "go from class to class and from button to button"),
    ("Enter", "in the field of a new class: add it"),
    ("Escape", "in a dialog: go back without a change"),
];

pub(super) async fn page(OfCampaign { record, visitor, .. }: OfCampaign) -> Result<Markup, PageError> {
    let keys: Vec<String> = Shortcut::all().map(|key| key.to_string()).collect();
    let content = html! {
        div.wide-bar {
            h1 { "Classes" }
            (keys::fixed(&KEYS))
            form.naming.once-named.scripted #create {
                label { span.unseen { "New class" } input name="class" maxlength="64" autocomplete="off" placeholder="A class" required; }
                button.plain { "Add" }
            }
        }
        (parts::who())
        p.lead.once-named.scripted {
            "Changes on this page apply to everybody. Each is an entry in the label log, and the newest can be undone."
        }
        p #status.status.once-named role="status" {}
        ul #list.class-list.once-named.scripted data-keys=(keys.join("")) {}
        p.empty hidden { "There are no classes yet. The first answer that names one creates it." }
        section #history.once-named.scripted hidden {
            h2 { "Changes" }
            ol #changes {}
        }
        dialog #change aria-labelledby="change-title" {
            h2 #change-title {}
            form method="dialog" {
                label.field { span #field-name {} }
                p #effect role="status" {}
                button.plain type="button" data-do="back" { "Go back" }
                button #agree value="yes" { "Change" }
            }
        }
    };
    Ok(campaign_page(&record, Part::Classes, &visitor, content))
}

#[derive(Debug, Serialize)]
pub(super) struct DetailsView {
    classes: Vec<NamedClassView>,
    /// The standing changes of classes, newest first.
    changes: Vec<ChangeView>,
}

#[derive(Debug, Serialize)]
struct NamedClassView {
    name: String,
    colour: String,
    shortcut: Option<String>,
    labels: u64,
    /// The annotators who named the class.
    people: BTreeSet<String>,
    /// Some individuals of the class.
    individuals: BTreeSet<u64>,
}

#[derive(Debug, Serialize)]
struct ChangeView {
    /// Number of the entry in the label log.
    entry: u64,
    annotator: String,
    /// The time of the change, in the format of RFC 3339.
    time: String,
    description: String,
}

pub(super) async fn details(
    State(web): State<Web>,
    Path(campaign): Path<String>,
) -> Result<Json<DetailsView>, Refused> {
    let labels = web.store.run(move |store| store.labels_of(&campaign)).await;
    let labels = labels.or_status()?;
    let told = in_background(move |_| told(&labels)).await.or_status()?;
    Ok(Json(told))
}

/// The annotators who named a class, and some of its individuals.
#[derive(Default)]
struct Named {
    people: BTreeSet<String>,
    individuals: BTreeSet<u64>,
}

fn told(labels: &Labels) -> DetailsView {
    let mut named: BTreeMap<ClassName, Named> = BTreeMap::new();
    for label in labels.standing() {
        if let Answer::Class(class) = label.answer {
            let named = named.entry(class).or_default();
            named.people.insert(label.annotator.to_string());
            if named.individuals.len() < PICTURES {
                named.individuals.insert(label.index);
            }
        }
    }
    let classes = labels.classes().into_iter().map(|class| {
        let Named { people, individuals } = named.remove(&class.name).unwrap_or_default();
        NamedClassView {
            name: class.name.to_string(),
            colour: class.colour.to_string(),
            shortcut: class.shortcut.map(|key| key.to_string()),
            labels: class.labels,
            people,
            individuals,
        }
    });
    let classes = classes.collect();
    let changes = labels.class_changes().rev().take(CHANGES);
    let changes = changes.map(|(entry, change)| ChangeView {
        entry,
        annotator: change.annotator.to_string(),
        time: Timestamp::from_ms(change.time_ms).to_string(),
        description: describe(&change.action),
    });
    DetailsView {
        classes,
        changes: changes.collect(),
    }
}

/// A change of a class as a phrase that follows the annotator's name.
fn describe(action: &Action) -> String {
    match action {
        Action::Create { class } => format!("added “{}”", class.shown()),
        Action::Rename { class, to } => format!("renamed “{}” to “{}”", class.shown(), to.shown()),
        Action::Merge { class, into } => format!("merged “{}” into “{}”", class.shown(), into.shown()),
        Action::Colour { class, colour } => format!("gave “{}” the colour {colour}", class.shown()),
        Action::Delete { class } => format!("deleted “{}”", class.shown()),
        Action::Shortcut { class, shortcut } => match shortcut {
            Some(key) => format!("gave “{}” the key {key}", class.shown()),
            None => format!("took the chosen key of “{}” away", class.shown()),
        },
        Action::Answer { .. } | Action::Undo | Action::Withdraw { .. } | Action::Revert { .. } => {
            String::new()
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Changed {
    request_id: String,
    annotator: String,
    change: Wanted,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Wanted {
    Create { class: String },
    Rename { class: String, to: String },
    Merge { class: String, into: String },
    Colour { class: String, colour: String },
    Shortcut { class: String, shortcut: String },
    Delete { class: String },
    Revert { entry: u64 },
}

/// Changes a class, and responds with the data of [`details`].
pub(super) async fn change(
    State(web): State<Web>,
    Path(campaign): Path<String>,
    Json(posted): Json<Changed>,
) -> Result<Json<DetailsView>, Refused> {
    let change = match posted.change {
        Wanted::Create { class } => Change::Create(v1::CreateClass { class }),
        Wanted::Rename { class, to } => Change::Rename(v1::RenameClass { class, to }),
        Wanted::Merge { class, into } => Change::Merge(v1::MergeClass { class, into }),
        Wanted::Colour { class, colour } => Change::Colour(v1::ColourClass { class, colour }),
        Wanted::Shortcut { class, shortcut } => Change::Shortcut(v1::ShortcutClass { class, shortcut }),
        Wanted::Delete { class } => Change::Delete(v1::DeleteClass { class }),
        Wanted::Revert { entry } => Change::Revert(v1::RevertChange { entry }),
    };
    let request = v1::ChangeClassRequest {
        campaign: campaign.clone(),
        request_id: posted.request_id,
        annotator: posted.annotator,
        change: Some(change),
    };
    web.labels.change_class(Request::new(request)).await?;
    details(State(web), Path(campaign)).await
}

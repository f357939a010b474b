//! The page that starts a campaign from fields, from a campaign file, as a copy of another campaign, or from an example. The page
//! shows the cost before the start.

mod draft;
mod every_field;
mod fields;
mod problems;
mod view;

use super::{
    Web,
    asked::{Form, Query},
    of_campaign::page_of,
    page_error::PageError,
    visitor::Visitor,
};
use axum::{
    extract::State,
    response::{IntoResponse, Response},
};
use draft::Draft;
use murmuration_model::{NewCampaign, labels::RequestId};
use murmuration_swarm::CampaignSpec;
use std::{
    hash::{DefaultHasher, Hash as _, Hasher as _},
    sync::atomic::{AtomicU64, Ordering},
    time::{SystemTime, UNIX_EPOCH},
};

/// The fields of a form or of an address; a name can occur more than once.
type Parameters = Vec<(String, String)>;

/// The value of a field; empty if it is missing.
fn given<'a>(parameters: &'a Parameters, name: &str) -> &'a str {
    let found = parameters.iter().find(|(known, _)| known == name);
    found.map_or("", |(_, value)| value)
}

/// The page with the initial draft, with an example, with described robots, or with another campaign's specification.
pub(super) async fn page(
    State(web): State<Web>,
    Query(parameters): Query<Parameters>,
    visitor: Visitor,
) -> Result<Response, PageError> {
    let names = ["from", "example", "robot"];
    let draft = match names.map(|name| given(&parameters, name)) {
        ["", "", ""] => Draft::usual(),
        ["", "", robots] => Draft::with_robots(robots),
        ["", example, _] => Draft::example(example)?,
        [id, ..] => Draft::copy(&web.campaigns.status(id).await?.record.spec),
    };
    let draft = match given(&parameters, "as") {
        "file" => draft.into_file(),
        _ => draft,
    };
    Ok(view::page(&draft, &token(), false, &visitor).into_response())
}

/// Handles the submitted form: shows the cost, switches between fields and file, or starts the campaign.
pub(super) async fn submitted(
    State(web): State<Web>,
    visitor: Visitor,
    Form(parameters): Form<Parameters>,
) -> Result<Response, PageError> {
    let draft = Draft::of_form(&parameters)?;
    let token = match given(&parameters, "request") {
        "" => self::token(),
        token => token.to_owned(),
    };
    let was_sent = ["start", "check"].contains(&given(&parameters, "step"));
    let shown = |draft: &Draft| Ok(view::page(draft, &token, was_sent, &visitor).into_response());
    match (given(&parameters, "step"), draft.checked()) {
        ("start", Ok(spec)) => {
            let request = Some(request_of(&token, &spec)?);
            let new = NewCampaign {
                request,
                ..spec.into()
            };
            let created = web.campaigns.create(new).await?;
            Ok(page_of(created.record.id.as_str()).into_response())
        }
        // The page's script requests only this part of the page.
        ("outcome", _) => Ok(view::outcome(&draft).into_response()),
        ("file", _) => shown(&draft.into_file()),
        ("fields", _) => shown(&draft.into_fields()),
        _ => shown(&draft),
    }
}

/// A token that distinguishes the pages of this process.
pub(super) fn token() -> String {
    static PAGES: AtomicU64 = AtomicU64::new(0);
    let age = SystemTime::now().duration_since(UNIX_EPOCH);
    let nanos = age.map_or(0, |age| age.as_nanos());
    format!("{nanos:x}.{:x}", PAGES.fetch_add(1, Ordering::Relaxed))
}

/// The id of a request that starts a campaign from a page. If the request is sent twice, it starts only one campaign. A changed
/// form gets a new id.
pub(super) fn request_of(token: &str, spec: &CampaignSpec) -> Result<RequestId, PageError> {
    let mut hasher = DefaultHasher::new();
    spec.to_toml().hash(&mut hasher);
    Ok(format!("page-{token}-{:x}", hasher.finish()).parse()?)
}

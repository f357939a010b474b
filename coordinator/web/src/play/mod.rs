//! The page on which people set a controller and watch the swarm that it controls.
//!
//! The address has the whole state of the page. The coordinator itself simulates the motion, one short piece at a time, and only
//! while the script waits for the piece. A worker answers "What is this like?", because the answer needs a campaign's embedder.

mod address;
mod archived;
mod around;
mod compare;
mod knobs;
mod motion;
mod timeline;
mod view;

pub(super) use address::address_of;
pub(super) use archived::pieces;
pub(super) use around::around;
pub(super) use compare::like;
pub(super) use view::SwarmView;

use super::{
    Web,
    asked::{Form, Query},
    by_example::{Asked, Example, FIELD, begin},
    page_error::{PageError, Refused},
    visitor::Visitor,
};
use address::{Address, Parameters, Play};
use axum::{
    Extension,
    extract::State,
    http::header::{CACHE_CONTROL, CONTENT_TYPE},
    response::{IntoResponse, Redirect},
};
use compare::check_cost;
use maud::Markup;
use motion::{Detail, Kept, MOST_STEPS};
use murmuration_access::Client;
use murmuration_engine::blocking::in_background;
use murmuration_model::{CampaignId, CampaignState};
use murmuration_service::OrStatus as _;
use murmuration_swarm::{Begun, CampaignSpec, Invalid};
use std::sync::Arc;
use tonic::Status;

/// Maximum number of campaigns that are offered for comparison, and of campaigns' records in memory at a time.
const OFFERED: usize = 50;

/// The latest simulated swarms. A clone is cheap.
#[derive(Debug, Clone, Default)]
pub struct Playground(Arc<Kept>);

pub(super) async fn page(
    State(web): State<Web>,
    Query(parameters): Query<Parameters>,
    visitor: Visitor,
) -> Result<Markup, PageError> {
    let address = Address::read(&parameters);
    let campaigns = match &address.play {
        Ok(play) => comparable(&web, play).await?,
        Err(_) => Vec::new(),
    };
    Ok(view::page(&address, &campaigns, &visitor))
}

/// A campaign whose individuals can be compared with a swarm.
struct Comparable {
    id: CampaignId,
    is_complete: bool,
}

/// The newest campaigns, at most [`OFFERED`], whose individuals can be compared with a swarm: completed ones first, and the newest
/// first among them.
async fn comparable(web: &Web, play: &Play) -> Result<Vec<Comparable>, PageError> {
    let heads = web.campaigns.heads().await?;
    let ids: Vec<CampaignId> = heads.into_iter().rev().map(|listed| listed.head.id).collect();
    let mut comparable = Vec::new();
    for some in ids.chunks(OFFERED) {
        let statuses = web.campaigns.statuses(some.to_vec()).await?;
        let records = statuses.into_iter().map(|status| status.record);
        let records =
            records.filter(|record| record.individuals() > 0 && compare::is_comparable(record, &play.world));
        comparable.extend(records.map(|record| Comparable {
            is_complete: record.state == CampaignState::Completed,
            id: record.id,
        }));
        if comparable.len() >= OFFERED {
            comparable.truncate(OFFERED);
            break;
        }
    }
    comparable.sort_by_key(|campaign| !campaign.is_complete);
    Ok(comparable)
}

/// A piece of the motion of the address's swarm, from the step `from` on, with its moments.
pub(super) async fn motion(
    State(web): State<Web>,
    Extension(client): Extension<Client>,
    Form(mut parameters): Form<Parameters>,
) -> Result<impl IntoResponse, Refused> {
    let first = first_step(&mut parameters)?;
    let play = strictly(&parameters)?;
    piece(web, client, play, (first, Detail::FramesAndMoments)).await
}

/// A piece of the motion of a swarm: its first step, and whether it has moments.
async fn piece(
    web: Web,
    client: Client,
    play: Play,
    wanted: (u32, Detail),
) -> Result<impl IntoResponse, Refused> {
    let simulated = in_background(move |interrupt| {
        let piece = web.play.0.piece(client, &play, wanted, interrupt)?;
        Ok::<_, Status>(piece.bytes())
    });
    let bytes = simulated.await.or_status()??;
    let headers = [
        (CONTENT_TYPE, "application/octet-stream"),
        (CACHE_CONTROL, "no-store"),
    ];
    Ok((headers, bytes))
}

fn strictly(parameters: &Parameters) -> Result<Play, Status> {
    let play = Address::read(parameters).strictly();
    play.map_err(Status::invalid_argument)
}

/// Removes the first step from the parameters, and returns it; 0 if it is missing.
fn first_step(parameters: &mut Parameters) -> Result<u32, Invalid> {
    let Some(place) = parameters.iter().position(|(name, _)| name == "from") else {
        return Ok(0);
    };
    let (_, text) = parameters.remove(place);
    let step = text.parse().ok().and_then(|from| step(from).ok());
    step.ok_or_else(|| not_a_step(format!("{text:?}")))
}

/// Checks that the first step of a piece is not over the limit.
fn step(from: u32) -> Result<u32, Invalid> {
    if from <= MOST_STEPS {
        return Ok(from);
    }
    Err(not_a_step(from.to_string()))
}

fn not_a_step(given: String) -> Invalid {
    Invalid::new("from", given, format!("a whole number from 0 to {MOST_STEPS}"))
}

/// Starts the campaign of an address of the page, a search or a sweep, and redirects to it.
pub(super) async fn search(
    State(web): State<Web>,
    Query(parameters): Query<Parameters>,
    Form(asked): Form<Asked>,
) -> Result<Redirect, PageError> {
    if parameters.is_empty() {
        return Err(Invalid::missing("address", "the address of a swarm on the page Play").into());
    }
    let play = strictly(&parameters)?;
    check_cost(&play.world)?;
    let begun = |name| Begun {
        name,
        world: &play.world,
        seed: CampaignSpec::seed_of(play.seed),
    };
    let spec = match asked.example {
        Example::Like => CampaignSpec::begun_around(&play.controller, begun("play"))?,
        Example::Sweep => CampaignSpec::sweep_around(&play.controller, begun("play-sweep"))?,
        Example::Unlike => {
            let allowed = "\"like\" or \"sweep\": the page Play has no archive";
            return Err(Invalid::new(FIELD, "\"unlike\"", allowed).into());
        }
    };
    begin(&web, spec, &asked).await
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_step_is_a_step_that_is_not_too_far() {
        let step = |text: &str| {
            let mut parameters = vec![
                ("from".to_owned(), text.to_owned()),
                ("seed".to_owned(), "2".to_owned()),
            ];
            let step = first_step(&mut parameters);
            assert_eq!(parameters.len(), 1);
            step.map_err(|error| error.to_string())
        };
        assert_eq!(step("1000000"), Ok(1_000_000));
        for bad in ["1000001", "-1", "1.5", ""] {
            let message = format!("from = {bad:?}: must be a whole number from 0 to 1000000");
            assert_eq!(step(bad), Err(message));
        }
        assert_eq!(first_step(&mut Vec::new()), Ok(0));
    }
}

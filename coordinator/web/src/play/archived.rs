//! The motion of an archived individual from its first start, one piece at a time. The coordinator simulates the motion.

use super::{
    super::{Web, page_error::Refused},
    Play,
    address::MOST_ROBOTS,
    motion::Detail,
    piece,
};
use crate::asked::Form;
use axum::{
    Extension,
    extract::{Path, State},
    response::IntoResponse,
};
use murmuration_access::Client;
use murmuration_service::OrStatus as _;
use murmuration_store::{Store, StoreError};
use murmuration_swarm::Invalid;
use serde::Deserialize;

/// Selects a piece of the motion of an individual.
#[derive(Debug, Deserialize)]
pub(in super::super) struct Wanted {
    index: u64,
    /// The first step of the piece.
    #[serde(default)]
    from: u32,
}

/// A piece of the motion of an individual, in the format of [`motion`](super::motion).
pub(in super::super) async fn pieces(
    State(web): State<Web>,
    Extension(client): Extension<Client>,
    Path(id): Path<String>,
    Form(Wanted { index, from }): Form<Wanted>,
) -> Result<impl IntoResponse, Refused> {
    let record = web.campaigns.status(&id).await.or_status()?.record;
    let world = record.spec.world().clone();
    if world.agents() > MOST_ROBOTS {
        let allowed = format!("at most {MOST_ROBOTS}: a coordinator simulates no larger swarm by itself");
        return Err(Invalid::new("world.agents", world.agents(), allowed).into());
    }
    let first = super::step(from)?;
    let read = move |store: &Store| {
        let model = record.spec.model();
        let range = index..index.saturating_add(1);
        let found = store.individuals(&record.id, model, range, false)?.pop();
        let len = record.individuals();
        found.ok_or(StoreError::NoIndividual {
            campaign: record.id.to_string(),
            index,
            len,
        })
    };
    let individual = web.store.run(read).await.or_status()?;
    let play = Play {
        controller: individual.controller,
        seed: individual.seed,
        world,
    };
    piece(web, client, play, (first, Detail::Frames)).await
}

//! The motion of an individual, for a script to draw.

use super::{Web, archived::Created, refused::Refused};
use axum::{
    Json,
    extract::{Path, Query, State},
    response::IntoResponse,
};
use murmuration_engine::blocking::blocking;
use murmuration_model::colours;
use murmuration_proto::{
    Frames, Replay,
    parts::whole,
    v1::{self, campaign_service_server::CampaignService as _},
};
use murmuration_report::picture::{Bodies, columns};
use murmuration_service::OrStatus as _;
use serde_json::json;
use std::time::Duration;
use tonic::{Request, Status};

/// Bytes of one motion, before base64.
const MOTION_BYTES: usize = 2 << 20;
/// How long a script waits for a worker; then it is told that they have other work, and may ask again.
pub(super) const REPLAY_TIMEOUT: Duration = Duration::from_secs(20);

pub(super) async fn motion(
    State(web): State<Web>,
    Path((campaign, index)): Path<(String, u64)>,
    Query(created): Query<Created>,
) -> Result<impl IntoResponse, Refused> {
    let record = web.campaigns.status(&campaign).await.or_status()?.record;
    web.archive.dispatch.check_staffed().or_status()?;
    let world = record.spec.world().clone();
    let request = v1::GetReplayRequest {
        campaign: record.id.to_string(),
        index,
        stride: Frames::to_watch(&world).stride().get(),
    };
    let replay = tokio::time::timeout(REPLAY_TIMEOUT, web.archive.get_replay(Request::new(request)));
    let late = || Status::unavailable("the workers have not simulated this yet");
    let replay = whole(replay.await.map_err(|_| late())??.into_inner()).await?;
    let (store, id, model) = (web.store.clone(), record.id.clone(), record.spec.model().clone());
    let individual = blocking(move || store.individual(&id, &model, index)).await;
    let individual = individual.or_status()?.or_status()?;
    let bodies = Bodies::of(&individual.controller, &world);
    let told = json!({
        "world": columns::world(&world),
        "colours": colours::AGENTS.map(colours::hex),
        "run": columns::motion(&Replay::try_from(replay)?, &world, bodies.colouring(), MOTION_BYTES),
    });
    Ok(([created.keep(&record)], Json(told)))
}

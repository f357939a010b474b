//! The motion of an individual: as data that a script draws, and as a download.

use super::{
    Web,
    archived::{self, Created},
    asked::Query,
    of_campaign::OfCampaign,
    page_error::{PageError, Refused},
};
use axum::{
    Json,
    extract::{Path, State},
    http::{
        HeaderName,
        header::{CONTENT_DISPOSITION, CONTENT_TYPE},
    },
    response::{IntoResponse, Redirect, Response},
};
use murmuration_engine::blocking::{blocking, in_background};
use murmuration_model::{CampaignRecord, colours};
use murmuration_proto::{
    parts::whole,
    v1::{self, campaign_service_server::CampaignService as _},
};
use murmuration_report::picture::{
    self, Animation, Bodies, Paper,
    columns::{self, MotionView, WorldView},
    trajectory_png,
};
use murmuration_service::OrStatus as _;
use murmuration_sim::{replay::replay_frames, simulate::Start};
use murmuration_store::Store;
use murmuration_swarm::{Controller, Frames, Replay};
use serde::Serialize;
use std::time::Duration;
use tonic::{Request, Status};

/// Maximum size of a motion in bytes, before base64.
const MOTION_BYTES: usize = 2 << 20;
/// Maximum time that a script waits for a worker. After that, the response is that the workers are busy, and the script can ask
/// again.
pub(super) const REPLAY_TIMEOUT: Duration = Duration::from_secs(20);

/// An individual simulated again by a worker.
struct Simulated {
    record: CampaignRecord,
    controller: Controller,
    replay: Replay,
}

async fn simulated(web: &Web, campaign: &str, index: u64) -> Result<Simulated, Status> {
    let record = web.campaigns.status(campaign).await.or_status()?.record;
    web.archive.dispatch.check_staffed().or_status()?;
    let request = v1::GetReplayRequest {
        campaign: record.id.to_string(),
        index,
        stride: Frames::to_watch(record.spec.world()).stride().get(),
    };
    let replay = tokio::time::timeout(REPLAY_TIMEOUT, web.archive.get_replay(Request::new(request)));
    let late = || Status::unavailable("the workers have not simulated this yet");
    let replay = whole(replay.await.map_err(|_| late())??.into_inner()).await?;
    let (id, model) = (record.id.clone(), record.spec.model().clone());
    let read = move |store: &Store| store.individual(&id, &model, index);
    Ok(Simulated {
        controller: web.store.run(read).await.or_status()?.controller,
        replay: Replay::try_from(replay)?,
        record,
    })
}

/// Data from which a script draws a motion.
#[derive(Debug, Serialize)]
struct IndividualView {
    world: WorldView,
    /// The colours from which agents, or species if there are several, get their colour.
    colours: Vec<String>,
    run: MotionView,
}

pub(super) async fn motion(
    State(web): State<Web>,
    Path((campaign, index)): Path<(String, u64)>,
    Query(created): Query<Created>,
) -> Result<impl IntoResponse, Refused> {
    let Simulated {
        record,
        controller,
        replay,
    } = simulated(&web, &campaign, index).await?;
    let world = record.spec.world();
    let bodies = Bodies::of(&controller, world);
    let view = IndividualView {
        world: world.into(),
        colours: colours::AGENTS.map(colours::hex).to_vec(),
        run: columns::motion(&replay, world, bodies.colouring(), MOTION_BYTES),
    };
    Ok(([created.keep(&record)], Json(view)))
}

/// The whole motion as an animated GIF to download. The response to an error is a page.
pub(super) async fn gif(
    State(web): State<Web>,
    Path((campaign, index)): Path<(String, u64)>,
    Query(created): Query<Created>,
) -> Result<impl IntoResponse, PageError> {
    let simulated = simulated(&web, &campaign, index).await?;
    let headers = file(&simulated.record, index, "image/gif", "gif", &created);
    let drawn = blocking(move || {
        let world = simulated.record.spec.world();
        let bodies = Bodies::of(&simulated.controller, world);
        picture::animation_gif(
            &simulated.replay,
            world,
            bodies.colouring(),
            &Animation::default(),
        )
    });
    Ok((headers, drawn.await??))
}

/// Maximum number of robot steps that this process simulates for a picture of paths: those of 20 swarms of the paper, which take
/// some 50 ms.
const MOST_STEPS: u64 = 20 * 24 * 1200;
/// Maximum number of robots of such a swarm: the time of a step grows with the square of this number.
const MOST_ROBOTS: u32 = 256;
/// Side of a picture of paths, in pixels.
const PATHS_SIZE: u32 = 400;

/// The paths of the last steps as a PNG with a transparent background. This process simulates the motion, so that pages show
/// their cards while the workers are busy or gone. If the simulation would take long, redirects to the picture that is stored.
pub(super) async fn paths(
    Path((_, index)): Path<(String, u64)>,
    Query(created): Query<Created>,
    OfCampaign { web, record, .. }: OfCampaign,
) -> Result<Response, PageError> {
    let world = record.spec.world();
    let steps = u64::from(world.agents()) * u64::from(world.horizon());
    if world.agents() > MOST_ROBOTS || steps > MOST_STEPS {
        return Ok(Redirect::temporary(&archived::picture(&record, index)).into_response());
    }
    let kept = created.keep(&record);
    let (id, model) = (record.id.clone(), record.spec.model().clone());
    let read = move |store: &Store| store.individual(&id, &model, index);
    let individual = web.store.run(read).await?;
    let drawn = in_background(move |_| -> Result<Vec<u8>, PageError> {
        let (world, window) = (record.spec.world(), record.spec.image().window());
        let start = Start::seeded(individual.seed);
        let replay = replay_frames(&individual.controller, world, &start, &Frames::to_watch(world))?;
        let bodies = Bodies::of(&individual.controller, world);
        let paper = Paper::Clear;
        Ok(trajectory_png(
            &replay,
            world,
            bodies.colouring(),
            window,
            PATHS_SIZE,
            paper,
        )?)
    });
    Ok(([(CONTENT_TYPE, "image/png"), kept], drawn.await??).into_response())
}

/// The paths of the last steps, as in the picture, as an SVG to download. The response to an error is a page.
pub(super) async fn svg(
    State(web): State<Web>,
    Path((campaign, index)): Path<(String, u64)>,
    Query(created): Query<Created>,
) -> Result<impl IntoResponse, PageError> {
    let simulated = simulated(&web, &campaign, index).await?;
    let headers = file(&simulated.record, index, "image/svg+xml", "svg", &created);
    let drawn = in_background(move |_| {
        let (world, window) = (
            simulated.record.spec.world(),
            simulated.record.spec.image().window(),
        );
        let bodies = Bodies::of(&simulated.controller, world);
        picture::trajectory_svg(&simulated.replay, world, bodies.colouring(), window)
    });
    Ok((headers, drawn.await?))
}

/// The headers of a file about an individual.
fn file(
    record: &CampaignRecord,
    index: u64,
    kind: &str,
    ending: &str,
    created: &Created,
) -> [(HeaderName, String); 3] {
    let (kept, how) = created.keep(record);
    let name = format!(
        "attachment; filename=\"{}-individual-{index}.{ending}\"",
        record.id
    );
    [
        (CONTENT_TYPE, kind.to_owned()),
        (CONTENT_DISPOSITION, name),
        (kept, how.to_owned()),
    ]
}

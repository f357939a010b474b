//! Pages that follow what happens: the parts that change, sent again whenever they do.

use super::{Web, pages, wrong::Wrong};
use crate::campaign::CampaignError;
use axum::{
    extract::{Path, State},
    response::sse::{Event, KeepAlive, Sse},
};
use maud::Markup;
use std::{convert::Infallible, time::Duration};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;

/// Least time between two messages to one page.
const INTERVAL: Duration = Duration::from_millis(250);

type Events = Sse<axum::response::sse::KeepAliveStream<ReceiverStream<Result<Event, Infallible>>>>;

pub(super) async fn campaigns(State(web): State<Web>) -> Events {
    follow(move || {
        let web = web.clone();
        async move { Ok(pages::table(&web.campaigns.list().await?)) }
    })
}

pub(super) async fn campaign(State(web): State<Web>, Path(id): Path<String>) -> Result<Events, Wrong> {
    let id = web.campaigns.status(&id).await?.record.id;
    Ok(follow(move || {
        let (web, id) = (web.clone(), id.clone());
        async move {
            let status = web.campaigns.status(id.as_str()).await?;
            pages::standing(&web, &status).await
        }
    }))
}

/// Sends what `draw` makes whenever it is not what it was before, for as long as somebody listens.
fn follow<F, Drawn>(draw: F) -> Events
where
    F: Fn() -> Drawn + Send + 'static,
    Drawn: Future<Output = Result<Markup, CampaignError>> + Send,
{
    let (events, stream) = mpsc::channel(1);
    tokio::spawn(async move {
        let mut shown = String::new();
        while let Ok(part) = draw().await {
            let part = part.into_string();
            if part != shown {
                if events.send(Ok(Event::default().data(&part))).await.is_err() {
                    return;
                }
                shown = part;
            }
            tokio::select! {
                () = events.closed() => return,
                () = tokio::time::sleep(INTERVAL) => {}
            }
        }
    });
    Sse::new(ReceiverStream::new(stream)).keep_alive(KeepAlive::default())
}

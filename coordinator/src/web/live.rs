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
    let look = move || {
        let web = web.clone();
        async move { Ok(pages::table(&web.campaigns.list().await?)) }
    };
    follow(look, |table| async { Ok(table) })
}

pub(super) async fn campaign(State(web): State<Web>, Path(id): Path<String>) -> Result<Events, Wrong> {
    let id = web.campaigns.status(&id).await?.record.id;
    let (looking, looked_at) = (web.clone(), id.clone());
    let look = move || {
        let (web, id) = (looking.clone(), looked_at.clone());
        async move { Ok(pages::figures(&web.campaigns.status(id.as_str()).await?)) }
    };
    Ok(follow(look, move |_| {
        let (web, id) = (web.clone(), id.clone());
        async move {
            let status = web.campaigns.status(id.as_str()).await?;
            pages::standing(&web, &status).await
        }
    }))
}

/// Sends what `draw` makes of what `look` sees, whenever that is not what it was before, for as long as somebody listens.
fn follow<Look, Looked, Draw, Drawn>(look: Look, draw: Draw) -> Events
where
    Look: Fn() -> Looked + Send + 'static,
    Looked: Future<Output = Result<Markup, CampaignError>> + Send,
    Draw: Fn(Markup) -> Drawn + Send + 'static,
    Drawn: Future<Output = Result<Markup, CampaignError>> + Send,
{
    let (events, stream) = mpsc::channel(1);
    tokio::spawn(async move {
        let mut seen = None;
        while let Ok(sight) = look().await {
            if seen.as_ref() != Some(&sight.0) {
                seen = Some(sight.0.clone());
                let Ok(part) = draw(sight).await else { return };
                if events
                    .send(Ok(Event::default().data(part.into_string())))
                    .await
                    .is_err()
                {
                    return;
                }
            }
            tokio::select! {
                () = events.closed() => return,
                () = tokio::time::sleep(INTERVAL) => {}
            }
        }
    });
    Sse::new(ReceiverStream::new(stream)).keep_alive(KeepAlive::default())
}

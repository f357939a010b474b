//! Labels and archive as CSV, for spreadsheets and data frames.

use super::{of_campaign::OfCampaign, page_error::PageError};
use axum::{
    body::{Body, Bytes},
    http::header::{CONTENT_DISPOSITION, CONTENT_TYPE},
    response::{IntoResponse, Response},
};
use murmuration_engine::blocking::in_background;
use murmuration_export::IndividualTable;
use murmuration_model::{
    CampaignRecord,
    labels::{Labelled, to_csv},
};
use murmuration_proto::v1;
use murmuration_store::{Store, StoreError};
use std::{
    collections::{BTreeMap, BTreeSet},
    io, iter,
};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::Status;

/// Individuals read at once.
const CHUNK: u64 = 1000;

/// The answers that stand, as `murmuration labels --csv` writes them.
pub(super) async fn labels(OfCampaign { web, record, .. }: OfCampaign) -> Result<Response, PageError> {
    let (store, of) = (web.store.clone(), record.clone());
    let table = in_background(move |_| label_table(&store, &of)).await??;
    let table = table.map_err(|error| Status::internal(error.to_string()))?;
    Ok(file(&record, "labels", Body::from(table)))
}

fn label_table(store: &Store, record: &CampaignRecord) -> Result<Result<Vec<u8>, io::Error>, StoreError> {
    let model = record.spec.model();
    let labels = store.labels(&record.id)?;
    let answers: Vec<v1::Answer> = labels
        .standing()
        .filter_map(|label| v1::Label::from(label).answer)
        .collect();
    let wanted: BTreeSet<u64> = answers.iter().map(|answer| answer.index).collect();
    let found = store.measured_individuals(&record.id, model, &wanted)?;
    let individuals: BTreeMap<u64, v1::Individual> = found
        .into_iter()
        .map(|individual| (individual.index, individual.into()))
        .collect();
    let labelled = answers.iter().filter_map(|answer| {
        let individual = individuals.get(&answer.index)?;
        Some(Labelled { answer, individual })
    });
    Ok(to_csv(&record.spec, labelled).map_err(io::Error::other))
}

/// A row for each individual, as `murmuration export --csv` writes them. The table is sent while it is read.
pub(super) async fn archive(OfCampaign { web, record, .. }: OfCampaign) -> Result<Response, PageError> {
    let (parts, stream) = mpsc::channel(2);
    let (store, of) = (web.store.clone(), record.clone());
    tokio::spawn(async move {
        let sent = in_background(move |_| {
            let sent = archive_table(&store, &of, |part| parts.blocking_send(Ok(part)).is_ok());
            if let Err(error) = sent {
                // The client learns that the file is not whole, unless it is gone.
                let _ = parts.blocking_send(Err(error));
            }
        });
        let _ = sent.await;
    });
    let body = Body::from_stream(ReceiverStream::new(stream));
    Ok(file(&record, "archive", body))
}

/// Hands the table to `send` part by part, for as long as that wants more.
fn archive_table(
    store: &Store,
    record: &CampaignRecord,
    send: impl Fn(Bytes) -> bool,
) -> Result<(), io::Error> {
    let model = record.spec.model();
    let failed = io::Error::other::<StoreError>;
    let classes = store.labels(&record.id).map_err(failed)?.by_individual();
    let taxonomy = store.taxonomy(&record.id).map_err(failed)?;
    let clusters = taxonomy.map(|taxonomy| taxonomy.clusters).unwrap_or_default();
    let mut table = IndividualTable::new(Vec::new(), &record.spec);
    for first in iter::successors(Some(0), |first| Some(first + CHUNK)) {
        let individuals = store
            .individuals(&record.id, model, first..first + CHUNK, false)
            .map_err(failed)?;
        let is_last = (individuals.len() as u64) < CHUNK;
        for individual in &individuals {
            let cluster = clusters.get(individual.index as usize).copied();
            table.add(individual, cluster, classes.get(&individual.index))?;
        }
        if is_last {
            send(Bytes::from(table.finish()?));
            break;
        }
        if !send(Bytes::from(table.take_written()?)) {
            break;
        }
    }
    Ok(())
}

fn file(record: &CampaignRecord, what: &str, body: Body) -> Response {
    let name = format!("attachment; filename=\"{}-{what}.csv\"", record.id);
    let headers = [
        (CONTENT_TYPE, "text/csv; charset=utf-8".to_owned()),
        (CONTENT_DISPOSITION, name),
    ];
    (headers, body).into_response()
}

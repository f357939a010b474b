//! Downloads of labels and archive as CSV, for spreadsheets and data frames.

use super::{of_campaign::OfCampaign, page_error::PageError};
use axum::{
    body::{Body, Bytes},
    http::header::{CONTENT_DISPOSITION, CONTENT_TYPE},
    response::{IntoResponse, Response},
};
use murmuration_engine::blocking::{Broken, in_background, spawn};
use murmuration_export::IndividualTable;
use murmuration_model::{
    CampaignRecord,
    labels::{ClassName, Labelled, to_csv},
};
use murmuration_proto::v1;
use murmuration_store::{Store, StoreError};
use std::{
    collections::{BTreeMap, BTreeSet},
    io,
};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::Status;

/// Number of individuals per read of the store.
const CHUNK: u64 = 1000;

/// The standing answers, in the format of `murmuration labels --csv`.
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

/// A row for each individual, in the format of `murmuration export --csv`. The table is streamed.
pub(super) async fn archive(OfCampaign { web, record, .. }: OfCampaign) -> Result<Response, PageError> {
    let (parts, stream) = mpsc::channel(1);
    let (store, of) = (web.store.clone(), record.clone());
    spawn(async move {
        if let Err(broken) = send(store, of, &parts).await {
            // Because of this error, the client does not take the file for complete. A client that has left needs no error.
            let _ = parts.send(Err(io::Error::other(broken))).await;
        }
    });
    let body = Body::from_stream(ReceiverStream::new(stream));
    Ok(file(&record, "archive", body))
}

/// Reads and sends a table part by part, for as long as the client receives parts.
async fn send(
    store: Store,
    of: CampaignRecord,
    parts: &mpsc::Sender<io::Result<Bytes>>,
) -> Result<(), Broken> {
    let mut table = match in_background(move |_| ArchiveTable::of(store, of)).await? {
        Ok(table) => table,
        Err(error) => {
            // A client that has left needs no error.
            let _ = parts.send(Err(error)).await;
            return Ok(());
        }
    };
    while let Ok(room) = parts.reserve().await {
        let part;
        (table, part) = in_background(move |_| {
            let part = table.next();
            (table, part)
        })
        .await?;
        let Some(part) = part.transpose() else { break };
        let failed = part.is_err();
        room.send(part);
        if failed {
            break;
        }
    }
    Ok(())
}

/// The table of an archive, built part by part.
struct ArchiveTable {
    store: Store,
    record: CampaignRecord,
    classes: BTreeMap<u64, ClassName>,
    clusters: Vec<u32>,
    /// `None` after the last part.
    table: Option<IndividualTable<Vec<u8>>>,
    /// Index of the next individual.
    first: u64,
}

impl ArchiveTable {
    fn of(store: Store, record: CampaignRecord) -> io::Result<Self> {
        let failed = io::Error::other::<StoreError>;
        let taxonomy = store.taxonomy(&record.id).map_err(failed)?;
        Ok(Self {
            classes: store.labels(&record.id).map_err(failed)?.by_individual(),
            clusters: taxonomy.map(|taxonomy| taxonomy.clusters).unwrap_or_default(),
            table: Some(IndividualTable::new(Vec::new(), &record.spec)),
            first: 0,
            store,
            record,
        })
    }

    fn next(&mut self) -> io::Result<Option<Bytes>> {
        let Some(mut table) = self.table.take() else {
            return Ok(None);
        };
        let (id, model) = (&self.record.id, self.record.spec.model());
        let individuals = self
            .store
            .individuals(id, model, self.first..self.first + CHUNK, false);
        let individuals = individuals.map_err(io::Error::other)?;
        for individual in &individuals {
            let cluster = self.clusters.get(individual.index as usize).copied();
            table.add(individual, cluster, self.classes.get(&individual.index))?;
        }
        if (individuals.len() as u64) < CHUNK {
            return Ok(Some(Bytes::from(table.finish()?)));
        }
        self.first += CHUNK;
        let written = table.take_written()?;
        self.table = Some(table);
        Ok(Some(Bytes::from(written)))
    }
}

fn file(record: &CampaignRecord, what: &str, body: Body) -> Response {
    let name = format!("attachment; filename=\"{}-{what}.csv\"", record.id);
    let headers = [
        (CONTENT_TYPE, "text/csv; charset=utf-8".to_owned()),
        (CONTENT_DISPOSITION, name),
    ];
    (headers, body).into_response()
}

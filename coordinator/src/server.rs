//! The whole coordinator: starts it from its options, listens, and shuts it down cleanly.

mod endpoints;
mod services;

pub use endpoints::LocalWay;

use crate::{
    metrics::Metrics,
    probes::{Probes, Readiness},
};
use endpoints::{Opened, Served, Serving, listen, url};
use murmuration_access::{ListenConfig, LocalToken, Requirements, Seats, TlsError};
use murmuration_dispatch as dispatch;
use murmuration_dispatch::{Dispatch, PeerKind, Trainers};
use murmuration_engine::{
    blocking::blocking,
    campaign::{CampaignError, Campaigns},
    maps::Maps,
    queries::Queries,
    space::Spaces,
    synthetic::SyntheticAnnotator,
};
use murmuration_link::{AccessFile, TokenDigest, access_file_of, machine_name};
use murmuration_proto::{
    FILE_DESCRIPTORS,
    v1::{
        campaign_service_server::CampaignServiceServer, checkpoint_service_server::CheckpointServiceServer,
        evaluation_service_server::EvaluationServiceServer, label_service_server::LabelServiceServer,
        node_service_server::NodeServiceServer, study_service_server::StudyServiceServer,
        trainer_service_server::TrainerServiceServer, transfer_service_server::TransferServiceServer,
        worker_service_server::WorkerServiceServer,
    },
};
use murmuration_search::interrupt::Interrupt;
use murmuration_service::{
    CampaignApi, CheckpointApi, EvaluationApi, LabelApi, NodeApi, Recent, ScalerApi, StudyApi, TrainerApi,
    TransferApi, WorkerApi,
};
use murmuration_store::{
    DataDirectory, Store, StoreError,
    checkpoints::{CheckpointError, Checkpoints},
    kept::LatestAnswers,
    mirror::{self, MirrorError},
};
use murmuration_web::{DrawnAtlas, FurtherStarts, Measurements, Playground, Reports, Studies, Web};
use services::Services;
use std::{io, net::SocketAddr, path::PathBuf, sync::Arc, time::Duration};
use tokio::sync::{Semaphore, watch};
use tonic::server::NamedService as _;

/// Maximum wait for open streams during a clean shutdown.
const SHUTDOWN_LIMIT: Duration = Duration::from_secs(3);
/// Maximum size in bytes of the digests of archives that are kept.
const KEPT_DIGEST_BYTES: usize = 1 << 20;

/// Options of a coordinator.
#[derive(Debug)]
pub struct Options {
    /// The data directory, held by this process.
    pub data: DataDirectory,
    /// The address to listen on, and who has access.
    pub listen: ListenConfig,
    /// Whether to continue the campaigns that were running when their coordinator ended.
    pub resume: bool,
    /// The store of checkpoints: a URL, or `None` for the data directory.
    pub checkpoints: Option<String>,
    /// Whether to test the URL of the checkpoints first, because the coordinator has work that is lost if no checkpoint can be
    /// stored.
    pub tries_checkpoints: bool,
    /// Options of the dispatchers of workers and trainers.
    pub dispatch: dispatch::Options,
    /// The mirror of the data directory, if any.
    pub mirror: Option<MirrorOptions>,
    /// Why nothing can be changed, if the data directory is [a copy](murmuration_store::backup::copy_to_read) of one that cannot be
    /// written.
    pub reads_only: Option<String>,
    /// How other processes find the coordinator; `None` if only its own command uses it.
    pub publication: Option<Publication>,
}

/// Where a coordinator mirrors its data directory.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MirrorOptions {
    /// A folder, or a URL such as `s3://BUCKET/PREFIX`.
    pub location: String,
    /// Whether a data directory without a database goes on from the mirror.
    pub from_mirror: bool,
}

/// How other processes find the coordinator: by an access file in the data directory.
#[derive(Debug, Clone, Default)]
pub struct Publication {
    /// A further place for the access file.
    pub file: Option<PathBuf>,
    /// Name or address by which other machines reach this machine; by default the address to listen on or, if the coordinator
    /// listens on all addresses, the name of this machine.
    pub contact: Option<String>,
}

/// Why a coordinator could not start, or failed.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// The coordinator cannot listen on the address.
    #[error("cannot listen on {address}: {source}; `--listen` takes another address, port 0 any free port")]
    Listen {
        address: SocketAddr,
        /// Error of the system.
        source: io::Error,
    },
    /// The store cannot be used.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The coordinator's certificate cannot be used.
    #[error(transparent)]
    Certificate(#[from] TlsError),
    /// The store of checkpoints cannot be used.
    #[error(transparent)]
    Checkpoints(#[from] CheckpointError),
    /// The mirror cannot be used.
    #[error(transparent)]
    Mirror(#[from] MirrorError),
    /// Campaigns could not be resumed.
    #[error(transparent)]
    Campaign(#[from] CampaignError),
    /// The network server failed.
    #[error("the server broke off: {0}")]
    Transport(#[from] tonic::transport::Error),
    /// The reflection service could not read our own descriptors (a bug).
    #[error("the reflection service cannot start: {0}")]
    Reflection(#[from] tonic_reflection::server::Error),
}

/// A running coordinator. [`Coordinator::shutdown`] ends it cleanly; dropping it ends it abruptly.
#[derive(Debug)]
pub struct Coordinator {
    address: SocketAddr,
    is_encrypted: bool,
    local: LocalWay,
    published: Option<AccessFile>,
    requirements: Requirements,
    campaigns: Campaigns,
    dispatch: Dispatch,
    trainers: Trainers,
    readiness: Readiness,
    /// The flag that ends all computations of this process.
    interrupt: Interrupt,
    /// The seats of requests. Closing the seats ends the answers and streams in progress.
    seats: Seats,
    stop: watch::Sender<bool>,
    servers: Vec<Serving>,
    /// Closed before the data directory is given back.
    store: ClosedOnDrop,
    /// Held for as long as the server runs.
    data: DataDirectory,
}

/// Closes the store when it is dropped: tasks that have not ended yet must change nothing more then.
#[derive(Debug)]
struct ClosedOnDrop(Store);

impl Drop for ClosedOnDrop {
    fn drop(&mut self) {
        self.0.close();
    }
}

/// Opens the database and the checkpoints of `options`. From then on, changes and checkpoints go to the mirror too, if `options` name one.
async fn open_data(options: Options) -> Result<(Options, ClosedOnDrop, Checkpoints), ServerError> {
    // The data directory's own folder is not tested: its disk may be full for now, and campaigns wait for free space. What can be
    // refused is refused before the mirror is claimed, which ends the coordinator that has it.
    if let Some(location) = options
        .checkpoints
        .as_deref()
        .filter(|_| options.tries_checkpoints)
    {
        Checkpoints::try_out(options.data.path(), location).await?;
    }
    let claimed = match &options.mirror {
        Some(mirror) => Some(mirror::claim(&options.data, &mirror.location, mirror.from_mirror).await?),
        None => None,
    };
    // Opening can take long if the database has an older schema, and a signal may end it.
    let open = move || {
        let store = match &claimed {
            Some(claimed) => Store::open_claimed(&options.data, claimed),
            None => Store::open(&options.data),
        };
        (store, claimed, options)
    };
    let (store, claimed, options) = blocking(open).await.map_err(StoreError::from)?;
    let mut store = ClosedOnDrop(store?);
    if let Some(reason) = &options.reads_only {
        store.0 = store.0.clone().reading_only(reason);
    }
    let mut mirrored_checkpoints = None;
    if let Some(claimed) = claimed {
        mirrored_checkpoints = Some(claimed.checkpoints());
        store.0 = store.0.clone().mirrored(claimed).await?;
    }
    let mut checkpoints = Checkpoints::open(
        store.0.clone(),
        options.data.path(),
        options.checkpoints.as_deref(),
    )?;
    if let (Some(mirror), None) = (mirrored_checkpoints, &options.checkpoints) {
        checkpoints = checkpoints.mirrored(mirror).await?;
    }
    Ok((options, store, checkpoints))
}

impl Coordinator {
    /// Opens the store, listens, and serves.
    ///
    /// # Errors
    /// See [`ServerError`].
    pub async fn start(options: Options) -> Result<Self, ServerError> {
        options.check_access_files()?;
        let (listener, address) = listen(options.listen.address()).await?;
        let (options, closed_on_drop, checkpoints) = open_data(options).await?;
        let store = closed_on_drop.0.clone();
        match checkpoints.verify().await {
            // The coordinator that had the mirror has ended: all other campaigns can go on.
            Err(damaged @ CheckpointError::Damaged { .. }) if options.mirror.is_some() => {
                tracing::error!("{damaged}")
            }
            verified => verified?,
        }
        let metrics = Metrics::new();
        let quarantined = store.quarantined()?;
        let dispatch = Dispatch::start(
            options.dispatch,
            metrics.dispatch(PeerKind::Worker),
            quarantined.clone(),
        );
        let trainers = Trainers::start(options.dispatch, metrics.dispatch(PeerKind::Trainer), quarantined);
        let interrupt = Interrupt::default();
        // Questions and maps share these behaviour spaces of archives.
        let spaces = Spaces::new(store.clone());
        let queries = Queries::new(store.clone(), spaces.clone(), interrupt.clone());
        let annotator = SyntheticAnnotator {
            store: store.clone(),
            queries: queries.clone(),
            dispatch: dispatch.clone(),
        };
        let campaigns = Campaigns::new(
            trainers.clone(),
            checkpoints.clone(),
            annotator.clone(),
            metrics.campaigns(),
            interrupt.clone(),
        );

        let reflection = tonic_reflection::server::Builder::configure()
            .register_encoded_file_descriptor_set(FILE_DESCRIPTORS)
            .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
            .build_v1()?;
        let seats = options.listen.seats().clone();
        let campaign_api = CampaignApi {
            campaigns: campaigns.clone(),
            store: store.clone(),
            dispatch: dispatch.clone(),
            queries: queries.clone(),
            digests: LatestAnswers::within(KEPT_DIGEST_BYTES),
            watched: Recent::default(),
        };
        // gRPC and pages share this API, so that no two windows get the same question.
        let label_api = LabelApi {
            store: store.clone(),
            queries,
            annotator,
        };
        let web = Web {
            campaigns: campaigns.clone(),
            store: store.clone(),
            maps: Maps::new(spaces, interrupt.clone()),
            archive: campaign_api.clone(),
            labels: label_api.clone(),
            play: Playground::default(),
            studies: Studies::of(&store),
            reports: Reports::default(),
            sights: Recent::default(),
            heads: Recent::default(),
            scalars: Recent::default(),
            atlas: DrawnAtlas::default(),
            measured: Measurements::default(),
            starts: FurtherStarts::default(),
        };
        let readiness = Readiness::default();
        let names = [
            CampaignServiceServer::<CampaignApi>::NAME,
            WorkerServiceServer::<WorkerApi>::NAME,
            TrainerServiceServer::<TrainerApi>::NAME,
            CheckpointServiceServer::<CheckpointApi>::NAME,
            EvaluationServiceServer::<EvaluationApi>::NAME,
            LabelServiceServer::<LabelApi>::NAME,
            TransferServiceServer::<TransferApi>::NAME,
            StudyServiceServer::<StudyApi>::NAME,
            NodeServiceServer::<NodeApi>::NAME,
        ];
        let health = readiness.service(&names).await;
        let probes = Probes {
            readiness: readiness.clone(),
            metrics,
            campaigns: campaigns.clone(),
            store: store.clone(),
            seats: seats.clone(),
        };
        let services = Services {
            campaigns: campaign_api,
            studies: StudyApi { store: store.clone() },
            nodes: NodeApi {
                campaigns: campaigns.clone(),
            },
            scaler: ScalerApi {
                campaigns: campaigns.clone(),
            },
            transfers: TransferApi {
                campaigns: campaigns.clone(),
                store: store.clone(),
                checkpoints: checkpoints.clone(),
                data: options.data.path().into(),
                exports: Arc::new(Semaphore::new(TransferApi::MOST_EXPORTS)),
            },
            evaluations: EvaluationApi {
                dispatch: dispatch.clone(),
                checkpoints: checkpoints.clone(),
            },
            checkpoints: CheckpointApi {
                checkpoints,
                trainers: trainers.clone(),
            },
            labels: label_api,
            workers: WorkerApi {
                dispatch: dispatch.clone(),
            },
            trainers: TrainerApi {
                trainers: trainers.clone(),
                store,
            },
        };
        let services = services
            .routes()
            .service(health, services::HEALTH)
            .service(reflection, services::REFLECTION);
        let routes = murmuration_web::routes(services, web, probes.routes());
        let requirements = routes.requirements().clone();
        let (stop, stopped) = watch::channel(false);
        let served = Served {
            routes,
            seats: seats.clone(),
            stopped,
        };
        if options.resume {
            // Clients that connect meanwhile wait: they would be told that their campaigns are interrupted.
            campaigns.resume_interrupted().await?;
            let (campaigns, mut stopped) = (campaigns.clone(), stop.subscribe());
            tokio::spawn(async move {
                tokio::select! {
                    // A dropped sender also stops the watch.
                    _ = stopped.wait_for(|&stopped| stopped) => {}
                    () = campaigns.watch_quarantine() => {}
                }
            });
        }
        let Opened {
            local,
            servers,
            published,
        } = served.open(listener, &options).await?;
        // A command on another machine that finds the lock reads the access file.
        if let Some(access) = &published {
            options.write_access_files(access)?;
        }
        options
            .data
            .announce(&local.url, &machine_name().unwrap_or_default())?;
        readiness.set(true).await;
        Ok(Self {
            address,
            is_encrypted: options.listen.is_encrypted(),
            local,
            published,
            requirements,
            campaigns,
            dispatch,
            trainers,
            readiness,
            interrupt,
            seats,
            stop,
            servers,
            store: closed_on_drop,
            data: options.data,
        })
    }

    /// Returns, with the reason, when another process has taken the data directory over, or has gone on from the mirror: this
    /// coordinator can change nothing then.
    pub fn taken_over(&self) -> impl Future<Output = StoreError> + use<> {
        let (data, store) = (self.data.taken_over(), self.store.0.clone());
        async move {
            tokio::select! {
                reason = data => reason,
                reason = store.mirror_taken_over() => reason,
            }
        }
    }

    /// The address on which the coordinator listens.
    #[must_use]
    pub const fn address(&self) -> SocketAddr {
        self.address
    }

    /// The coordinator's URL, for clients and workers.
    #[must_use]
    pub fn url(&self) -> String {
        url(self.address, self.is_encrypted)
    }

    /// Access to the coordinator for processes of this machine.
    #[must_use]
    pub const fn local(&self) -> &LocalWay {
        &self.local
    }

    /// The contents of the coordinator's access file, if it has one.
    #[must_use]
    pub const fn published(&self) -> Option<&AccessFile> {
        self.published.as_ref()
    }

    /// Requirements for each page and gRPC method of this coordinator.
    #[must_use]
    pub const fn requirements(&self) -> &Requirements {
        &self.requirements
    }

    /// Stops the searches between two commits, and all other computations. Running campaigns stay running in the store.
    pub(crate) async fn stop_searches(&self) {
        self.readiness.set(false).await;
        self.interrupt.raise();
        self.store.0.end_waits_for_mirror();
        self.campaigns.stop().await;
    }

    /// Stops the searches between two commits, then the server. Running campaigns stay running in the store.
    ///
    /// # Errors
    /// If the server failed earlier.
    pub async fn shutdown(mut self) -> Result<(), ServerError> {
        self.stop_searches().await;
        self.dispatch.stop().await;
        self.trainers.stop().await;
        self.seats.close();
        self.stop.send_replace(true);
        let end = tokio::time::Instant::now() + SHUTDOWN_LIMIT;
        for server in &mut self.servers {
            match tokio::time::timeout_at(end, &mut *server).await {
                Ok(Ok(ended)) => ended?,
                // A panic is in the log already. Streams that are open after the limit are cut.
                Ok(Err(_)) | Err(_) => server.abort(),
            }
        }
        self.store.0.finish_mirror().await;
        Ok(())
    }
}

impl Options {
    /// The places of the access file, with the owner of the access files that may be replaced there. No other coordinator uses the
    /// data directory, so its own access file may be replaced whatever its owner. A coordinator that goes on from a mirror replaces the
    /// access file of the former coordinator, which had another data directory.
    fn access_files(&self) -> Result<Vec<(PathBuf, Option<TokenDigest>)>, StoreError> {
        let Some(publication) = &self.publication else {
            return Ok(Vec::new());
        };
        let owner = LocalToken::of(self.data.path())?.token().digest();
        let goes_on = self.mirror.as_ref().is_some_and(|mirror| mirror.from_mirror);
        let owner = (!goes_on).then_some(owner);
        let of_user = publication.file.clone().map(|path| (path, owner));
        let own = (access_file_of(self.data.path()), None);
        Ok(of_user.into_iter().chain([own]).collect())
    }

    fn check_access_files(&self) -> Result<(), StoreError> {
        let files = self.access_files()?;
        files.iter().try_for_each(|(path, owner)| {
            let writable = AccessFile::expect_writable(path, *owner);
            writable.map_err(|error| StoreError::from_io(error, "write the access file", path))
        })
    }

    fn write_access_files(&self, access: &AccessFile) -> Result<(), StoreError> {
        let files = self.access_files()?;
        files.iter().try_for_each(|(path, owner)| {
            let written = access.write(path, *owner);
            written.map_err(|error| StoreError::from_io(error, "write the access file", path))
        })
    }
}

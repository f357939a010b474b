//! The coordinator as a whole: options in, a listening server out, a clean end.

use crate::{
    campaign::{CampaignError, Campaigns},
    checkpoints::{CheckpointError, Checkpoints},
    dispatch::{self, Dispatch, Trainers},
    maps::Maps,
    queries::Queries,
    service::{self, CampaignApi, CheckpointApi, LabelApi, TrainerApi, WorkerApi},
    store::{DataDirectory, Store, StoreError},
    synthetic::SyntheticAnnotator,
    web::{self, Web},
};
use murmuration_proto::{
    FILE_DESCRIPTORS,
    v1::{
        campaign_service_server::CampaignServiceServer, checkpoint_service_server::CheckpointServiceServer,
        label_service_server::LabelServiceServer, trainer_service_server::TrainerServiceServer,
        worker_service_server::WorkerServiceServer,
    },
};
use std::{io, net::SocketAddr, time::Duration};
use tokio::{net::TcpListener, sync::oneshot, task::JoinHandle};
use tokio_stream::wrappers::TcpListenerStream;
use tonic::{service::Routes, transport::Server};

/// Largest message taken from a worker: a full batch of the largest pictures.
const MAX_WORKER_MESSAGE: usize = 96 << 20;
/// How long a clean end may wait for open streams.
const SHUTDOWN_LIMIT: Duration = Duration::from_secs(5);

/// What a coordinator needs to know.
#[derive(Debug)]
pub struct Options {
    /// The data directory, held by this process.
    pub data: DataDirectory,
    /// Where to listen; port 0 takes a free one.
    pub listen: SocketAddr,
    /// Whether to continue the campaigns that were running when their coordinator ended.
    pub resume: bool,
    /// Where checkpoints are kept: a URL, or `None` for the data directory.
    pub checkpoints: Option<String>,
    /// How workers and trainers are treated.
    pub dispatch: dispatch::Options,
}

/// Why a coordinator could not start, or broke.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// The address cannot be listened on.
    #[error("cannot listen on {address}: {source}; `--listen` takes another address, port 0 any free port")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// What the system said.
        source: io::Error,
    },
    /// The store cannot be used.
    #[error("{0}")]
    Store(#[from] StoreError),
    /// Checkpoints cannot be kept where they should be.
    #[error("{0}")]
    Checkpoints(#[from] CheckpointError),
    /// Campaigns could not be resumed.
    #[error("{0}")]
    Campaign(#[from] CampaignError),
    /// The network side broke.
    #[error("the server broke off: {0}")]
    Transport(#[from] tonic::transport::Error),
    /// The reflection service could not read our own descriptors (a bug).
    #[error("the reflection service cannot start: {0}")]
    Reflection(#[from] tonic_reflection::server::Error),
}

/// A running coordinator. Dropping it ends it roughly; [`Coordinator::shutdown`] ends it cleanly.
#[derive(Debug)]
pub struct Coordinator {
    address: SocketAddr,
    campaigns: Campaigns,
    dispatch: Dispatch,
    trainers: Trainers,
    stop: Option<oneshot::Sender<()>>,
    server: JoinHandle<Result<(), tonic::transport::Error>>,
    /// Held for as long as the server runs.
    _data: DataDirectory,
}

impl Coordinator {
    /// Opens the store, listens, and serves.
    ///
    /// # Errors
    /// See [`ServerError`].
    pub async fn start(options: Options) -> Result<Self, ServerError> {
        let listen_error = |source| ServerError::Listen {
            address: options.listen,
            source,
        };
        let listener = TcpListener::bind(options.listen).await.map_err(listen_error)?;
        let address = listener.local_addr().map_err(listen_error)?;
        let store = Store::open(&options.data)?;
        let checkpoints =
            Checkpoints::open(store.clone(), options.data.path(), options.checkpoints.as_deref())?;
        let dispatch = Dispatch::start(options.dispatch);
        let trainers = Trainers::start(options.dispatch);
        let queries = Queries::new(store.clone());
        let annotator = SyntheticAnnotator {
            store: store.clone(),
            queries: queries.clone(),
            dispatch: dispatch.clone(),
        };
        let campaigns = Campaigns::new(trainers.clone(), checkpoints.clone(), annotator.clone());

        let (health_reporter, health) = tonic_health::server::health_reporter();
        let reflection = tonic_reflection::server::Builder::configure()
            .register_encoded_file_descriptor_set(FILE_DESCRIPTORS)
            .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
            .build_v1()?;
        let campaign_api = CampaignApi {
            campaigns: campaigns.clone(),
            store: store.clone(),
            dispatch: dispatch.clone(),
        };
        // One for gRPC and pages: no two windows are asked the same, whichever they are of.
        let label_api = LabelApi {
            store: store.clone(),
            queries,
            annotator,
        };
        let web = Web {
            campaigns: campaigns.clone(),
            store: store.clone(),
            maps: Maps::new(store.clone()),
            archive: campaign_api.clone(),
            labels: label_api.clone(),
        };
        let campaign_service = CampaignServiceServer::new(campaign_api);
        let worker_service = WorkerServiceServer::new(WorkerApi {
            dispatch: dispatch.clone(),
        })
        .max_decoding_message_size(MAX_WORKER_MESSAGE);
        health_reporter
            .set_serving::<CampaignServiceServer<CampaignApi>>()
            .await;
        let checkpoint_service = CheckpointServiceServer::new(CheckpointApi { checkpoints });
        health_reporter
            .set_serving::<CheckpointServiceServer<CheckpointApi>>()
            .await;
        health_reporter
            .set_serving::<WorkerServiceServer<WorkerApi>>()
            .await;
        let label_service =
            LabelServiceServer::new(label_api).max_decoding_message_size(service::MAX_LABEL_MESSAGE);
        health_reporter
            .set_serving::<LabelServiceServer<LabelApi>>()
            .await;
        let trainer_service = TrainerServiceServer::new(TrainerApi {
            trainers: trainers.clone(),
            store,
        });
        health_reporter
            .set_serving::<TrainerServiceServer<TrainerApi>>()
            .await;

        let services = Routes::new(campaign_service)
            .add_service(worker_service)
            .add_service(trainer_service)
            .add_service(checkpoint_service)
            .add_service(label_service)
            .add_service(health)
            .add_service(reflection);
        let (stop, stopped) = oneshot::channel();
        let server = Server::builder()
            .tcp_nodelay(true)
            .http2_keepalive_interval(Some(Duration::from_secs(2)))
            .http2_keepalive_timeout(Some(Duration::from_secs(3)))
            // What browsers speak on a plain connection.
            .accept_http1(true)
            .add_routes(web::beside(services, web))
            .serve_with_incoming_shutdown(TcpListenerStream::new(listener), async {
                // A dropped sender stops the server too.
                let _ = stopped.await;
            });
        let server = tokio::spawn(server);
        options.data.announce(&format!("http://{address}"))?;
        if options.resume {
            campaigns.resume_interrupted().await?;
        }
        Ok(Self {
            address,
            campaigns,
            dispatch,
            trainers,
            stop: Some(stop),
            server,
            _data: options.data,
        })
    }

    /// Where it listens.
    #[must_use]
    pub const fn address(&self) -> SocketAddr {
        self.address
    }

    /// Its URL, for clients and workers.
    #[must_use]
    pub fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// Stops the searches between two commits; running campaigns stay running in the store.
    pub async fn stop_searches(&self) {
        self.campaigns.stop().await;
    }

    /// Stops the searches between two commits, then the server. Running campaigns stay running in the store.
    ///
    /// # Errors
    /// If the server had already broken.
    pub async fn shutdown(mut self) -> Result<(), ServerError> {
        self.stop_searches().await;
        self.dispatch.stop().await;
        self.trainers.stop().await;
        if let Some(stop) = self.stop.take() {
            // It may have ended already.
            let _ = stop.send(());
        }
        match tokio::time::timeout(SHUTDOWN_LIMIT, &mut self.server).await {
            Ok(Ok(ended)) => Ok(ended?),
            // A panic was logged where it happened; streams still open after the limit are cut.
            Ok(Err(_)) | Err(_) => {
                self.server.abort();
                Ok(())
            }
        }
    }
}

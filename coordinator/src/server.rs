//! The coordinator as a whole: options in, a listening server out, a clean end.

use crate::{
    access::{Door, Entrance, Local},
    campaign::{CampaignError, Campaigns},
    checkpoints::{CheckpointError, Checkpoints},
    connections::{Places, connections},
    dispatch::{self, Dispatch, Trainers},
    limits,
    maps::Maps,
    queries::Queries,
    service::{CampaignApi, CheckpointApi, LabelApi, Seats, TrainerApi, WorkerApi},
    store::{DataDirectory, Store, StoreError},
    synthetic::SyntheticAnnotator,
    web::{self, Web},
};
use murmuration_link::Credentials;
use murmuration_proto::{
    FILE_DESCRIPTORS,
    v1::{
        campaign_service_server::CampaignServiceServer, checkpoint_service_server::CheckpointServiceServer,
        label_service_server::LabelServiceServer, trainer_service_server::TrainerServiceServer,
        worker_service_server::WorkerServiceServer,
    },
};
use std::{
    io,
    net::{Ipv4Addr, SocketAddr},
    sync::Arc,
    time::Duration,
};
use tokio::{net::TcpListener, sync::watch, task::JoinHandle};
use tonic::{
    service::Routes,
    transport::{Server, ServerTlsConfig},
};

/// How long a clean end may wait for open streams.
const SHUTDOWN_LIMIT: Duration = Duration::from_secs(5);

/// A listener's task.
type Serving = JoinHandle<Result<(), tonic::transport::Error>>;

/// What a coordinator needs to know.
#[derive(Debug)]
pub struct Options {
    /// The data directory, held by this process.
    pub data: DataDirectory,
    /// Where and how to listen, and whom to let in.
    pub entrance: Entrance,
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
    is_encrypted: bool,
    local: LocalWay,
    campaigns: Campaigns,
    dispatch: Dispatch,
    trainers: Trainers,
    stop: watch::Sender<bool>,
    servers: Vec<Serving>,
    /// Held for as long as the server runs.
    _data: DataDirectory,
}

/// How processes of this machine, and of the same user, get in.
#[derive(Debug, Clone)]
pub struct LocalWay {
    /// The URL: in the clear, since nothing leaves this machine.
    pub url: String,
    /// What to show there.
    pub credentials: Credentials,
}

/// What is served, whatever the door.
struct Served {
    services: Routes,
    web: Web,
    places: Places,
    stopped: watch::Receiver<bool>,
}

impl Coordinator {
    /// Opens the store, listens, and serves.
    ///
    /// # Errors
    /// See [`ServerError`].
    pub async fn start(options: Options) -> Result<Self, ServerError> {
        let (listener, address) = listen(options.entrance.address()).await?;
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
            seats: Seats::default(),
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
        let campaign_service =
            CampaignServiceServer::new(campaign_api).max_decoding_message_size(limits::MAX_MESSAGE);
        let worker_service = WorkerServiceServer::new(WorkerApi {
            dispatch: dispatch.clone(),
        })
        .max_decoding_message_size(limits::MAX_WORKER_MESSAGE);
        health_reporter
            .set_serving::<CampaignServiceServer<CampaignApi>>()
            .await;
        let checkpoint_service = CheckpointServiceServer::new(CheckpointApi { checkpoints })
            .max_decoding_message_size(limits::MAX_MESSAGE);
        health_reporter
            .set_serving::<CheckpointServiceServer<CheckpointApi>>()
            .await;
        health_reporter
            .set_serving::<WorkerServiceServer<WorkerApi>>()
            .await;
        let label_service =
            LabelServiceServer::new(label_api).max_decoding_message_size(limits::MAX_LABEL_MESSAGE);
        health_reporter
            .set_serving::<LabelServiceServer<LabelApi>>()
            .await;
        let trainer_service = TrainerServiceServer::new(TrainerApi {
            trainers: trainers.clone(),
            store,
        })
        .max_decoding_message_size(limits::MAX_MESSAGE);
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
        let (stop, stopped) = watch::channel(false);
        let served = Served {
            services,
            web,
            places: Places::of_this_process(),
            stopped,
        };
        let (local, servers) = served.open(listener, &options).await?;
        options.data.announce(&local.url)?;
        if options.resume {
            campaigns.resume_interrupted().await?;
        }
        Ok(Self {
            address,
            is_encrypted: options.entrance.tls().is_some(),
            local,
            campaigns,
            dispatch,
            trainers,
            stop,
            servers,
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
        url(self.address, self.is_encrypted)
    }

    /// How this process and others of its machine get in.
    #[must_use]
    pub const fn local(&self) -> &LocalWay {
        &self.local
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
        self.stop.send_replace(true);
        let end = tokio::time::Instant::now() + SHUTDOWN_LIMIT;
        for server in &mut self.servers {
            match tokio::time::timeout_at(end, &mut *server).await {
                Ok(Ok(ended)) => ended?,
                // A panic was logged where it happened; streams still open after the limit are cut.
                Ok(Err(_)) | Err(_) => server.abort(),
            }
        }
        Ok(())
    }
}

impl Served {
    /// Serves at the entrance that was asked for; and, where that is guarded, at one of this machine's own.
    async fn open(
        self,
        listener: TcpListener,
        options: &Options,
    ) -> Result<(LocalWay, Vec<Serving>), ServerError> {
        let (entrance, data) = (&options.entrance, options.data.path());
        let local = Local::of(data)?;
        let (tls, access) = (entrance.tls(), entrance.access());
        let is_open = access.is_open() && tls.is_none();
        let address = listener.local_addr().map_err(|source| ServerError::Listen {
            address: entrance.address(),
            source,
        })?;
        let door = Door {
            access,
            sessions: local.sessions(),
            is_encrypted: tls.is_some(),
        };
        let mut servers = vec![self.at(listener, tls, door)?];
        let way = if is_open {
            LocalWay {
                url: url(address, false),
                credentials: Credentials::default(),
            }
        } else {
            let (listener, address) = listen((Ipv4Addr::LOCALHOST, 0).into()).await?;
            let door = Door {
                access: local.access(),
                sessions: local.sessions(),
                is_encrypted: false,
            };
            servers.push(self.at(listener, None, door)?);
            LocalWay {
                url: url(address, false),
                credentials: Credentials::token(local.token().clone()),
            }
        };
        Ok((way, servers))
    }

    /// Serves at one door.
    fn at(
        &self,
        listener: TcpListener,
        tls: Option<ServerTlsConfig>,
        door: Door,
    ) -> Result<Serving, tonic::transport::Error> {
        let mut server = Server::builder()
            .http2_keepalive_interval(Some(Duration::from_secs(2)))
            .http2_keepalive_timeout(Some(Duration::from_secs(3)))
            .http2_max_header_list_size(limits::MAX_HEADER_BYTES)
            .max_concurrent_streams(limits::MAX_STREAMS_PER_CONNECTION)
            // What browsers speak on a plain connection.
            .accept_http1(true);
        if let Some(tls) = tls {
            server = server.tls_config(tls)?;
        }
        let routes = web::beside(self.services.clone(), self.web.clone(), Arc::new(door));
        let connections = connections(listener, self.places.clone());
        let mut stopped = self.stopped.clone();
        let serving = server
            .add_routes(routes)
            .serve_with_incoming_shutdown(connections, async move {
                // A dropped sender stops the server too.
                let _ = stopped.wait_for(|&stopped| stopped).await;
            });
        Ok(tokio::spawn(serving))
    }
}

async fn listen(address: SocketAddr) -> Result<(TcpListener, SocketAddr), ServerError> {
    let error = |source| ServerError::Listen { address, source };
    let listener = TcpListener::bind(address).await.map_err(error)?;
    let bound = listener.local_addr().map_err(error)?;
    Ok((listener, bound))
}

fn url(address: SocketAddr, is_encrypted: bool) -> String {
    let scheme = if is_encrypted { "https" } else { "http" };
    format!("{scheme}://{address}")
}

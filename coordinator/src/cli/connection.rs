//! How a command reaches a coordinator: one that runs, or one of its own over the data directory.

use super::{CliError, Global};
use crate::{
    access::{Entrance, local_token},
    dispatch,
    local::{Crew, LocalCluster},
    server::Options,
    store::{DataDirectory, StoreError},
};
use murmuration_link::{Coordinator, Credentials};
use murmuration_proto::v1::{
    campaign_service_client::CampaignServiceClient, checkpoint_service_client::CheckpointServiceClient,
    label_service_client::LabelServiceClient,
};
use std::time::Duration;
use tonic::service::interceptor::InterceptedService;

/// Largest message taken from a coordinator: a replay of many agents, or all labels of a large archive.
const MAX_MESSAGE: usize = 128 << 20;

pub(super) type Client = CampaignServiceClient<Coordinator>;
pub(super) type CheckpointClient = CheckpointServiceClient<Coordinator>;
pub(super) type LabelClient = LabelServiceClient<Coordinator>;

/// A coordinator that answers, for as long as this value lives.
pub(super) struct Connection {
    pub(super) client: Client,
    pub(super) checkpoints: CheckpointClient,
    pub(super) labels: LabelClient,
    /// Present if this process had to start one.
    own: Option<LocalCluster>,
}

impl Connection {
    /// Reaches the coordinator that was named, or the one that holds the data directory, or starts one over it
    /// with this crew (which goes on with no campaign by itself).
    pub(super) async fn open(global: &Global, crew: Crew) -> Result<Self, CliError> {
        if let Some(url) = &global.coordinator {
            return Self::to(url, &global.credentials()?, None).await;
        }
        match DataDirectory::hold_existing(&global.data) {
            Ok(data) => Self::start(global, data, crew).await,
            Err(StoreError::InUse { holder, .. }) if !holder.address.is_empty() => {
                let token = local_token(&global.data)?;
                let credentials = token.map_or_else(Credentials::default, Credentials::token);
                Self::to(&holder.address, &credentials, None).await
            }
            Err(error) => Err(error.into()),
        }
    }

    /// Starts a coordinator over a data directory that this process holds.
    pub(super) async fn start(global: &Global, data: DataDirectory, crew: Crew) -> Result<Self, CliError> {
        let options = Options {
            data,
            entrance: Entrance::loopback(0),
            resume: false,
            checkpoints: global.checkpoint_store.clone(),
            dispatch: dispatch::Options::default(),
        };
        let own = LocalCluster::start(options, crew).await?;
        let way = own.coordinator().local().clone();
        Self::to(&way.url, &way.credentials, Some(own)).await
    }

    async fn to(url: &str, credentials: &Credentials, own: Option<LocalCluster>) -> Result<Self, CliError> {
        let channel = connect(url, credentials).await?;
        Ok(Self {
            client: Client::new(channel.clone()).max_decoding_message_size(MAX_MESSAGE),
            checkpoints: CheckpointClient::new(channel.clone()),
            labels: LabelClient::new(channel).max_decoding_message_size(MAX_MESSAGE),
            own,
        })
    }

    /// Whether this process runs the coordinator, so that nothing goes on after it.
    pub(super) const fn is_own(&self) -> bool {
        self.own.is_some()
    }

    /// Ends what was started.
    pub(super) async fn close(self) -> Result<(), CliError> {
        match self.own {
            Some(own) => Ok(own.shutdown().await?),
            None => Ok(()),
        }
    }
}

/// A connection to a coordinator's URL.
pub(super) async fn connect(url: &str, credentials: &Credentials) -> Result<Coordinator, CliError> {
    let endpoint = credentials.endpoint(url)?.connect_timeout(Duration::from_secs(5));
    let channel = endpoint.connect().await;
    let channel = channel.map_err(|error| CliError::no_coordinator(url, &error))?;
    Ok(InterceptedService::new(channel, credentials.bearer()))
}

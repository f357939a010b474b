//! The external scaler of KEDA: says how many replicas of workers or trainers the open work could use.

use super::{
    Streamed,
    nodes::{demand_of, threads_of, within_of},
};
use murmuration_engine::{blocking::spawn, campaign::Campaigns};
use murmuration_proto::externalscaler::{
    GetMetricSpecResponse, GetMetricsRequest, GetMetricsResponse, IsActiveResponse, MetricSpec, MetricValue,
    ScaledObjectRef, external_scaler_server::ExternalScaler,
};
use murmuration_swarm::Invalid;
use std::{collections::HashMap, num::NonZeroU32, str::FromStr, time::Duration};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status};

/// How often a stream looks whether replicas are wanted.
const LOOK_INTERVAL: Duration = Duration::from_secs(2);

/// Implements `externalscaler.ExternalScaler`.
#[derive(Debug, Clone)]
pub struct ScalerApi {
    pub campaigns: Campaigns,
}

/// The request of a trigger, from its metadata.
#[derive(Debug, Clone, Copy)]
struct Trigger {
    /// The metric: workers or trainers.
    counted: Counted,
    /// Threads of a worker.
    threads: Option<NonZeroU32>,
    within: Duration,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Counted {
    Workers,
    Trainers,
}

impl Counted {
    const fn metric(self) -> &'static str {
        match self {
            Self::Workers => "murmuration-workers-wanted",
            Self::Trainers => "murmuration-trainers-wanted",
        }
    }
}

impl TryFrom<&HashMap<String, String>> for Trigger {
    type Error = Invalid;

    /// Reads `node` (`worker` or `trainer`), `threads` and `within`; KEDA adds further metadata of its own.
    fn try_from(metadata: &HashMap<String, String>) -> Result<Self, Invalid> {
        let counted = match metadata.get("node").map(String::as_str) {
            None | Some("worker") => Counted::Workers,
            Some("trainer") => Counted::Trainers,
            Some(other) => return Err(Invalid::new("node", other, "worker or trainer")),
        };
        Ok(Self {
            counted,
            threads: threads_of(number(metadata, "threads")?)?,
            within: within_of(number(metadata, "within")?)?,
        })
    }
}

fn number<T: FromStr>(metadata: &HashMap<String, String>, field: &str) -> Result<Option<T>, Invalid> {
    let read = |text: &String| text.parse().map_err(|_| Invalid::new(field, text, "a number"));
    metadata.get(field).map(read).transpose()
}

impl ScalerApi {
    async fn wanted(&self, trigger: Trigger) -> Result<u32, Status> {
        let demand = demand_of(&self.campaigns, trigger.threads, trigger.within).await?;
        Ok(match trigger.counted {
            Counted::Workers => demand.workers,
            Counted::Trainers => demand.trainers,
        })
    }

    /// Sends whether replicas are wanted, at once and when it changes, until the client has gone.
    async fn follow(self, trigger: Trigger, answers: mpsc::Sender<Result<IsActiveResponse, Status>>) {
        let mut last = None;
        while !answers.is_closed() {
            let sent = match self.wanted(trigger).await {
                Ok(wanted) if last == Some(wanted > 0) => Ok(()),
                Ok(wanted) => {
                    last = Some(wanted > 0);
                    let result = wanted > 0;
                    answers.send(Ok(IsActiveResponse { result })).await
                }
                // KEDA asks again.
                Err(status) => {
                    let _ = answers.send(Err(status)).await;
                    return;
                }
            };
            if sent.is_err() {
                return;
            }
            tokio::time::sleep(LOOK_INTERVAL).await;
        }
    }
}

#[tonic::async_trait]
impl ExternalScaler for ScalerApi {
    type StreamIsActiveStream = Streamed<IsActiveResponse>;

    async fn is_active(
        &self,
        request: Request<ScaledObjectRef>,
    ) -> Result<Response<IsActiveResponse>, Status> {
        let trigger = Trigger::try_from(&request.get_ref().scaler_metadata)?;
        let result = self.wanted(trigger).await? > 0;
        Ok(Response::new(IsActiveResponse { result }))
    }

    async fn stream_is_active(
        &self,
        request: Request<ScaledObjectRef>,
    ) -> Result<Response<Self::StreamIsActiveStream>, Status> {
        let trigger = Trigger::try_from(&request.get_ref().scaler_metadata)?;
        let (answers, stream) = mpsc::channel(1);
        spawn(self.clone().follow(trigger, answers));
        Ok(Response::new(Box::pin(ReceiverStream::new(stream))))
    }

    async fn get_metric_spec(
        &self,
        request: Request<ScaledObjectRef>,
    ) -> Result<Response<GetMetricSpecResponse>, Status> {
        let trigger = Trigger::try_from(&request.get_ref().scaler_metadata)?;
        // The metric counts replicas.
        let spec = MetricSpec {
            metric_name: trigger.counted.metric().to_owned(),
            target_size: 1,
            target_size_float: 1.0,
        };
        let metric_specs = vec![spec];
        Ok(Response::new(GetMetricSpecResponse { metric_specs }))
    }

    async fn get_metrics(
        &self,
        request: Request<GetMetricsRequest>,
    ) -> Result<Response<GetMetricsResponse>, Status> {
        let object = request.into_inner().scaled_object_ref.unwrap_or_default();
        let trigger = Trigger::try_from(&object.scaler_metadata)?;
        let wanted = self.wanted(trigger).await?;
        let value = MetricValue {
            metric_name: trigger.counted.metric().to_owned(),
            metric_value: wanted.into(),
            metric_value_float: wanted.into(),
        };
        let metric_values = vec![value];
        Ok(Response::new(GetMetricsResponse { metric_values }))
    }
}

//! Who is connected, and what each of them does.

use super::{Command, Dispatch, Request, Trainers, WorkKind};
use murmuration_model::CampaignId;
use tokio::sync::oneshot;

/// A worker or trainer that is connected.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConnectedMachine {
    /// What it is called, and its address.
    pub name: String,
    /// Tasks that it runs at once; 0 once it takes no more.
    pub capacity: usize,
    /// What it has in hand.
    pub work: Vec<WorkInHand>,
}

/// Tasks of one campaign and kind that a machine has in hand.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WorkInHand {
    /// What they are.
    pub kind: WorkKind,
    /// Whose they are; `None` if they are of no campaign.
    pub campaign: Option<CampaignId>,
    /// How many.
    pub tasks: usize,
}

impl Dispatch {
    /// Everybody who is connected, by name; nobody once the dispatcher has ended.
    pub async fn connected(&self) -> Vec<ConnectedMachine> {
        let (reply, answer) = oneshot::channel();
        let request = Command::Work(Request::Connected { reply });
        match self.commands.send(request).await {
            Ok(()) => answer.await.unwrap_or_default(),
            Err(_) => Vec::new(),
        }
    }
}

impl Trainers {
    /// Every trainer that is connected, by name.
    pub async fn machines(&self) -> Vec<ConnectedMachine> {
        self.dispatch().connected().await
    }
}

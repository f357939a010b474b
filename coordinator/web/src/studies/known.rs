//! The campaigns of a coordinator, indexed by their specifications for the pages of studies.

use murmuration_engine::{
    blocking::blocking,
    campaign::{CampaignError, CampaignStatus, Campaigns, ListedCampaign},
};
use murmuration_model::{CampaignId, CampaignRecord, CampaignState};
use murmuration_study::cell_digest;
use std::{
    collections::{BTreeMap, BTreeSet, btree_map::Entry},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Instant,
};

/// The progress of a study's campaign.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum State {
    /// The campaign has not begun.
    Waiting,
    /// The campaign runs: number of complete generations, and of all generations.
    Running(u32, u32),
    /// The campaign stands still, because a person paused it or its coordinator ended.
    Stopped(&'static str),
    /// The campaign is completed, but not measured yet.
    Measuring,
    /// The campaign failed, for this reason.
    Failed(String),
    /// The campaign is measured.
    Done,
}

impl State {
    /// The state in one word.
    pub(super) const fn name(&self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Running(..) => "running",
            Self::Stopped(how) => how,
            Self::Measuring => "measuring",
            Self::Failed(_) => "failed",
            Self::Done => "done",
        }
    }
}

/// Maximum number of records in memory at a time while the campaigns are read.
const AT_ONCE: usize = 50;

/// Digests of campaigns' specifications. These digests never change.
#[derive(Debug, Default)]
pub(super) struct Digests(Mutex<BTreeMap<CampaignId, String>>);

impl Digests {
    fn kept(&self) -> MutexGuard<'_, BTreeMap<CampaignId, String>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn get(&self, id: &CampaignId) -> Option<String> {
        self.kept().get(id).cloned()
    }

    fn add(&self, record: &CampaignRecord) {
        let digest = cell_digest(&record.spec);
        self.kept().insert(record.id.clone(), digest);
    }

    /// Removes the digests of deleted campaigns, and returns the campaigns without a known digest.
    fn missing(&self, campaigns: &[ListedCampaign]) -> Vec<CampaignId> {
        let there: BTreeSet<&CampaignId> = campaigns.iter().map(|listed| &listed.head.id).collect();
        let mut kept = self.kept();
        kept.retain(|id, _| there.contains(id));
        let missing = there.into_iter().filter(|id| !kept.contains_key(*id));
        missing.cloned().collect()
    }
}

/// The campaigns of a coordinator, by the digests of their specifications.
#[derive(Debug)]
pub(super) struct Known {
    /// The oldest campaign of each specification, by the specification's digest. Cancelled campaigns are left out.
    by_digest: BTreeMap<String, (String, State)>,
    /// The ids of all campaigns.
    ids: BTreeSet<String>,
    /// Time at which the list of campaigns was requested.
    listed: Instant,
}

impl Known {
    /// Reads the campaigns, with only some records in memory at a time. A campaign's record is read if its digest is not known
    /// yet, or if the campaign is running or failed.
    pub(super) async fn read(campaigns: &Campaigns, digests: &Arc<Digests>) -> Result<Self, CampaignError> {
        let listed = Instant::now();
        let heads = campaigns.heads().await?;
        let missing = digests.missing(&heads);
        for some in missing.chunks(AT_ONCE) {
            let statuses = campaigns.statuses(some.to_vec()).await?;
            let digests = Arc::clone(digests);
            blocking(move || statuses.iter().for_each(|status| digests.add(&status.record))).await?;
        }
        let (mut known, further) = Self::of(&heads, listed, |id| digests.get(id));
        for some in further.chunks(AT_ONCE) {
            for status in campaigns.statuses(some.to_vec()).await? {
                if let Some(digest) = digests.get(&status.record.id) {
                    known
                        .by_digest
                        .insert(digest, (status.record.id.to_string(), state(&status)));
                }
            }
        }
        Ok(known)
    }

    /// Indexes `campaigns`, which are sorted oldest first and were requested at `listed`. It also returns the campaigns whose
    /// state needs their record.
    fn of(
        campaigns: &[ListedCampaign],
        listed: Instant,
        digest_of: impl Fn(&CampaignId) -> Option<String>,
    ) -> (Self, Vec<CampaignId>) {
        let mut by_digest = BTreeMap::new();
        let mut further = Vec::new();
        for campaign in campaigns {
            let id = &campaign.head.id;
            let state = match campaign.head.state {
                CampaignState::Cancelled => continue,
                CampaignState::Running if campaign.active => State::Running(0, 0),
                CampaignState::Running => State::Stopped("interrupted"),
                CampaignState::Paused => State::Stopped("paused"),
                CampaignState::Failed => State::Failed(String::new()),
                CampaignState::Completed => State::Measuring,
            };
            let Some(digest) = digest_of(id) else { continue };
            if let Entry::Vacant(place) = by_digest.entry(digest) {
                let has_more = matches!(state, State::Running(..) | State::Failed(_));
                further.extend(has_more.then(|| id.clone()));
                place.insert((id.to_string(), state));
            }
        }
        let ids = campaigns.iter().map(|campaign| campaign.head.id.to_string());
        let known = Self {
            by_digest,
            listed,
            ids: ids.collect(),
        };
        (known, further)
    }

    /// The campaign whose specification has this digest, and its state.
    pub(super) fn get(&self, digest: &str) -> Option<&(String, State)> {
        self.by_digest.get(digest)
    }

    /// Whether a campaign that existed at `there_at` has been deleted. The result is false if the campaigns were listed before
    /// that time.
    pub(super) fn lost(&self, id: &str, there_at: Instant) -> bool {
        self.listed > there_at && !self.ids.contains(id)
    }
}

fn state(status: &CampaignStatus) -> State {
    let record = &status.record;
    match record.state {
        CampaignState::Running if status.active => {
            State::Running(record.generations_done, record.generations())
        }
        CampaignState::Running => State::Stopped("interrupted"),
        CampaignState::Paused => State::Stopped("paused"),
        CampaignState::Failed => State::Failed(record.error.clone()),
        CampaignState::Completed => State::Measuring,
        CampaignState::Cancelled => State::Waiting,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_model::{CampaignHead, CampaignNotes};
    use std::time::Duration;

    #[test]
    fn a_campaign_is_lost_only_by_a_list_that_is_newer_than_it() {
        let of = |listed| Known::of(&[], listed, |_| None).0;
        let listed = Instant::now();
        let known = of(listed);
        assert!(!known.lost("one-1", listed));
        let later = Instant::now() + Duration::from_secs(1);
        assert!(!known.lost("one-1", later));
        assert!(of(later + Duration::from_secs(1)).lost("one-1", later));
    }

    #[test]
    fn of_equal_specifications_the_oldest_counts_that_nobody_cancelled() {
        let listed = |number: u32, state, active| ListedCampaign {
            head: CampaignHead {
                id: format!("one-{number}").parse().unwrap(),
                study: None,
                notes: CampaignNotes::default(),
                state,
                opening: String::new(),
            },
            active,
            waiting: false,
        };
        let campaigns = [
            listed(1, CampaignState::Cancelled, false),
            listed(2, CampaignState::Running, true),
            listed(3, CampaignState::Completed, false),
        ];
        let same = |_: &CampaignId| Some("same".to_owned());
        let (known, further) = Known::of(&campaigns, Instant::now(), same);
        assert_eq!(
            known.get("same"),
            Some(&("one-2".to_owned(), State::Running(0, 0)))
        );
        assert_eq!(further, [campaigns[1].head.id.clone()]);
        let digests = Digests::default();
        digests.kept().insert(campaigns[0].head.id.clone(), String::new());
        assert_eq!(digests.missing(&campaigns[1..]).len(), 2);
        assert_eq!(digests.get(&campaigns[0].head.id), None);
    }
}

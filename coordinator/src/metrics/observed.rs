//! Metrics that are read from the store and from running campaigns on each request.

use super::PREFIX;
use murmuration_access::Seats;
use murmuration_engine::{
    campaign::{CampaignError, CampaignStatus, Campaigns, ListedCampaign},
    demand::{Demand, WITHIN},
};
use murmuration_model::CampaignState;
use murmuration_store::{Store, StoreError};
use prometheus_client::{
    metrics::{counter::Counter, family::Family, gauge::Gauge},
    registry::Registry,
};

type ByCampaign = Family<[(&'static str, String); 1], Gauge>;

/// The current values of the metrics that are read on each request.
pub(super) async fn observe(
    campaigns: &Campaigns,
    store: &Store,
    seats: &Seats,
) -> Result<Registry, CampaignError> {
    let count =
        |store: &Store| -> Result<_, StoreError> { Ok((store.count_labels()?, store.count_individuals()?)) };
    let (labels, archived) = store.run(count).await?;
    // Few campaigns are active, so the statuses of active campaigns are read in full. For all other campaigns, the state is
    // enough.
    let heads = campaigns.heads().await?;
    let statuses = campaigns.at_work().await?;
    let demand = Demand::of(campaigns, &statuses, None, WITHIN).await;
    let mut registry = Registry::with_prefix(PREFIX);
    for (name, help, value) in [
        (
            "archive_individuals",
            "Individuals in the archives of all campaigns",
            archived,
        ),
        (
            "label_entries",
            "Entries of the label logs of all campaigns",
            labels,
        ),
        (
            "workers_wanted",
            "Workers, like those that are connected, that would complete the open work in five minutes",
            demand.workers.into(),
        ),
        (
            "trainers_wanted",
            "Trainers that the campaigns could use",
            demand.trainers.into(),
        ),
    ] {
        let gauge: Gauge = Gauge::default();
        gauge.set(signed(value));
        registry.register(name, help, gauge);
    }
    registry.register("campaigns", "Campaigns, by state", by_state(&heads));
    by_campaign(&statuses, &mut registry);
    by_class(seats, &mut registry);
    Ok(registry)
}

/// Number of requests in each cost class that are being answered, wait, or were refused.
fn by_class(seats: &Seats, registry: &mut Registry) {
    let [answered, waiting] = [(); 2].map(|()| Family::<[(&'static str, &'static str); 1], Gauge>::default());
    let refused = Family::<[(&'static str, &'static str); 1], Counter>::default();
    for (class, counts) in seats.counts() {
        let labels = [("class", class.name())];
        answered
            .get_or_create(&labels)
            .set(signed(counts.answered as u64));
        waiting.get_or_create(&labels).set(signed(counts.waiting as u64));
        refused.get_or_create(&labels).inc_by(counts.refused);
    }
    registry.register(
        "requests_answered",
        "Requests that are answered now, by cost class",
        answered,
    );
    registry.register(
        "requests_waiting",
        "Requests that wait for a seat of their cost class",
        waiting,
    );
    registry.register(
        "requests_refused",
        "Requests that were refused because their cost class had no free seat",
        refused,
    );
}

fn by_state(campaigns: &[ListedCampaign]) -> Family<[(&'static str, &'static str); 1], Gauge> {
    let states = Family::<_, Gauge>::default();
    for state in CampaignState::ALL {
        drop(states.get_or_create(&[("state", state.name())]));
    }
    for listed in campaigns {
        states.get_or_create(&[("state", listed.head.state.name())]).inc();
    }
    states
}

/// Progress of each active campaign. Inactive campaigns are left out of the metrics, because their number only grows.
fn by_campaign(statuses: &[CampaignStatus], registry: &mut Registry) {
    let (done, all) = (ByCampaign::default(), ByCampaign::default());
    let (epoch, epochs) = (ByCampaign::default(), ByCampaign::default());
    for status in statuses.iter().filter(|status| status.active) {
        let set = |family: &ByCampaign, value: u64| {
            let labels = [("campaign", status.record.id.to_string())];
            family.get_or_create(&labels).set(signed(value));
        };
        set(&done, status.record.generations_done.into());
        set(&all, status.record.generations().into());
        if let Some(training) = &status.training {
            set(&epoch, training.epoch);
            set(&epochs, training.epochs);
        }
    }
    for (name, help, family) in [
        (
            "campaign_generations_done",
            "Generations on disk of a campaign at work",
            done,
        ),
        (
            "campaign_generations",
            "Generations that a campaign at work will have in all",
            all,
        ),
        (
            "training_epochs_done",
            "Epochs that a campaign's training has done",
            epoch,
        ),
        (
            "training_epochs",
            "Epochs that a campaign's training has at most",
            epochs,
        ),
    ] {
        registry.register(name, help, family);
    }
}

fn signed(value: u64) -> i64 {
    i64::try_from(value).unwrap_or(i64::MAX)
}

//! Atlases that differ from the current atlas only in the number of robots and in noise. Sliders switch between the atlases.

use crate::{Web, layout::atlas_of, page_error::PageError};
use maud::{Markup, html};
use murmuration_model::{CampaignId, CampaignRecord};
use murmuration_proto::v1;
use murmuration_swarm::{CampaignSpec, Method};
use serde::Serialize;
use serde_json::json;
use std::cmp::Ordering;

/// Maximum number of campaigns' records in memory at a time.
const AT_ONCE: usize = 50;

/// Atlases of one robot in one world, with different numbers of robots and different noise.
#[derive(Debug, PartialEq)]
pub(super) struct Others {
    /// The numbers of robots, ascending.
    robots: Vec<u32>,
    /// The noise of the atlases in words, in ascending order.
    noises: Vec<String>,
    /// Each atlas with its places in `robots` and `noises`; the current atlas comes first.
    atlases: Vec<(CampaignId, usize, usize)>,
}

/// The atlases, for the script of the sliders.
#[derive(Debug, Serialize)]
struct OthersView<'a> {
    robots: &'a [u32],
    noise: &'a [String],
    /// Each atlas with its places in `robots` and `noise`.
    atlases: Vec<(&'a str, usize, usize)>,
}

/// The atlases that a page can switch between, the atlas of `record` included; `None` if there is no other atlas.
pub(super) async fn others(web: &Web, record: &CampaignRecord) -> Result<Option<Others>, PageError> {
    // Only this method evaluates every controller. The first lines of a specification contain the name of its method.
    let method = format!("method = \"{}\"", Method::Exhaustive.name());
    let heads = web.campaigns.heads().await?.into_iter().rev();
    let heads = heads.filter(|listed| listed.head.opening.contains(&method));
    let ids: Vec<CampaignId> = heads.map(|listed| listed.head.id).collect();
    let mut known = Vec::new();
    for some in ids.chunks(AT_ONCE) {
        let records = web.campaigns.statuses(some.to_vec()).await?.into_iter();
        let records = records.map(|status| status.record);
        let records = records.filter(|record| record.individuals() > 0 && atlas_of(record).is_some());
        known.extend(records.map(|record| (record.id, record.spec)));
    }
    Ok(Others::among(&record.id, &record.spec, known))
}

impl Others {
    /// The atlas of a campaign, and the atlases among `known` that differ only in the number of robots and in noise. `known` has
    /// the newest campaign first.
    fn among(id: &CampaignId, spec: &CampaignSpec, known: Vec<(CampaignId, CampaignSpec)>) -> Option<Self> {
        let own = apart(spec);
        let mut alike = vec![(id.clone(), conditions(spec))];
        for (other, of) in known {
            let conditions = conditions(&of);
            let is_new = alike.iter().all(|(_, known)| *known != conditions);
            if other != *id && is_new && apart(&of) == own {
                alike.push((other, conditions));
            }
        }
        if alike.len() == 1 {
            return None;
        }
        let mut robots: Vec<u32> = alike.iter().map(|(_, (robots, _))| *robots).collect();
        robots.sort_unstable();
        robots.dedup();
        let mut noises: Vec<[f64; 5]> = alike.iter().map(|(_, (_, noise))| *noise).collect();
        noises.sort_by(compared);
        noises.dedup();
        let place = |(id, (count, noise)): (CampaignId, (u32, [f64; 5]))| {
            let robots = robots.iter().position(|known| *known == count)?;
            let noise = noises.iter().position(|known| *known == noise)?;
            Some((id, robots, noise))
        };
        let atlases = alike.into_iter().filter_map(place).collect();
        Some(Self {
            atlases,
            noises: noises.iter().map(in_words).collect(),
            robots,
        })
    }

    /// The sliders. The script of the page opens the atlas that the sliders choose.
    pub(super) fn sliders(&self) -> Markup {
        let (robots, noise) = self
            .atlases
            .first()
            .map_or((0, 0), |(_, robots, noise)| (*robots, *noise));
        let numbers: Vec<String> = self.robots.iter().map(u32::to_string).collect();
        html! {
            div.choices.others.scripted data-others=(json!(self.view())) {
                (slider("robots", "Robots", &numbers, robots))
                (slider("noise", "Noise", &self.noises, noise))
            }
        }
    }

    fn view(&self) -> OthersView<'_> {
        let atlases = self.atlases.iter();
        OthersView {
            robots: &self.robots,
            noise: &self.noises,
            atlases: atlases
                .map(|(id, robots, noise)| (id.as_str(), *robots, *noise))
                .collect(),
        }
    }
}

/// A slider over `values`; empty if there is only one value.
fn slider(name: &str, title: &str, values: &[String], at: usize) -> Markup {
    html! {
        @if values.len() > 1 {
            label {
                (title) " "
                input name=(name) type="range" min="0" max=(values.len() - 1) step="1" value=(at) autocomplete="off"
                    aria-valuetext=(values[at]);
                output { (values[at]) }
            }
        }
    }
}

/// A specification without the fields in which the atlases on one page can differ.
fn apart(spec: &CampaignSpec) -> v1::CampaignSpec {
    let mut message = v1::CampaignSpec::from(spec);
    message.name = None;
    if let Some(world) = &mut message.world {
        (world.agents, world.noise) = (None, None);
    }
    message
}

/// The number of robots, and the numbers of the noise in the order of [`NOISE`].
fn conditions(spec: &CampaignSpec) -> (u32, [f64; 5]) {
    let world = spec.world();
    let noise = v1::Noise::from(world.noise());
    let numbers = [
        noise.slip,
        noise.gain,
        noise.missed,
        noise.false_detection,
        noise.delay.map(f64::from),
    ];
    (world.agents(), numbers.map(Option::unwrap_or_default))
}

/// The names of the five numbers of a world's noise.
const NOISE: [&str; 5] = ["slip", "gain", "missed", "false detections", "delay"];

fn compared(one: &[f64; 5], other: &[f64; 5]) -> Ordering {
    let pairs = one.iter().zip(other);
    let mut orders = pairs.map(|(one, other)| one.total_cmp(other));
    orders.find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
}

fn in_words(noise: &[f64; 5]) -> String {
    let given = NOISE.iter().zip(noise).filter(|(_, number)| **number != 0.0);
    let words: Vec<String> = given.map(|(name, number)| format!("{name} {number}")).collect();
    match words.is_empty() {
        true => "none".to_owned(),
        false => words.join(", "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn atlas(number: u32, world: &str) -> (CampaignId, CampaignSpec) {
        let text = format!(
            "name = \"a\"\nmodel = \"single-sensor\"\nmethod = \"exhaustive\"\ncontrollers.step = 0.5\n[world]\n{world}"
        );
        let id = format!("a-{number}").parse().unwrap();
        (id, CampaignSpec::from_toml(&text).unwrap())
    }

    #[test]
    fn atlases_that_differ_in_robots_and_noise_alone_lie_on_two_axes() {
        let (id, spec) = atlas(1, "agents = 12");
        let known = vec![
            atlas(6, "agents = 24\nhorizon = 100"),
            atlas(5, "agents = 24\nnoise.missed = 0.1"),
            atlas(4, "agents = 24"),
            atlas(3, "agents = 24"),
            atlas(2, "agents = 6"),
            (id.clone(), spec.clone()),
        ];
        let others = Others::among(&id, &spec, known).unwrap();
        assert_eq!(others.robots, [6, 12, 24]);
        assert_eq!(others.noises, ["none", "missed 0.1"]);
        let places: Vec<_> = others
            .atlases
            .iter()
            .map(|(id, robots, noise)| (id.as_str(), *robots, *noise))
            .collect();
        // `a-4` and `a-3` have the same conditions: only the newer atlas is listed.
        assert_eq!(
            places,
            [("a-1", 1, 0), ("a-5", 2, 1), ("a-4", 2, 0), ("a-2", 0, 0)]
        );
        let sliders = others.sliders().into_string();
        assert_eq!(sliders.matches("type=\"range\"").count(), 2, "{sliders}");
        let alone = vec![(id.clone(), spec.clone()), atlas(6, "agents = 12\nhorizon = 100")];
        assert_eq!(Others::among(&id, &spec, alone), None);
    }
}

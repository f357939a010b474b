//! The reference of recall: an atlas, with its behaviour space divided into niches.

use murmuration_report::atlas::Tally;
use murmuration_search::{
    interrupt::{Interrupt, Interrupted},
    novelty::{Behaviours, Misfit},
    tessellation::Tessellation,
};
use murmuration_swarm::{
    CampaignSpec, Class, Controller, Enumeration, FEATURE_NAMES, Features, MAX_FEATURE, Method, Verdict,
};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

const FEATURES: usize = FEATURE_NAMES.len();
/// The features that change their sign in a mirror: angular momentum and group rotation.
const TURNING: [usize; 2] = [1, 4];

/// An individual of an archive whose trials were judged.
#[derive(Debug, Clone, PartialEq)]
pub struct Judged {
    pub controller: Controller,
    /// Features, as means over the trials.
    pub features: Features,
    /// Coordinates in the behaviour space of the campaign.
    pub behaviour: Vec<f64>,
    /// The verdict of each trial of the individual; at least one.
    pub verdicts: Vec<Verdict>,
}

/// The content of an atlas: verdicts, and niches of the space of the five features.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reference {
    /// Digest of the study's measures ([`measures_digest`](crate::measures_digest)), which include the atlas.
    pub measures: String,
    /// Id of the campaign of the atlas.
    pub campaign: String,
    /// Digest of the archive of the atlas.
    pub archive_digest: String,
    /// Number of trials of each verdict, by the verdict's name, mirror images included. Verdicts without trials have no entry.
    pub verdicts: BTreeMap<String, u64>,
    /// The divisor of each feature: its standard deviation over the atlas, or 1 where the deviation is 0.
    pub scale: Features,
    /// The niches; at least one.
    pub niches: Vec<Niche>,
}

/// A cell of the tessellation of the space of features, called a niche because a study has cells of its own.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Niche {
    /// The niche's centroid, in features divided by their scale.
    pub centroid: Features,
    /// Name of the class of most controllers in the niche.
    pub class: String,
    /// Number of the atlas's controllers in the niche, mirror images included.
    pub members: u64,
}

/// Why an atlas cannot be a reference.
#[derive(Debug, thiserror::Error)]
pub enum ReferenceError {
    #[error("the atlas is empty")]
    Empty,
    #[error("the features of the atlas cannot be compared: {0}")]
    Misfit(#[from] Misfit),
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

impl Reference {
    /// The reference of an atlas's archive, with at most `niches` niches. A controller whose mirror image the atlas leaves out
    /// counts twice, the second time with the features of its image.
    pub fn of(
        spec: &CampaignSpec,
        archive: &[Judged],
        niches: usize,
        interrupt: &Interrupt,
    ) -> Result<Self, ReferenceError> {
        let members = members(spec, archive);
        let scale = deviations(&members).ok_or(ReferenceError::Empty)?;
        let mut points = Behaviours::new(FEATURES);
        for (features, _) in &members {
            points.push(&scaled(features, &scale))?;
        }
        let tessellation = Tessellation::of(&points, niches, interrupt)?;
        let mut classes = vec![[0_u64; Class::ALL.len()]; tessellation.centroids().len()];
        for (niche, (_, judged)) in tessellation.cells_of(&points).into_iter().zip(&members) {
            classes[niche][Tally::of(&judged.verdicts).class as usize] += 1;
        }
        let mut verdicts = BTreeMap::new();
        for verdict in members.iter().flat_map(|(_, judged)| &judged.verdicts) {
            *verdicts.entry(verdict.name().to_owned()).or_default() += 1;
        }
        let centroids = tessellation.centroids().arrays::<FEATURES>();
        let niche = |(centroid, counts): (&Features, &[u64; Class::ALL.len()])| Niche {
            centroid: *centroid,
            class: most_frequent(counts).name().to_owned(),
            members: counts.iter().sum(),
        };
        Ok(Self {
            measures: String::new(),
            campaign: String::new(),
            archive_digest: String::new(),
            verdicts,
            scale,
            niches: centroids.iter().zip(&classes).map(niche).collect(),
        })
    }

    /// The niche of each individual.
    ///
    /// # Errors
    /// [`Misfit`] if features are not finite, or too large.
    pub(crate) fn niches_of(&self, archive: &[Judged]) -> Result<Vec<usize>, Misfit> {
        let mut centroids = Behaviours::new(FEATURES);
        for niche in &self.niches {
            centroids.push(&niche.centroid)?;
        }
        let mut points = Behaviours::new(FEATURES);
        for judged in archive {
            points.push(&scaled(&judged.features, &self.scale))?;
        }
        Ok(Tessellation::about(centroids).cells_of(&points))
    }

    /// Whether the numbers of the reference can be used for computation. The numbers of a damaged file may be unusable.
    pub(crate) fn is_sound(&self) -> bool {
        let fits = |value: &f64| value.abs() <= MAX_FEATURE;
        let scales = self.scale.iter().all(|scale| fits(scale) && *scale > 0.0);
        scales && !self.niches.is_empty() && self.niches.iter().all(|niche| niche.centroid.iter().all(fits))
    }
}

/// The individuals, each with its features. An individual whose mirror image the atlas leaves out comes again, with the features
/// of the image. An atlas of sampled controllers leaves out no mirror image: it samples a controller and its mirror image alike.
fn members<'a>(spec: &CampaignSpec, archive: &'a [Judged]) -> Vec<(Features, &'a Judged)> {
    let is_listed = spec.method() == Method::Exhaustive;
    let listed = is_listed
        .then(|| Enumeration::of(spec.controllers(), spec.world()))
        .flatten();
    let image = |judged: &Judged| -> Option<Features> {
        let image = listed?.mirrored(&judged.controller)?;
        (image != judged.controller).then(|| {
            let mut features = judged.features;
            TURNING
                .iter()
                .for_each(|&place| features[place] = -features[place]);
            features
        })
    };
    let with_image = |judged: &'a Judged| {
        let own = [(judged.features, judged)];
        own.into_iter()
            .chain(image(judged).map(|features| (features, judged)))
    };
    archive.iter().flat_map(with_image).collect()
}

/// The standard deviation of each feature, or 1 where the deviation is 0; `None` without members.
fn deviations(members: &[(Features, &Judged)]) -> Option<Features> {
    if members.is_empty() {
        return None;
    }
    let count = members.len() as f64;
    Some(std::array::from_fn(|place| {
        let values = || members.iter().map(|(features, _)| features[place]);
        let mean = values().sum::<f64>() / count;
        let squares = values().map(|value| (value - mean).powi(2));
        let deviation = (squares.sum::<f64>() / count).sqrt();
        if deviation > 0.0 { deviation } else { 1.0 }
    }))
}

fn scaled(features: &Features, scale: &Features) -> Features {
    std::array::from_fn(|place| features[place] / scale[place])
}

/// The most frequent class; of equally frequent classes, the first.
fn most_frequent(counts: &[u64; Class::ALL.len()]) -> Class {
    let counted = Class::ALL.into_iter().zip(counts);
    let most = counted.rev().max_by_key(|(_, count)| **count);
    most.map_or(Class::Random, |(class, _)| class)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spec(more: &str) -> CampaignSpec {
        let text = format!("name = \"a\"\nmodel = \"single-sensor\"\n{more}");
        CampaignSpec::from_toml(&text).unwrap()
    }

    fn judged(spec: &CampaignSpec, genes: [f64; 4], features: Features, class: Class) -> Judged {
        Judged {
            controller: Controller::new(spec.model(), &genes).unwrap(),
            features,
            behaviour: features.to_vec(),
            verdicts: vec![Verdict::Class(class)],
        }
    }

    #[test]
    fn mirror_images_that_an_atlas_leaves_out_are_there_to_find() {
        let spec = spec("method = \"exhaustive\"\ncontrollers.step = 1.0");
        let turning = judged(
            &spec,
            [0.0, 1.0, 0.0, 1.0],
            [1.0, 2.0, 3.0, 4.0, 5.0],
            Class::Milling,
        );
        let straight = judged(&spec, [1.0, 1.0, 1.0, 1.0], [0.0; 5], Class::Random);
        let reference = Reference::of(&spec, &[turning.clone(), straight], 9, &Interrupt::default()).unwrap();
        assert_eq!(
            reference.verdicts,
            BTreeMap::from([("milling".to_owned(), 2), ("random".to_owned(), 1)])
        );
        let mut members: Vec<(&str, u64)> = reference
            .niches
            .iter()
            .map(|niche| (niche.class.as_str(), niche.members))
            .collect();
        members.sort_unstable();
        assert_eq!(members, [("milling", 1), ("milling", 1), ("random", 1)]);
        let image = Judged {
            features: [1.0, -2.0, 3.0, 4.0, -5.0],
            ..turning.clone()
        };
        let niches = reference.niches_of(&[turning, image]).unwrap();
        assert_ne!(niches[0], niches[1]);
        assert!(
            niches
                .iter()
                .all(|&niche| reference.niches[niche].class == "milling")
        );
    }

    #[test]
    fn a_sampled_atlas_leaves_no_mirror_image_out() {
        let spec = spec("method = \"random\"");
        let turning = |genes, way: f64| judged(&spec, genes, [0.0, way, 0.0, 0.0, way], Class::Milling);
        // A controller and its mirror image: sampling may draw both.
        let archive = [
            turning([0.0, 1.0, 0.0, 1.0], 1.0),
            turning([1.0, 0.0, 1.0, 0.0], -1.0),
        ];
        let reference = Reference::of(&spec, &archive, 9, &Interrupt::default()).unwrap();
        assert_eq!(reference.verdicts, BTreeMap::from([("milling".to_owned(), 2)]));
        let members: Vec<u64> = reference.niches.iter().map(|niche| niche.members).collect();
        assert_eq!(members, [1, 1]);
    }

    #[test]
    fn features_count_alike_whatever_their_units() {
        let spec = spec("method = \"random\"");
        let archive = |unit: f64| -> Vec<Judged> {
            let features = |place: u32| [f64::from(place % 3) * unit, f64::from(place / 3), 0.0, 0.0, 0.0];
            (0..9)
                .map(|place| judged(&spec, [0.0; 4], features(place), Class::Random))
                .collect()
        };
        let niches = |unit| {
            let archive = archive(unit);
            let reference = Reference::of(&spec, &archive, 3, &Interrupt::default()).unwrap();
            reference.niches_of(&archive).unwrap()
        };
        assert_eq!(niches(1.0), niches(1024.0));
    }

    #[test]
    fn of_nothing_there_is_no_reference() {
        let none = Reference::of(&spec("method = \"random\""), &[], 3, &Interrupt::default());
        assert!(matches!(none, Err(ReferenceError::Empty)));
    }
}

//! The map of a version of a taxonomy, as the map was when the version was made.

use crate::asked::Query;
use crate::{archived::Created, of_campaign::OfCampaign, page_error::PageError};
use axum::{http::header::CONTENT_TYPE, response::IntoResponse};
use murmuration_engine::{blocking::in_background, maps::Maps, space::SpaceError, taxonomy::Change};
use murmuration_model::{
    CampaignRecord,
    colours::{self, LINE, Rgb},
};
use murmuration_report::point_map;
use murmuration_service::OrStatus as _;
use murmuration_store::{Store, StoredTaxonomy, TaxonomyVersion};
use serde::Deserialize;

/// Side of the picture, and radius of a point, in pixels.
const SIDE: usize = 720;
const DOT: i64 = 3;

/// Selects the map of a version.
#[derive(Debug, Deserialize)]
pub(crate) struct Which {
    version: u32,
    /// The later version: a cluster has the colour of its successor in this version.
    after: u32,
}

/// The colour of each cluster of a version: the colour of its successor in the version to which `change` leads. A cluster without
/// a successor has the colour of lines.
pub(super) fn colours_before(change: &Change, clusters: usize) -> Vec<Rgb> {
    let colour = |before| change.successor(before).map_or(LINE, colours::cluster);
    (0..clusters).map(colour).collect()
}

/// Places of a version's individuals on the version's map; empty if unknown.
pub(super) fn points(
    store: &Store,
    maps: &Maps,
    record: &CampaignRecord,
    version: &TaxonomyVersion,
) -> Result<Vec<[f64; 2]>, SpaceError> {
    let kept = store.taxonomy_points(&record.id, version.version)?;
    let mut points = match kept.is_empty() && version.stands {
        true => maps.axes(record)?.points.clone(),
        false => kept.into_iter().map(|point| point.map(f64::from)).collect(),
    };
    stretch(&mut points);
    Ok(points)
}

/// Stretches the shorter axis to at least half the length of the longer axis. Without this, the rings of behaviours that are
/// almost on a line would overlap.
fn stretch(points: &mut [[f64; 2]]) {
    let length = |axis: usize| {
        let values = points.iter().map(|point| point[axis]);
        let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
            [low.min(value), high.max(value)]
        });
        high - low
    };
    let lengths = [length(0), length(1)];
    for (axis, other) in [(0, 1), (1, 0)] {
        let factor = 0.5 * lengths[other] / lengths[axis];
        if factor.is_finite() && factor > 1.0 {
            points.iter_mut().for_each(|point| point[axis] *= factor);
        }
    }
}

/// The picture of the individuals of a version, in the colours of the version's clusters.
pub(crate) async fn picture(
    Query(which): Query<Which>,
    Query(created): Query<Created>,
    OfCampaign { web, record, .. }: OfCampaign,
) -> Result<impl IntoResponse, PageError> {
    let kept = created.keep(&record);
    let (store, maps) = (web.store.clone(), web.maps.clone());
    let drawn = in_background(move |_| draw(&store, &maps, &record, &which)).await?;
    let drawn = drawn.or_status()?.ok_or(PageError::NoPage)?;
    let png = in_background(move |_| point_map::png(&drawn, SIDE, DOT)).await??;
    Ok(([(CONTENT_TYPE, "image/png"), kept], png))
}

type Dots = Vec<([f64; 2], Rgb)>;

fn draw(
    store: &Store,
    maps: &Maps,
    record: &CampaignRecord,
    which: &Which,
) -> Result<Option<Dots>, SpaceError> {
    let versions = store.taxonomy_versions(&record.id)?;
    let Some(version) = versions.iter().find(|known| known.version == which.version) else {
        return Ok(None);
    };
    let Some(stored) = store.taxonomy_of_version(&record.id, which.version)? else {
        return Ok(None);
    };
    let colours = match which.after == which.version {
        true => (0..stored.medoids.len()).map(colours::cluster).collect(),
        false => match store.taxonomy_of_version(&record.id, which.after)? {
            Some(after) => colours_before(&Change::between(&stored, &after), stored.medoids.len()),
            None => return Ok(None),
        },
    };
    let points = points(store, maps, record, version)?;
    Ok(Some(dots(&points, &stored, &colours)))
}

/// The points with their colours; clusters without a successor are painted below the other clusters.
fn dots(points: &[[f64; 2]], stored: &StoredTaxonomy, colours: &[Rgb]) -> Dots {
    let coloured = points.iter().zip(&stored.clusters);
    let mut dots: Dots = coloured
        .map(|(point, cluster)| (*point, colours.get(*cluster as usize).copied().unwrap_or(LINE)))
        .collect();
    dots.sort_by_key(|(_, colour)| *colour != LINE);
    dots
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_is_stretched_to_half_of_the_other_and_none_is_shortened() {
        let stretched = |mut points: Vec<[f64; 2]>| {
            stretch(&mut points);
            points
        };
        assert_eq!(stretched(vec![[0.0, 1.0], [8.0, 2.0]]), [[0.0, 4.0], [8.0, 8.0]]);
        assert_eq!(stretched(vec![[0.0, 0.0], [1.0, 4.0]]), [[0.0, 0.0], [2.0, 4.0]]);
        for kept in [vec![[0.0, 1.0], [2.0, 2.0]], vec![[0.0, 1.0], [2.0, 1.0]], vec![]] {
            assert_eq!(stretched(kept.clone()), kept);
        }
    }
}

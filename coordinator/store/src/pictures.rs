//! Rows of datasets, on which embedders are trained, and of saved trainings.

use super::{
    Provenance, Store, StoreError,
    campaigns::number_of,
    images::{Decompressor, StoredImage, columns},
    numbers::{blob_to_floats, clamped, floats_to_blob},
    provenance::{ResultKind, add_provenance},
};
use murmuration_model::{CampaignId, SavedTraining};
use murmuration_swarm::{CapabilityModel, Controller, Features};
use rusqlite::{OptionalExtension as _, params};
use std::ops::Range;

/// A picture of a dataset. `I` is the type of the image, see [`StoredImage`].
#[derive(Debug, Clone, PartialEq)]
pub struct Picture<I = Vec<u8>> {
    pub controller: Controller,
    pub seed: u64,
    /// Grey values, as in an evaluation.
    pub image: I,
    /// `None` for a picture that was simulated before the store kept features.
    pub features: Option<Features>,
}

impl Store {
    /// Adds pictures to a campaign's dataset, the first at `place`, and their provenance, in one transaction.
    ///
    /// # Errors
    /// If the pictures cannot be written; none is written then.
    pub fn add_pictures<I: StoredImage>(
        &self,
        campaign: &CampaignId,
        place: u64,
        pictures: &[Picture<I>],
        provenance: &Provenance,
    ) -> Result<(), StoreError> {
        // The images are compressed before the connection is locked, so that no other write waits for the compression.
        let images = columns(pictures.iter().map(|picture| Some(vec![&picture.image])))?;
        self.write(|transaction| {
            let number = number_of(transaction, campaign)?;
            let mut statement = transaction.prepare(
                "INSERT INTO pictures (campaign, place, controller, seed, image, features)
                     VALUES (?1, ?2, ?3, ?4, ?5, ?6)",
            )?;
            for (place, (picture, image)) in (place..).zip(pictures.iter().zip(&images)) {
                statement.execute(params![
                    number,
                    clamped(place),
                    floats_to_blob(picture.controller.genes()),
                    picture.seed.cast_signed(),
                    image,
                    floats_to_blob(picture.features.as_ref().map_or(&[], |features| &features[..])),
                ])?;
            }
            add_provenance(transaction, number, ResultKind::Picture, place, provenance)
        })
    }

    /// The picture of a dataset at `place`.
    pub fn picture(
        &self,
        campaign: &CampaignId,
        model: &CapabilityModel,
        place: u64,
    ) -> Result<Picture, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let mut images = Decompressor::of_dataset(connection, number)?;
            let damaged = |what: &dyn std::fmt::Display| {
                StoreError::damaged(format!("picture {place} of {campaign}: {what}"))
            };
            let (genes, seed, column, features) = connection.query_row(
                "SELECT controller, seed, image, features FROM pictures WHERE campaign = ?1 AND place = ?2",
                params![number, clamped(place)],
                |row| {
                    Ok((
                        row.get::<_, Vec<u8>>(0)?,
                        row.get::<_, i64>(1)?,
                        row.get::<_, Vec<u8>>(2)?,
                        row.get::<_, Vec<u8>>(3)?,
                    ))
                },
            )?;
            Ok(Picture {
                controller: Controller::new(model, &blob_to_floats(&genes))
                    .map_err(|error| damaged(&error))?,
                seed: seed.cast_unsigned(),
                image: images
                    .decompress(&column)
                    .map_err(|error| damaged(&format_args!("it is {error}")))?,
                features: match features.as_slice() {
                    [] => None,
                    features => Some(
                        features_of(features)
                            .ok_or_else(|| damaged(&"its features are not five finite numbers"))?,
                    ),
                },
            })
        })
    }

    /// The features of a dataset's controllers in `range`, each from the controller's first start; fewer if the dataset ends
    /// before.
    ///
    /// # Errors
    /// If the features cannot be read, or are damaged.
    pub fn dataset_features(
        &self,
        campaign: &CampaignId,
        starts: u64,
        range: Range<u64>,
    ) -> Result<Vec<Features>, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let mut statement = connection.prepare_cached(
                "SELECT place, features FROM pictures
                 WHERE campaign = ?1 AND place >= ?2 AND place < ?3 AND place % ?4 = 0 ORDER BY place",
            )?;
            let [first, end] = [range.start, range.end].map(|place| clamped(place.saturating_mul(starts)));
            let mut rows = statement.query(params![number, first, end, clamped(starts.max(1))])?;
            let mut all = Vec::new();
            while let Some(row) = rows.next()? {
                let features = row.get_ref(1)?.as_blob().map_err(rusqlite::Error::from)?;
                let features = features_of(features).ok_or_else(|| {
                    let place = row.get::<_, i64>(0).unwrap_or_default();
                    StoreError::damaged(format!(
                        "picture {place} of {campaign}: its features are not five finite numbers"
                    ))
                })?;
                all.push(features);
            }
            Ok(all)
        })
    }

    /// The images of a dataset at the places `range`, in order, one after the other; fewer if the dataset ends before.
    pub(crate) fn dataset_images(
        &self,
        campaign: &CampaignId,
        range: Range<u64>,
    ) -> Result<Vec<u8>, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let mut statement = connection.prepare_cached(
                "SELECT place, image FROM pictures WHERE campaign = ?1 AND place >= ?2 AND place < ?3 ORDER BY place",
            )?;
            let bounds = params![number, clamped(range.start), clamped(range.end)];
            let mut decompressor = Decompressor::of_dataset(connection, number)?;
            let mut rows = statement.query(bounds)?;
            let mut images = Vec::new();
            while let Some(row) = rows.next()? {
                let column = row.get_ref(1)?.as_blob().map_err(rusqlite::Error::from)?;
                let image = decompressor.decompress(column).map_err(|error| {
                    let place = row.get::<_, i64>(0).unwrap_or_default();
                    StoreError::damaged(format!("picture {place} of {campaign}: it is {error}"))
                })?;
                images.extend(image);
            }
            Ok(images)
        })
    }

    /// Saves a campaign's training, which replaces the training saved before.
    pub fn save_training(&self, campaign: &CampaignId, training: &SavedTraining) -> Result<(), StoreError> {
        self.write(|transaction| {
            let number = number_of(transaction, campaign)?;
            transaction.execute(
                "INSERT INTO trainings (campaign, epoch, saved) VALUES (?1, ?2, ?3)
                 ON CONFLICT (campaign) DO UPDATE SET epoch = excluded.epoch, saved = excluded.saved",
                params![number, clamped(training.epoch), training.bytes],
            )?;
            Ok(())
        })
    }

    /// The saved training of a campaign, if any.
    pub fn saved_training(&self, campaign: &CampaignId) -> Result<Option<SavedTraining>, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let found = connection.query_row(
                "SELECT epoch, saved FROM trainings WHERE campaign = ?1",
                [number],
                |row| {
                    Ok(SavedTraining {
                        epoch: row.get::<_, i64>(0)?.unsigned_abs(),
                        bytes: row.get(1)?,
                    })
                },
            );
            Ok(found.optional()?)
        })
    }
}

fn features_of(blob: &[u8]) -> Option<Features> {
    let features = Features::try_from(blob_to_floats(blob)).ok()?;
    features.iter().all(|value| value.is_finite()).then_some(features)
}

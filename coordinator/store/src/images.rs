//! The images in the columns of a campaign.

use super::StoreError;
use murmuration_swarm::{self as swarm, CampaignSpec, CompressedImage, Compressor, NoImage};
use rusqlite::Connection;

/// An image that a column can hold: grey values, or what a worker compressed.
pub trait StoredImage {
    /// Appends the zstd frame of the image.
    ///
    /// # Errors
    /// [`StoreError::Compression`] if there is no memory to compress it.
    fn append(&self, compressor: &mut Compressor, column: &mut Vec<u8>) -> Result<(), StoreError>;
}

impl StoredImage for Vec<u8> {
    fn append(&self, compressor: &mut Compressor, column: &mut Vec<u8>) -> Result<(), StoreError> {
        let image = compressor.compress(self).map_err(StoreError::Compression)?;
        column.extend_from_slice(image.frame());
        Ok(())
    }
}

impl StoredImage for CompressedImage {
    fn append(&self, _: &mut Compressor, column: &mut Vec<u8>) -> Result<(), StoreError> {
        column.extend_from_slice(self.frame());
        Ok(())
    }
}

/// The values of a column, each with some images or `None`.
pub(super) fn columns<'a, I: StoredImage + 'a>(
    rows: impl Iterator<Item = Option<Vec<&'a I>>>,
) -> Result<Vec<Option<Vec<u8>>>, StoreError> {
    let mut compressor = Compressor::new().map_err(StoreError::Compression)?;
    let mut column = |images: Vec<&I>| {
        let mut column = Vec::new();
        for image in images {
            image.append(&mut compressor, &mut column)?;
        }
        Ok(column)
    };
    rows.map(|images| images.map(&mut column).transpose()).collect()
}

/// Decompresses the images of one campaign, all of which are of one size.
pub(super) struct Decompressor(swarm::Decompressor);

impl Decompressor {
    /// For the pictures of the dataset of the campaign with this number: one picture per value.
    ///
    /// # Errors
    /// If the campaign's specification cannot be read, and [`StoreError::Compression`] if there is no memory.
    pub(super) fn of_dataset(connection: &Connection, campaign: i64) -> Result<Self, StoreError> {
        Self::new(spec(connection, campaign)?.image().bytes())
    }

    /// For the pictures of a campaign's individuals: those of all trials in one value.
    ///
    /// # Errors
    /// As [`Decompressor::of_dataset`].
    pub(super) fn of_individuals(connection: &Connection, campaign: i64) -> Result<Self, StoreError> {
        Self::new(spec(connection, campaign)?.individual_bytes())
    }

    fn new(pixels: usize) -> Result<Self, StoreError> {
        let images = swarm::Decompressor::new(pixels).map_err(StoreError::Compression)?;
        Ok(Self(images))
    }

    /// Decompresses the image in the value of a column.
    ///
    /// # Errors
    /// See [`NoImage`].
    pub(super) fn decompress(&mut self, column: &[u8]) -> Result<Vec<u8>, NoImage> {
        self.0.decompress(column)
    }
}

fn spec(connection: &Connection, campaign: i64) -> Result<CampaignSpec, StoreError> {
    let mut statement = connection.prepare_cached("SELECT spec FROM campaigns WHERE number = ?1")?;
    let spec: String = statement.query_row([campaign], |row| row.get(0))?;
    CampaignSpec::from_toml(&spec).map_err(|error| StoreError::damaged(error.to_string()))
}

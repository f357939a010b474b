//! An export that was checked: every file against its digest, then every value of the campaign's database.

use crate::{
    DATABASE, ExportError,
    digests::{self, Digests},
};
use murmuration_model::CampaignId;
use murmuration_store::transfer::{ReceivedCampaign, Unsound};
use std::{
    fs::File,
    io::Read as _,
    path::{Path, PathBuf},
};

/// The database of a campaign in a folder, to be read from the beginning.
#[derive(Debug)]
pub struct CheckedExport {
    path: PathBuf,
    file: File,
    campaign: CampaignId,
}

impl CheckedExport {
    /// Checks the export in `folder`.
    ///
    /// # Errors
    /// [`ExportError::Damaged`] names the file that is missing, was changed or does not belong to an export.
    pub fn open(folder: &Path) -> Result<Self, ExportError> {
        let path = folder.join(DATABASE);
        if !Digests::check(folder)?.has(DATABASE) {
            let reason = format!(
                "it does not list {DATABASE}: an earlier version exported this folder; export the campaign again"
            );
            return Err(ExportError::damaged(&folder.join(digests::FILE), reason));
        }
        let damaged = |error: Unsound| ExportError::damaged(&path, error);
        let received = ReceivedCampaign::open(&path).map_err(damaged)?;
        received.archive(|_| Ok(())).map_err(damaged)?;
        Ok(Self {
            file: digests::open(&path)?,
            campaign: received.campaign().record.id.clone(),
            path,
        })
    }

    #[must_use]
    pub const fn campaign(&self) -> &CampaignId {
        &self.campaign
    }

    /// The next bytes, at most `bytes` of them; empty at the end.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn next(&mut self, bytes: usize) -> Result<Vec<u8>, ExportError> {
        let mut next = Vec::new();
        let read = (&mut self.file).take(bytes as u64).read_to_end(&mut next);
        read.map_err(ExportError::file("read", &self.path))?;
        Ok(next)
    }
}

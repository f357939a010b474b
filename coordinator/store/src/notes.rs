//! Tags and notes of campaigns.

use super::{
    Store, StoreError,
    campaigns::{notes, number_of},
};
use murmuration_model::{CampaignId, NotesChange};
use murmuration_swarm::Invalid;
use rusqlite::params;

/// Why the tags and the note of a campaign were not changed.
#[derive(Debug, thiserror::Error)]
pub enum NotesError {
    /// The store could not be read or written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The campaign would have too many tags, or its note has changed since the request was made.
    #[error(transparent)]
    Invalid(#[from] Invalid),
}

impl Store {
    /// Changes the tags and the note of a campaign.
    ///
    /// # Errors
    /// [`NotesError`]; nothing has changed then, unless it is [`StoreError::Unmirrored`].
    pub fn change_notes(&self, campaign: &CampaignId, change: NotesChange) -> Result<(), NotesError> {
        self.write(|transaction| {
            let number = number_of(transaction, campaign)?;
            let before = "SELECT tags, note FROM campaigns WHERE number = ?1";
            let before = transaction.query_row(before, [number], |row| Ok(notes(row)))??;
            let after = match before.after(change) {
                Ok(after) => after,
                Err(refused) => return Ok(Err(refused)),
            };
            let update = "UPDATE campaigns SET tags = ?2, note = ?3 WHERE number = ?1";
            transaction.execute(
                update,
                params![number, after.tags.to_string(), after.note.as_str()],
            )?;
            Ok(Ok(()))
        })??;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DataDirectory;
    use murmuration_model::{CampaignNotes, Weight};
    use murmuration_swarm::CampaignSpec;

    #[test]
    fn tags_and_note_are_kept_and_too_many_tags_change_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
        let spec = CampaignSpec::from_toml("model = \"single-sensor\"\nmethod = \"random\"").unwrap();
        let id = store.create_campaign(&spec, Weight::default(), 5).unwrap();
        let tags =
            |numbers: std::ops::Range<u32>| numbers.map(|number| format!("t{number:02}").parse().unwrap());
        let change = NotesChange {
            add: tags(0..16).collect(),
            note: Some("two\nlines".parse().unwrap()),
            ..NotesChange::default()
        };
        store.change_notes(&id, change.clone()).unwrap();
        let noted = CampaignNotes::default().after(change).unwrap();
        let more = NotesChange {
            add: tags(16..17).collect(),
            note: Some("lost".parse().unwrap()),
            ..NotesChange::default()
        };
        let refused = store.change_notes(&id, more.clone()).unwrap_err();
        assert!(matches!(refused, NotesError::Invalid(_)), "{refused}");
        assert_eq!(store.campaign(id.as_str()).unwrap().notes, noted);
        assert_eq!(store.campaign_heads().unwrap()[0].notes, noted);
        let instead = NotesChange {
            remove: tags(0..2).collect(),
            ..more
        };
        store.change_notes(&id, instead).unwrap();
        let notes = store.campaign(id.as_str()).unwrap().notes;
        assert_eq!((notes.tags.iter().count(), notes.note.as_str()), (15, "lost"));
        let unknown = store.change_notes(&"other-2".parse().unwrap(), NotesChange::default());
        assert!(matches!(
            unknown,
            Err(NotesError::Store(StoreError::NoCampaign(_)))
        ));
    }
}

//! Tags and notes of campaigns: what people write about a campaign. Neither changes the campaign's specification, results or
//! digest.

use murmuration_proto::v1;
use murmuration_swarm::{
    Invalid, Text, counted,
    text::{name, quoted},
};
use std::{collections::BTreeSet, fmt, str::FromStr};

/// A tag of a campaign: a word of 1 to 32 letters, digits, `-`, `_`, `.` and `:`, with a letter or digit first.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Tag(String);

/// The tags of a campaign, at most 16, in alphabetical order. As text, they have spaces between them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Tags(BTreeSet<Tag>);

/// A text about a campaign, of at most 4,000 characters, without hidden characters and without spaces at its ends. Without a
/// note, the text is empty.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Note(Text);

/// The tags and the note of a campaign.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct CampaignNotes {
    pub tags: Tags,
    pub note: Note,
}

/// A change of the tags and the note of a campaign.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct NotesChange {
    /// Tags to add; tags that the campaign has already change nothing.
    pub add: BTreeSet<Tag>,
    /// Tags to remove; tags that the campaign does not have change nothing.
    pub remove: BTreeSet<Tag>,
    /// The new note; `None` keeps the note.
    pub note: Option<Note>,
    /// The note that the new note replaces; `None` replaces any note.
    pub former_note: Option<Note>,
}

impl Tag {
    /// Maximum number of characters of a tag.
    pub const MOST: usize = 32;

    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for Tag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl FromStr for Tag {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        let tag = name("tag", text, Self::MOST)?;
        let mark = |letter: char| "-_.:".contains(letter);
        if tag.starts_with(mark) || !tag.chars().all(|letter| letter.is_alphanumeric() || mark(letter)) {
            let allowed = "letters, digits, '-', '_', '.' and ':', with a letter or digit first";
            return Err(Invalid::new("tag", quoted(text), allowed));
        }
        Ok(Self(tag))
    }
}

impl Tags {
    /// Maximum number of tags of a campaign.
    pub const MOST: usize = 16;

    pub fn iter(&self) -> impl Iterator<Item = &Tag> {
        self.0.iter()
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether a tag is equal to `tag`.
    pub fn have(&self, tag: &str) -> bool {
        self.iter().any(|own| own.as_str() == tag)
    }
}

impl TryFrom<BTreeSet<Tag>> for Tags {
    type Error = Invalid;

    fn try_from(tags: BTreeSet<Tag>) -> Result<Self, Invalid> {
        match tags.len() {
            0..=Self::MOST => Ok(Self(tags)),
            count => Err(Invalid::new(
                "tags",
                counted(count as u64, "tag"),
                format!("at most {}", Self::MOST),
            )),
        }
    }
}

impl fmt::Display for Tags {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, tag) in self.iter().enumerate() {
            if place > 0 {
                f.write_str(" ")?;
            }
            tag.fmt(f)?;
        }
        Ok(())
    }
}

impl FromStr for Tags {
    type Err = Invalid;

    /// Reads tags with spaces, line ends or commas between them.
    fn from_str(text: &str) -> Result<Self, Invalid> {
        let words = text.split(|letter: char| letter.is_whitespace() || letter == ',');
        let tags = words.filter(|word| !word.is_empty()).map(str::parse);
        tags.collect::<Result<BTreeSet<Tag>, _>>()?.try_into()
    }
}

impl Note {
    /// Maximum number of characters of a note.
    pub const MOST: usize = 4_000;

    pub fn as_str(&self) -> &str {
        self.0.as_str()
    }
}

impl FromStr for Note {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        // Forms of browsers send lines that end with CR LF.
        let text = text.replace("\r\n", "\n");
        let text = text.trim();
        match text.chars().count() {
            0..=Self::MOST => Ok(Self(Text::lines(text))),
            count => Err(Invalid::new(
                "note",
                counted(count as u64, "character"),
                format!("at most {} characters", Self::MOST),
            )),
        }
    }
}

impl CampaignNotes {
    /// The tags and the note after a change. A tag that the change both adds and removes is added.
    ///
    /// # Errors
    /// If the campaign would have too many tags, or if the note is no longer the one that the change replaces.
    pub fn after(&self, change: NotesChange) -> Result<Self, Invalid> {
        if let (Some(note), Some(former)) = (&change.note, &change.former_note)
            && ![note, former].contains(&&self.note)
        {
            let now = quoted(self.note.as_str());
            let allowed = format!("joined with the note that somebody has written since: {now}");
            return Err(Invalid::new("note", quoted(note.as_str()), allowed));
        }
        let kept = self
            .tags
            .iter()
            .filter(|tag| !change.remove.contains(tag))
            .cloned();
        let tags: BTreeSet<Tag> = kept.chain(change.add).collect();
        Ok(Self {
            tags: tags.try_into()?,
            note: change.note.unwrap_or_else(|| self.note.clone()),
        })
    }
}

impl TryFrom<v1::NoteCampaignRequest> for NotesChange {
    type Error = Invalid;

    fn try_from(message: v1::NoteCampaignRequest) -> Result<Self, Invalid> {
        let tags = |tags: Vec<String>| tags.iter().map(|tag| tag.parse()).collect::<Result<_, _>>();
        Ok(Self {
            add: tags(message.add_tags)?,
            remove: tags(message.remove_tags)?,
            note: message.note.map(|note| note.parse()).transpose()?,
            former_note: None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tag_is_a_short_word() {
        for good in ["baseline", "v1.2", "Größe", "run:3", "2026-11", &"x".repeat(32)] {
            assert_eq!(good.parse::<Tag>().unwrap().as_str(), good);
        }
        for bad in [
            "",
            "two words",
            "a,b",
            "-v",
            "a\u{200b}",
            "<b>",
            "a/b",
            &"x".repeat(33),
        ] {
            assert_eq!(bad.parse::<Tag>().unwrap_err().field, "tag", "{bad}");
        }
    }

    #[test]
    fn tags_are_sorted_and_at_most_16() {
        let tags: Tags = " b, a\nc a ".parse().unwrap();
        assert_eq!(tags.to_string(), "a b c");
        assert!(tags.have("b") && !tags.have("B") && !tags.is_empty());
        assert_eq!(tags.to_string().parse(), Ok(tags));
        let many: Vec<String> = (0..17).map(|number| format!("t{number}")).collect();
        assert!(many[..16].join(" ").parse::<Tags>().is_ok());
        let refused = many.join(" ").parse::<Tags>().unwrap_err().to_string();
        assert_eq!(refused, "tags = 17 tags: must be at most 16");
    }

    #[test]
    fn a_note_is_a_text_of_bounded_length_without_hidden_characters() {
        let note = |text: &str| text.parse::<Note>().map(|note| note.as_str().to_owned());
        assert_eq!(note(" one\r\ntwo\u{1b}[2J\n"), Ok("one\ntwo[2J".to_owned()));
        assert_eq!(note("é".repeat(4_000).as_str()), Ok("é".repeat(4_000)));
        assert_eq!(note(&"é".repeat(4_001)).unwrap_err().field, "note");
    }

    #[test]
    fn a_change_keeps_what_it_does_not_name() {
        let notes = CampaignNotes {
            tags: "a b".parse().unwrap(),
            note: "first".parse().unwrap(),
        };
        let message = v1::NoteCampaignRequest {
            campaign: "latest".to_owned(),
            add_tags: vec!["c".to_owned(), "b".to_owned()],
            remove_tags: vec!["a".to_owned(), "b".to_owned(), "x".to_owned()],
            note: None,
        };
        let after = |message: v1::NoteCampaignRequest| notes.after(message.try_into().unwrap()).unwrap();
        assert_eq!(after(message.clone()).tags.to_string(), "b c");
        assert_eq!(after(message.clone()).note, notes.note);
        let message = v1::NoteCampaignRequest {
            note: Some(String::new()),
            ..message
        };
        assert_eq!(after(message).note, Note::default());
    }
}

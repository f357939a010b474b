//! `note`: tags of a campaign, and its note.

use super::{
    CliError, Global,
    connection::{self, Connection},
    json,
    validation::validated,
};
use murmuration_coordinator::local::InProcess;
use murmuration_link::{errln, outln};
use murmuration_model::{Note, Tag};
use murmuration_proto::v1;

#[derive(Debug, clap::Args)]
#[command(
    group = clap::ArgGroup::new("change").args(["tag", "untag", "text"]).required(true).multiple(true),
    after_help = "\
Tags and note are for people: they change neither results nor digests. `show` prints both; `list` prints the tags. An export \
contains them.

Examples:
  murmuration note latest --tag baseline --tag paper
  murmuration note latest --untag paper --text 'Repeat with more noise'
  murmuration list --tag baseline"
)]
pub struct NoteCommand {
    /// Campaign id, or `latest`
    campaign: String,
    /// Add a tag: 1 to 32 letters, digits, '-', '_', '.' and ':'; a campaign has at most 16 tags
    #[arg(long, value_name = "TAG")]
    tag: Vec<Tag>,
    /// Remove a tag
    #[arg(long, value_name = "TAG")]
    untag: Vec<Tag>,
    /// Replace the note, at most 4,000 characters; '' removes it
    #[arg(long, value_name = "TEXT", allow_hyphen_values = true)]
    text: Option<Note>,
}

impl NoteCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let words = |tags: Vec<Tag>| tags.iter().map(ToString::to_string).collect();
        let request = v1::NoteCampaignRequest {
            campaign: self.campaign,
            add_tags: words(self.tag),
            remove_tags: words(self.untag),
            note: self.text.map(|note| note.as_str().to_owned()),
        };
        let note =
            async |connection: &mut Connection| validated(connection.client.note_campaign(request).await?);
        let campaign = connection::with(global, InProcess::NONE, note).await?;
        if global.json {
            return Ok(json::print(json::Document(&campaign))?);
        }
        outln!("{}", campaign.id)?;
        let tags = match campaign.tags.as_slice() {
            [] => "no tags".to_owned(),
            tags => format!("the tags {}", tags.join(", ")),
        };
        let note = if campaign.note.is_empty() {
            "no note"
        } else {
            "a note"
        };
        let next = global.next(&format!("show {}", campaign.id));
        errln!("campaign {} has {tags}, and {note}; next: {next}", campaign.id);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        note: NoteCommand,
    }

    #[test]
    fn a_note_may_begin_with_a_hyphen() {
        for text in ["- repeat", "-", "--noise is too low"] {
            let line = Line::try_parse_from(["note", "small-1", "--text", text, "--tag", "paper"]).unwrap();
            assert_eq!(line.note.text.unwrap().as_str(), text);
            assert_eq!(line.note.tag.len(), 1);
        }
    }
}

//! `link`: a link that opens the pages of a coordinator in a browser.

use super::{CliError, Global, json};
use murmuration_access::one_time_code;
use murmuration_link::{AccessFile, Target, access_file_of, outln};

/// Prints a link that logs a browser in once, within 15 minutes.
#[derive(Debug, clap::Args)]
pub struct LinkCommand {}

impl LinkCommand {
    pub(super) fn execute(self, global: &Global) -> Result<(), CliError> {
        if let Some(Target::Url { .. }) = global.target()? {
            let message = "a link needs the access file of the coordinator: name it with --access FILE instead of --coordinator";
            return Err(CliError::Input(message.to_owned()));
        }
        let of_data = access_file_of(&global.data);
        let path = global.trust.access.as_deref().unwrap_or(&of_data);
        let access = AccessFile::read(path).map_err(|error| match error.is_missing() {
            true => CliError::Input(format!(
                "there is no access file {}: `murmuration serve` writes it",
                path.display()
            )),
            false => CliError::Input(error.to_string()),
        })?;
        let link = page_link(&access)?;
        match global.json {
            true => json::print(json::Link { link })?,
            false => outln!("{link}")?,
        }
        Ok(())
    }
}

/// The address of a coordinator's pages, with a code that logs a browser in if the coordinator requires tokens.
pub(super) fn page_link(access: &AccessFile) -> Result<String, CliError> {
    let pages = &access.pages;
    match &access.token {
        Some(token) => {
            let code = one_time_code(token).map_err(CliError::failed)?;
            Ok(format!("{pages}/open?code={code}"))
        }
        None => Ok(pages.clone()),
    }
}

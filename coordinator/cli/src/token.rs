//! `token`: creates a secret for a person, shown once.

use super::{CliError, json};
use murmuration_access::{HolderName, Role, file_entry};
use murmuration_link::{Token, errln, print};

const EXAMPLES: &str = "\
Examples:
  murmuration token ana --role annotator >> tokens.toml   show the token, and add its entry for `serve --tokens`

The token is shown only once. Save it in a file that only you can read, and name that file in MURMURATION_TOKEN_FILE.";

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct TokenCommand {
    /// Name of the person, 1 to 64 characters of any script
    name: HolderName,
    /// What the person may do
    #[arg(long)]
    role: Role,
}

impl TokenCommand {
    pub(super) fn execute(self, as_json: bool) -> Result<(), CliError> {
        let token = Token::generate()
            .map_err(|error| CliError::Failed(format!("the system gives no random numbers: {error}")))?;
        let file_entry = file_entry(&self.name, self.role, token.digest())
            .map_err(|error| CliError::Failed(format!("the entry cannot be written: {error}")))?;
        if as_json {
            json::print(json::Token {
                name: self.name.to_string(),
                role: self.role.to_string(),
                token: token.reveal().to_owned(),
                digest: token.digest().to_string(),
            })?;
            return Ok(());
        }
        print(file_entry)?;
        errln!("token of {}, shown only once: {}", self.name, token.reveal());
        errln!("stdout is the entry for the file of `murmuration serve --tokens`");
        Ok(())
    }
}

//! `token`: a secret for somebody, shown once.

use super::{CliError, json};
use murmuration_access::{HolderName, Role, entry};
use murmuration_link::{Token, errln, print};
use serde_json::json;

const EXAMPLES: &str = "\
Examples:
  murmuration token ana --role annotator >> tokens.toml   shows the token, and adds the lines for `serve --tokens`

The token is shown this once. Keep it in a file that you alone can read, and name that in MURMURATION_TOKEN_FILE.";

/// Arguments of `token`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct TokenCommand {
    /// Whom it is for: 1 to 64 characters of any script
    name: HolderName,
    /// What it is good for
    #[arg(long)]
    role: Role,
}

impl TokenCommand {
    pub(super) fn execute(self, as_json: bool) -> Result<(), CliError> {
        let token =
            Token::generate().map_err(|error| CliError::Failed(format!("no random numbers: {error}")))?;
        let entry = entry(&self.name, self.role, token.digest())
            .map_err(|error| CliError::Failed(format!("the entry cannot be written: {error}")))?;
        if as_json {
            json::print(&json!({
                "schema": json::SCHEMA,
                "name": self.name.to_string(),
                "role": self.role,
                "token": token.reveal(),
                "digest": token.digest().to_string(),
            }))?;
            return Ok(());
        }
        print(entry)?;
        errln!("the token of {}, shown this once: {}", self.name, token.reveal());
        errln!("what went to stdout is for the file that `murmuration serve --tokens` names");
        Ok(())
    }
}

//! Output of a process: data on standard output, messages for people on standard error.
//!
//! The standard library's macros panic if the stream cannot be written, for example after a pipe's reader has exited or on a full
//! disk. In this module, writing to standard output returns the error. A message that cannot be written to standard error is
//! dropped, because no other stream can report it.
//!
//! This module removes hidden characters from messages, and from data on a terminal. So text from files or other machines cannot
//! move the cursor or reverse the text around it.

use clap::{
    Command, Parser,
    error::{ContextKind, ContextValue, ErrorKind},
};
use murmuration_swarm::{Text, text};
use std::{
    env,
    ffi::OsString,
    fmt,
    io::{self, IsTerminal as _, Write as _},
    process::ExitCode,
};

/// Why data did not reach standard output.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The reader of standard output exited, as in `murmuration list | head -1`.
    #[error("nobody reads standard output any more")]
    Closed,
    /// Writing failed, for instance because the disk is full.
    #[error("cannot write to standard output: {0}")]
    Write(io::Error),
}

impl From<io::Error> for OutputError {
    fn from(error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::BrokenPipe => Self::Closed,
            _ => Self::Write(error),
        }
    }
}

impl OutputError {
    /// The exit code of a process that ends with this error: 0 if the reader left, because it had read enough; otherwise 1.
    #[must_use]
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Closed => ExitCode::SUCCESS,
            Self::Write(_) => ExitCode::FAILURE,
        }
    }
}

/// Prints text on standard output and flushes it; see [`outln!`](crate::outln). Removes hidden characters if standard output is a
/// terminal, but not if it is a file or pipe.
///
/// # Errors
/// [`OutputError`].
pub fn print(text: impl fmt::Display) -> Result<(), OutputError> {
    let mut stdout = io::stdout().lock();
    match stdout.is_terminal() {
        true => stdout.write_all(text::printable(&text.to_string()).as_bytes())?,
        false => write!(stdout, "{text}")?,
    }
    Ok(stdout.flush()?)
}

/// Writes a message to standard error, without hidden characters and of bounded length. Drops the message if writing fails. See
/// [`errln!`](crate::errln).
pub fn say(words: impl fmt::Display) {
    let words = text::message(&with_words_in_line(words.to_string(), env::args_os()));
    // A single write per message keeps the lines of several processes apart.
    let _ = io::stderr().lock().write_all(format!("{words}\n").as_bytes());
}

/// Removes the line ends within these words of the command line from `message`. A file name with line ends must not look like
/// several lines of output.
fn with_words_in_line(message: String, words: impl Iterator<Item = OsString>) -> String {
    words.fold(message, |message, word| {
        let word = word.to_string_lossy();
        let value = word.split_once('=').map_or(&*word, |(_, value)| value);
        match value.contains('\n') {
            true => message.replace(value, Text::line(value).as_str()),
            false => message,
        }
    })
}

/// Prints a line of data on standard output: like `println!`, but returns a `Result` ([`OutputError`]) instead of panicking.
#[macro_export]
macro_rules! outln {
    ($($text:tt)*) => { $crate::print(format_args!("{}\n", format_args!($($text)*))) };
}

/// Writes a line for people to standard error: like `eprintln!`, but never panics.
#[macro_export]
macro_rules! errln {
    ($($text:tt)*) => { $crate::say(format_args!($($text)*)) };
}

/// Parses the `words` of a command line; the first word is the program. Help and version go to standard output, because they are
/// data; errors go to standard error. After help, version or an error, the process must end with the returned exit code.
///
/// # Errors
/// The exit code: 0 after help and version, 1 if help or version cannot be written, 2 for wrong usage.
pub fn parse_arguments<A: Parser>(words: impl IntoIterator<Item = OsString>) -> Result<A, ExitCode> {
    let words: Vec<OsString> = words.into_iter().collect();
    A::try_parse_from(&words).map_err(|mut error| {
        suggest(&mut error, A::command(), &words);
        clean(&mut error);
        let printed = error.print().and_then(|()| io::stdout().flush());
        match printed.map_err(OutputError::from) {
            Err(failed @ OutputError::Write(_)) if !error.use_stderr() => {
                say(format_args!("error: {failed}"));
                failed.exit_code()
            }
            _ => ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2)),
        }
    })
}

/// Removes hidden characters from an error, because clap repeats words of the command line unchanged.
fn clean(error: &mut clap::Error) {
    let message = |(kind, value): (ContextKind, &ContextValue)| match value {
        ContextValue::String(word) => Some((kind, ContextValue::String(Text::line(word).into()))),
        _ => None,
    };
    let cleaned: Vec<_> = error.context().filter_map(message).collect();
    for (kind, value) in cleaned {
        error.insert(kind, value);
    }
}

/// For a mistyped command, suggests the command with the smallest edit distance. By clap's own measure of similarity `rn` is
/// nearer to `quarantine` than to `run`.
fn suggest(error: &mut clap::Error, command: Command, words: &[OsString]) {
    if matches!(
        error.kind(),
        ErrorKind::UnknownArgument | ErrorKind::InvalidSubcommand
    ) {
        // clap suggests passing the unknown word as a value, which is never the intention. An empty list of suggestions is an empty
        // line.
        error.remove(ContextKind::Suggested);
    }
    let Some(ContextValue::String(mistyped)) = error.get(ContextKind::InvalidSubcommand) else {
        return;
    };
    if error.kind() != ErrorKind::InvalidSubcommand {
        return;
    }
    let before = words.iter().filter_map(|word| word.to_str());
    let group = before
        .take_while(|word| word != mistyped)
        .fold(&command, |group, word| {
            group.find_subcommand(word).unwrap_or(group)
        });
    let changes = |name: &str| strsim::osa_distance(mistyped, name);
    let names = group.get_subcommands().map(|known| known.get_name().to_owned());
    let nearest = names.min_by_key(|name| changes(name));
    match nearest.filter(|name| changes(name) <= 1 + mistyped.chars().count() / 4) {
        Some(name) => error.insert(
            ContextKind::SuggestedSubcommand,
            ContextValue::Strings(vec![name]),
        ),
        None => error.remove(ContextKind::SuggestedSubcommand),
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Parser)]
    struct Arguments {
        #[arg(long)]
        seed: Option<u64>,
    }

    #[test]
    fn a_mistyped_command_suggests_the_nearest_one_if_any_is_near() {
        let command = Command::new("murmuration")
            .subcommand(Command::new("note"))
            .subcommand(Command::new("run"));
        let message = |mistyped: &str| {
            let words = ["murmuration", mistyped].map(OsString::from);
            let mut error = command.clone().try_get_matches_from(&words).unwrap_err();
            suggest(&mut error, command.clone(), &words);
            error.to_string()
        };
        assert!(message("rn").contains("'run'"), "{}", message("rn"));
        // clap finds `note` similar.
        let far = message("nonsense");
        assert!(!far.contains("note") && !far.contains("\n\n\n"), "{far:?}");
    }

    #[test]
    fn line_ends_of_words_are_not_lines_of_a_message() {
        let words = ["murmuration", "--data=a\nerror: b", "c\nd"].map(OsString::from);
        let message = |message: &str| with_words_in_line(message.to_owned(), words.clone().into_iter());
        assert_eq!(
            message("cannot read c\nd/e:\n  a\nerror: b"),
            "cannot read c d/e:\n  a error: b"
        );
        assert_eq!(message("one\ntwo"), "one\ntwo");
    }

    #[test]
    fn words_that_clap_repeats_are_cleaned() {
        let hostile = "\u{1b}]0;owned\u{7}\u{202e}5\nerror: gone";
        for words in [
            vec!["--seed", hostile],
            vec![hostile],
            vec!["--seed", "5", hostile],
        ] {
            let words = [&["murmuration"], &words[..]].concat();
            let mut error = Arguments::try_parse_from(&words).unwrap_err();
            clean(&mut error);
            let message = error.render().ansi().to_string();
            assert!(message.contains("]0;owned5 error: gone"), "{message:?}");
            for hidden in ["\u{1b}]", "\u{7}", "\u{202e}", "\nerror: gone"] {
                assert!(!message.contains(hidden), "{message:?}");
            }
        }
    }
}

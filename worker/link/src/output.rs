//! Output of a process: data on standard output, messages for people on standard error.
//!
//! The standard library's macros panic if the stream cannot be written (a pipe whose reader left, a full disk). Here writing
//! to standard output returns the error. A message that cannot be written to standard error is dropped, because there is
//! nowhere else to report it.
//!
//! Messages, and what a terminal shows of data, have no hidden characters: words of a file or of a stranger neither move the cursor nor
//! turn the text around them.

use clap::{
    Command, Parser,
    error::{ContextKind, ContextValue, ErrorKind},
};
use murmuration_proto::{Text, text};
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
    /// Nobody reads it any more, as in `murmuration list | head -1`.
    #[error("nobody reads standard output any more")]
    Closed,
    /// It cannot be written, for instance because the disk is full.
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
    /// The exit code of a process that ends with this error: 0 if the reader left, because it had all it wanted; otherwise 1.
    #[must_use]
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Closed => ExitCode::SUCCESS,
            Self::Write(_) => ExitCode::FAILURE,
        }
    }
}

/// Prints text on standard output, all of it before this returns; see [`outln!`](crate::outln). A terminal gets it without hidden
/// characters; a file or program gets it as it is.
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

/// Writes a message to standard error, or drops it if that fails: its lines, without hidden characters and of bounded length. See
/// [`errln!`](crate::errln).
pub fn say(said: impl fmt::Display) {
    let said = text::message(&with_words_in_line(said.to_string(), env::args_os()));
    // One write per message, so that lines of several processes do not mix.
    let _ = io::stderr().lock().write_all(format!("{said}\n").as_bytes());
}

/// `said` without the line ends within these words of the command line: the name of a file that has some must not look like lines of
/// ours.
fn with_words_in_line(said: String, words: impl Iterator<Item = OsString>) -> String {
    words.fold(said, |said, word| {
        let word = word.to_string_lossy();
        let value = word.split_once('=').map_or(&*word, |(_, value)| value);
        match value.contains('\n') {
            true => said.replace(value, Text::line(value).as_str()),
            false => said,
        }
    })
}

/// Prints a line of data on standard output: like `println!`, but a `Result` ([`OutputError`]) instead of a panic.
#[macro_export]
macro_rules! outln {
    ($($text:tt)*) => { $crate::print(format_args!("{}\n", format_args!($($text)*))) };
}

/// Writes a line for people to standard error: like `eprintln!`, but never panics.
#[macro_export]
macro_rules! errln {
    ($($text:tt)*) => { $crate::say(format_args!($($text)*)) };
}

/// Parses the `words` of a command line; the first is the program. Help and version go to standard output, because they are
/// data, and errors to standard error. In both cases the process must end with the returned exit code.
///
/// # Errors
/// The exit code: 0 after help and version, 1 if these cannot be written, 2 for wrong usage.
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

/// Takes out of an error what a terminal should not be sent: clap repeats words of the command line as they are.
fn clean(error: &mut clap::Error) {
    let said = |(kind, value): (ContextKind, &ContextValue)| match value {
        ContextValue::String(word) => Some((kind, ContextValue::String(Text::line(word).into()))),
        _ => None,
    };
    let cleaned: Vec<_> = error.context().filter_map(said).collect();
    for (kind, value) in cleaned {
        error.insert(kind, value);
    }
}

/// Names the command that takes the fewest changes of letters, where one was mistyped. clap compares by likeness, by which
/// `rn` is nearer to `quarantine` than to `run`.
fn suggest(error: &mut clap::Error, command: Command, words: &[OsString]) {
    if error.kind() == ErrorKind::UnknownArgument {
        // Nobody means an option that there is not as a value, which is what clap suggests.
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
    fn line_ends_of_words_are_not_lines_of_a_message() {
        let words = ["murmuration", "--data=a\nerror: b", "c\nd"].map(OsString::from);
        let said = |said: &str| with_words_in_line(said.to_owned(), words.clone().into_iter());
        assert_eq!(
            said("cannot read c\nd/e:\n  a\nerror: b"),
            "cannot read c d/e:\n  a error: b"
        );
        assert_eq!(said("one\ntwo"), "one\ntwo");
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
            let said = error.render().ansi().to_string();
            assert!(said.contains("]0;owned5 error: gone"), "{said:?}");
            for hidden in ["\u{1b}]", "\u{7}", "\u{202e}", "\nerror: gone"] {
                assert!(!said.contains(hidden), "{said:?}");
            }
        }
    }
}

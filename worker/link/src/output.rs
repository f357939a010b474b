//! Output of a process: data on standard output, messages for people on standard error.
//!
//! The standard library's macros panic if the stream cannot be written (a pipe whose reader left, a full disk). Here writing
//! to standard output returns the error. A message that cannot be written to standard error is dropped, because there is
//! nowhere else to report it.

use clap::{
    Command, Parser,
    error::{ContextKind, ContextValue, ErrorKind},
};
use std::{
    ffi::OsString,
    fmt,
    io::{self, Write as _},
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

/// Prints text on standard output, all of it before this returns; see [`outln!`](crate::outln).
///
/// # Errors
/// [`OutputError`].
pub fn print(text: impl fmt::Display) -> Result<(), OutputError> {
    let mut stdout = io::stdout().lock();
    write!(stdout, "{text}")?;
    Ok(stdout.flush()?)
}

/// Writes a line to standard error, or drops it if that fails. See [`errln!`](crate::errln).
pub fn say(line: impl fmt::Display) {
    // One write per line, so that lines of several processes do not mix.
    let _ = io::stderr().lock().write_all(format!("{line}\n").as_bytes());
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

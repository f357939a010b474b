//! Reads files that users name, up to a maximum length, and writes files without losing other data.
//!
//! [`NewFile`] writes one file; [`Folder`] writes a folder of files. Existing files stay until the new files are complete and on
//! disk. A [`Folder`] replaces and removes only files that an earlier command wrote into it.

mod folder;
mod input;
mod listed;
mod new_file;
mod unfinished;

pub use folder::{Folder, FolderError, Replaces};
pub use input::{InputKind, TooLong, expect_own_file, expect_regular, open, read_bytes, read_text, text_of};
pub use listed::{digest_of, listed_file};
pub use new_file::{NewFile, Written, write_file};
pub use unfinished::{UnfinishedFolder, has_no_locks, remove_leftovers};

//! Files that people name: read up to a limit, and written so that nothing of theirs is lost.
//!
//! [`NewFile`] writes one file, [`Folder`] a folder of files. Both leave what was there before until the new files are whole and on
//! disk. A [`Folder`] replaces and removes only files that an earlier command wrote into it.

mod folder;
mod input;
mod listed;
mod new_file;
mod unfinished;

pub use folder::{Folder, FolderError, Replaces};
pub use input::{InputKind, TooLong, read_bytes, read_text, text_of};
pub use listed::{digest_of, listed_file};
pub use new_file::{NewFile, Written, write_file};
pub use unfinished::{UnfinishedFolder, remove_leftovers};

//! Objects in a folder or bucket, which a path or URL names.

use crate::files::{is_there, sync};
use murmuration_swarm::text::masked_url;
use object_store::{ObjectStore, ObjectStoreScheme, local::LocalFileSystem, path::Path as ObjectPath};
use std::{
    fmt, fs, io,
    path::{Path, PathBuf},
    sync::Arc,
};

/// Slowest object store with which a mirror works, bytes per second.
pub(crate) const SLOWEST: u64 = 256 << 10;

/// A folder or a bucket's prefix that holds objects; cheap to clone.
#[derive(Debug, Clone)]
pub(crate) struct Objects {
    pub(crate) store: Arc<dyn ObjectStore>,
    prefix: ObjectPath,
    place: Place,
}

/// Location of the objects, for messages.
#[derive(Debug, Clone)]
enum Place {
    Folder(PathBuf),
    Url(String),
}

/// Why a location cannot hold objects.
#[derive(Debug)]
pub(crate) struct NoPlace {
    /// Folder or URL, without a password.
    pub(crate) location: String,
    pub(crate) reason: String,
}

impl Objects {
    /// The objects at `location`, a URL such as `s3://BUCKET/PREFIX` or `file:///FOLDER`. The credentials of a bucket are in the
    /// AWS tools' environment variables. A missing folder is made.
    pub(crate) fn open(location: &str) -> Result<Self, NoPlace> {
        match folder_of(location)? {
            Some(folder) => Self::in_folder(folder).map_err(|refused| NoPlace {
                location: masked_url(location),
                ..refused
            }),
            None => Self::in_bucket(location),
        }
    }

    /// The objects in `folder`, which is made if it is missing.
    pub(crate) fn in_folder(folder: PathBuf) -> Result<Self, NoPlace> {
        make_folder(&folder).map_err(|error| NoPlace::new(folder.display(), &error))?;
        let objects = LocalFileSystem::new_with_prefix(&folder)
            .map_err(|error| NoPlace::new(folder.display(), &error))?;
        Ok(Self {
            store: Arc::new(objects.with_fsync(true)),
            prefix: ObjectPath::default(),
            place: Place::Folder(folder),
        })
    }

    fn in_bucket(location: &str) -> Result<Self, NoPlace> {
        // The client of a bucket uses the process's cryptography provider. An error means that a provider is installed already.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let url = location.parse().map_err(|error| NoPlace::new(location, &error))?;
        let variables = std::env::vars().filter(|(name, _)| name.starts_with("AWS_"));
        let variables = variables.map(|(name, value)| (name.to_ascii_lowercase(), value));
        let (objects, prefix) =
            object_store::parse_url_opts(&url, variables).map_err(|error| NoPlace::new(location, &error))?;
        Ok(Self {
            store: objects.into(),
            prefix,
            place: Place::Url(location.to_owned()),
        })
    }

    /// The objects in a folder of these ones.
    pub(crate) fn within(&self, folder: &str) -> Self {
        Self {
            store: self.store.clone(),
            prefix: self.path(folder),
            place: match &self.place {
                Place::Folder(place) => Place::Folder(place.join(folder)),
                Place::Url(url) => Place::Url(format!("{url}/{folder}")),
            },
        }
    }

    /// The path of an object within `store`.
    pub(crate) fn path(&self, name: &str) -> ObjectPath {
        self.prefix
            .parts()
            .chain(ObjectPath::from(name).parts())
            .collect()
    }

    /// Path or address of an object, for people.
    pub(crate) fn name(&self, name: &str) -> String {
        match &self.place {
            Place::Folder(folder) => folder.join(name).display().to_string(),
            Place::Url(url) => format!("{}/{name}", masked_url(url)),
        }
    }

    /// The folder that holds the objects; `None` for a bucket.
    /// The place of the objects under one name, whatever name was given: a folder's canonical path, or the URL.
    pub(crate) fn canonical_place(&self) -> io::Result<String> {
        match self.folder() {
            Some(folder) => Ok(folder.canonicalize()?.display().to_string()),
            None => Ok(self.to_string()),
        }
    }

    pub(crate) fn folder(&self) -> Option<&Path> {
        match &self.place {
            Place::Folder(folder) => Some(folder),
            Place::Url(_) => None,
        }
    }
}

impl fmt::Display for Objects {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.place {
            Place::Folder(folder) => folder.display().fmt(f),
            Place::Url(url) => f.write_str(&masked_url(url)),
        }
    }
}

impl NoPlace {
    pub(crate) fn new(location: impl fmt::Display, reason: &dyn fmt::Display) -> Self {
        let location = location.to_string();
        let masked = masked_url(&location);
        Self {
            // The library's reasons quote the URL, which can contain a password.
            reason: reason.to_string().replace(&location, &masked),
            location: masked,
        }
    }
}

/// The folder that a `file://` URL names; `None` for the URL of a bucket.
pub(crate) fn folder_of(location: &str) -> Result<Option<PathBuf>, NoPlace> {
    let url = location.parse().map_err(|error| NoPlace::new(location, &error))?;
    let (scheme, _) = ObjectStoreScheme::parse(&url).map_err(|error| NoPlace::new(location, &error))?;
    match scheme {
        ObjectStoreScheme::Local => match url.to_file_path() {
            Ok(folder) => Ok(Some(folder)),
            Err(()) => Err(NoPlace::new(location, &"it names no folder of this machine")),
        },
        ObjectStoreScheme::Memory => Err(NoPlace::new(location, &"memory does not outlast the coordinator")),
        _ => Ok(None),
    }
}

/// Makes a folder and its missing parents, for this user alone; their entries are on disk when this returns.
fn make_folder(folder: &Path) -> io::Result<()> {
    if is_there(folder)? && folder.is_dir() {
        return Ok(());
    }
    let above = match folder.parent() {
        Some(above) if above != Path::new("") => above,
        _ => Path::new("."),
    };
    make_folder(above)?;
    let mut new = fs::DirBuilder::new();
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut new, 0o700);
    match new.create(folder) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists || !folder.is_dir() => return Err(error),
        _ => {}
    }
    sync(above)
}

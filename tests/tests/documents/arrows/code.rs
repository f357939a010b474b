//! The modules of a crate, and the modules that each module names.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::Path,
};
use syn::{
    Attribute, Item, UseTree,
    visit::{self, Visit},
};

/// A module's path: the names from the crate's root to the module; empty for the root.
pub type Place = Vec<String>;

/// The modules of a crate and their dependencies, without code that only tests compile.
#[derive(Debug, Default)]
pub struct Crate {
    /// The modules, by path.
    pub modules: BTreeMap<Place, Module>,
}

/// A module.
#[derive(Debug, Default)]
pub struct Module {
    /// Names that the module imports by `use`, with their paths.
    imports: BTreeMap<String, Place>,
    /// Modules with glob imports (`use path::*`).
    globs: Vec<Place>,
    /// Paths as written in the code: of several names, or of one name that may be imported.
    paths: BTreeSet<Place>,
}

impl Crate {
    /// Reads the crate whose root, `lib.rs` or `main.rs`, is in `folder`.
    pub fn read(folder: &Path) -> Self {
        let file = ["lib.rs", "main.rs"]
            .map(|name| folder.join(name))
            .into_iter()
            .find(|file| file.exists());
        let mut code = Self::default();
        code.read_file(&file.unwrap(), folder, Place::new());
        code
    }

    fn read_file(&mut self, file: &Path, children: &Path, place: Place) {
        let text = fs::read_to_string(file).unwrap();
        let syntax = syn::parse_file(&text).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        self.read_items(&syntax.items, children, place);
    }

    fn read_items(&mut self, items: &[Item], children: &Path, place: Place) {
        let mut module = Module::default();
        for item in items {
            match item {
                Item::Mod(child) if is_of_tests(&child.attrs) => {}
                Item::Mod(child) => {
                    let name = child.ident.to_string();
                    let mut place = place.clone();
                    place.push(name.clone());
                    let folder = children.join(&name);
                    match &child.content {
                        Some((_, items)) => self.read_items(items, &folder, place),
                        None => {
                            let file = children.join(format!("{name}.rs"));
                            let file = if file.exists() {
                                file
                            } else {
                                folder.join("mod.rs")
                            };
                            // A missing file is one that a build script generates elsewhere.
                            if file.exists() {
                                self.read_file(&file, &folder, place);
                            }
                        }
                    }
                }
                item => module.visit_item(item),
            }
        }
        self.modules.insert(place, module);
    }

    /// The modules that the module at `place` refers to: the modules of this crate that define the names used.
    pub fn named_by(&self, place: &Place) -> BTreeSet<Place> {
        let module = &self.modules[place];
        let paths = module
            .paths
            .iter()
            .chain(module.imports.values())
            .chain(&module.globs);
        paths
            .filter_map(|path| self.resolve(place, path, 0))
            .filter(|named| named != place)
            .collect()
    }

    /// The module in which `path`, as written in the module `from`, is defined.
    fn resolve(&self, from: &Place, path: &[String], depth: usize) -> Option<Place> {
        // Names that import each other resolve to nothing.
        if depth > 16 {
            return None;
        }
        let (first, rest) = path.split_first()?;
        match first.as_str() {
            "crate" => self.descend(Place::new(), rest, depth),
            "self" => self.descend(from.clone(), rest, depth),
            "super" => {
                let (_, parent) = from.split_last()?;
                let mut parent = parent.to_vec();
                let mut rest = rest;
                while let Some(("super", further)) =
                    rest.split_first().map(|(name, rest)| (name.as_str(), rest))
                {
                    parent.pop();
                    rest = further;
                }
                self.descend(parent, rest, depth)
            }
            _ => {
                let child = [from.as_slice(), std::slice::from_ref(first)].concat();
                if self.modules.contains_key(&child) || self.modules[from].imports.contains_key(first) {
                    self.descend(from.clone(), path, depth)
                } else {
                    None
                }
            }
        }
    }

    /// The module that defines the item at `path`, relative to the module `at`.
    fn descend(&self, at: Place, path: &[String], depth: usize) -> Option<Place> {
        let Some((first, rest)) = path.split_first() else {
            return Some(at);
        };
        let child = [at.as_slice(), std::slice::from_ref(first)].concat();
        if self.modules.contains_key(&child) {
            return self.descend(child, rest, depth);
        }
        let module = &self.modules[&at];
        match module.imports.get(first) {
            Some(import) => {
                let whole: Place = import.iter().chain(rest).cloned().collect();
                self.resolve(&at, &whole, depth + 1)
            }
            // The module at `at` defines the name, or imports it by a glob.
            None => Some(at),
        }
    }
}

impl Module {
    fn import(&mut self, tree: &UseTree, before: &[String]) {
        let with = |name: &syn::Ident| [before, &[name.to_string()]].concat();
        match tree {
            UseTree::Path(path) => self.import(&path.tree, &with(&path.ident)),
            UseTree::Group(group) => {
                for tree in &group.items {
                    self.import(tree, before);
                }
            }
            UseTree::Name(name) if name.ident == "self" => {
                if let Some(last) = before.last() {
                    self.imports.insert(last.clone(), before.to_vec());
                }
            }
            UseTree::Name(name) => {
                self.imports.insert(name.ident.to_string(), with(&name.ident));
            }
            UseTree::Rename(rename) => {
                self.imports
                    .insert(rename.rename.to_string(), with(&rename.ident));
            }
            UseTree::Glob(_) => self.globs.push(before.to_vec()),
        }
    }
}

impl<'ast> Visit<'ast> for Module {
    fn visit_item(&mut self, item: &'ast Item) {
        if !attributes(item).is_some_and(is_of_tests) {
            visit::visit_item(self, item);
        }
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        self.import(&item.tree, &[]);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let names = path.segments.iter().map(|segment| segment.ident.to_string());
        self.paths.insert(names.collect());
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, call: &'ast syn::Macro) {
        // A macro's arguments need not be Rust: find the paths in them by their `::`.
        let text = call.tokens.to_string().replace(" :: ", "::");
        let words = text.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':'));
        let paths = words.filter(|word| word.contains("::"));
        self.paths
            .extend(paths.map(|path| path.split("::").map(str::to_owned).collect()));
        visit::visit_macro(self, call);
    }
}

/// Whether these attributes mark code that only tests compile.
fn is_of_tests(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("cfg")
            && attribute
                .parse_args::<syn::Ident>()
                .is_ok_and(|argument| argument == "test")
    })
}

fn attributes(item: &Item) -> Option<&[Attribute]> {
    Some(match item {
        Item::Const(item) => &item.attrs,
        Item::Enum(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Mod(item) => &item.attrs,
        Item::Static(item) => &item.attrs,
        Item::Struct(item) => &item.attrs,
        Item::Trait(item) => &item.attrs,
        Item::Type(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        _ => return None,
    })
}

//! The keys of a page: their actions, which of them people can change, and the dialog that lists them.

use maud::{Markup, html};
use serde_json::json;

/// The pages on which people can choose keys.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Page {
    Label,
    Sheet,
    Map,
    Answers,
    Play,
}

impl Page {
    const fn name(self) -> &'static str {
        match self {
            Self::Label => "label",
            Self::Sheet => "sheet",
            Self::Map => "map",
            Self::Answers => "answers",
            Self::Play => "play",
        }
    }
}

/// An action with a key. People can choose another key for the action, and their browser keeps this choice.
struct Action {
    name: &'static str,
    /// The name of the default key in browsers.
    key: &'static str,
    what: &'static str,
    pages: &'static [Page],
}

const fn action(name: &'static str, key: &'static str, what: &'static str, pages: &'static [Page]) -> Action {
    Action {
        name,
        key,
        what,
        pages,
    }
}

/// Pages on which people name behaviours.
const NAMING: &[Page] = &[Page::Label, Page::Sheet, Page::Map, Page::Answers];
/// Pages on which keys control one motion.
const PLAYING: &[Page] = &[Page::Label, Page::Map];

/// All actions with a key that works wherever the focus is. No two actions of a page have the same default key.
const ACTIONS: [Action; 18] = [
    action("name", "n", "name a class, new or existing", NAMING),
    action("undo", "u", "undo your last answer", NAMING),
    action(
        "not-sure",
        "0",
        "answer “not sure”",
        &[Page::Label, Page::Answers],
    ),
    action("skip", "s", "skip the behaviour", &[Page::Label]),
    action(
        "withdraw",
        "Delete",
        "withdraw your answers about the selection",
        &[Page::Answers],
    ),
    action("previous", "ArrowLeft", "the previous cluster", &[Page::Sheet]),
    action("next", "ArrowRight", "the next cluster", &[Page::Sheet]),
    action(
        "play",
        " ",
        "play or pause",
        &[Page::Label, Page::Map, Page::Play],
    ),
    action("back", "ArrowLeft", "a few steps back", PLAYING),
    action("forward", "ArrowRight", "a few steps forward", PLAYING),
    action("step", "ArrowRight", "one step forward", &[Page::Play]),
    action("step-back", "ArrowLeft", "one step back", &[Page::Play]),
    action("slower", "-", "slower", &[Page::Label, Page::Map, Page::Play]),
    action("faster", "+", "faster", &[Page::Label, Page::Map, Page::Play]),
    action(
        "restart",
        "r",
        "restart the motion",
        &[Page::Label, Page::Map, Page::Play],
    ),
    action(
        "mark",
        "m",
        "mark this moment, to compare it with others",
        &[Page::Play],
    ),
    action("anew", "n", "another start, by the next seed", &[Page::Play]),
    action(
        "like",
        "l",
        "find a campaign's behaviours that are most like this swarm",
        &[Page::Play],
    ),
];

/// The entry for the keys of all classes, in the list of keys of a page with a palette.
pub(super) const CLASSES: (&str, &str) = (
    "1 … z",
    "the class with that key, as its button shows; choose keys of classes on the page Classes",
);

/// The default key of an action, as a mark that a script updates.
pub(super) fn mark(name: &str) -> Markup {
    let key = ACTIONS
        .iter()
        .find(|action| action.name == name)
        .map_or("", |action| action.key);
    html! { kbd data-action=(name) { (shown(key)) } }
}

/// A key as its mark shows it.
fn shown(key: &str) -> &str {
    match key {
        " " => "Space",
        "ArrowLeft" => "←",
        "ArrowRight" => "→",
        "ArrowUp" => "↑",
        "ArrowDown" => "↓",
        other => other,
    }
}

/// The button that shows the keys of a page, and the dialog that lists them, which the key `?` also opens. `fixed` has the keys
/// that people cannot change.
pub(super) fn list(fixed: &[(&str, &str)], page: Page) -> Markup {
    let own = ACTIONS.iter().filter(|action| action.pages.contains(&page));
    let chosen = html! {
        @for action in own {
            div data-of=(action.name) {
                dt { (mark(action.name)) }
                dd {
                    (action.what) span.taken {}
                    span.choose {
                        button.plain type="button" data-do="choose" { "Change" span.unseen { " the key: " (action.what) } }
                        button.plain type="button" data-do="reset" hidden { "Reset" span.unseen { " the key: " (action.what) } }
                    }
                }
            }
        }
    };
    let note = html! {
        p #keys-message.reason role="status" { "Your browser keeps the keys that you choose." }
    };
    dialog(fixed, page.name(), &chosen, &note)
}

/// The button and the dialog for a page on which people cannot change keys.
pub(super) fn fixed(keys: &[(&str, &str)]) -> Markup {
    dialog(keys, "", &Markup::default(), &Markup::default())
}

/// The button, and the dialog with fixed and configurable keys. The dialog's data has the actions of all pages, because a class
/// also has its key on other pages, where the key can have an action.
fn dialog(fixed: &[(&str, &str)], page: &str, chosen: &Markup, note: &Markup) -> Markup {
    let all: Vec<_> = ACTIONS
        .iter()
        .map(
            |Action {
                 name,
                 key,
                 what,
                 pages,
             }| {
                let pages: Vec<&str> = pages.iter().map(|page| page.name()).collect();
                json!([name, key, what, pages])
            },
        )
        .collect();
    html! {
        button.plain.scripted.once-named type="button" data-do="keys" { "Keys " kbd { "?" } }
        dialog #keys aria-labelledby="keys-title" data-page=(page) data-actions=(json!(all)) {
            h2 #keys-title { "Keys of this page" }
            dl.keys {
                @for (key, what) in fixed { div { dt { kbd { (key) } } dd { (what) } } }
                (chosen)
                div { dt { kbd { "?" } } dd { "show these keys" } }
            }
            (note)
            form method="dialog" { button.plain { "Close" } }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn no_page_has_two_actions_with_one_key() {
        for page in [Page::Label, Page::Sheet, Page::Map, Page::Answers, Page::Play] {
            let own = || ACTIONS.iter().filter(|action| action.pages.contains(&page));
            let keys: BTreeSet<&str> = own().map(|action| action.key).collect();
            assert_eq!(keys.len(), own().count(), "{page:?}");
        }
    }

    #[test]
    fn no_class_can_have_the_usual_key_of_an_action() {
        for action in ACTIONS
            .iter()
            .filter(|action| NAMING.iter().any(|page| action.pages.contains(page)))
        {
            let taken = murmuration_model::labels::Shortcut::all().any(|key| key.to_string() == action.key);
            assert!(!taken, "{} has a key of classes", action.name);
        }
    }
}

//! Tables and plots that are wider than some screens.

use maud::{Markup, html};

/// A table or plot that narrow screens scroll, also with keys; `name` tells it apart from others of its page.
#[must_use]
pub fn wide(name: &str, content: &Markup) -> Markup {
    html! { div.wide tabindex="0" role="region" aria-label=(name) { (content) } }
}

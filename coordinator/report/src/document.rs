//! The frame of a one-file page: its head, and its content security policy.

use maud::{DOCTYPE, Markup, PreEscaped, html};

/// A page that is one HTML document. It sends nothing, embeds nothing of another site, and loads at most pictures that lie beside
/// it.
#[derive(Debug, Clone, Copy)]
pub struct Document<'a> {
    /// Title, for the tab of a browser.
    pub title: &'a str,
    /// The style sheet, for light and dark screens.
    pub style: &'a str,
    /// Whether scripts in it run.
    pub scripts: bool,
    /// Whether it shows picture files that lie beside it, in addition to embedded ones.
    pub pictures_beside: bool,
}

impl Document<'_> {
    /// The whole document with this content of its `body`.
    pub fn with(&self, body: &Markup) -> String {
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta http-equiv="Content-Security-Policy" content=(self.policy());
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    meta name="color-scheme" content="light dark";
                    meta name="generator" content="Murmuration";
                    title { (self.title) }
                    style { (PreEscaped(self.style)) }
                }
                body { (body) }
            }
        };
        page.into_string()
    }

    /// Its content security policy: what a browser may load.
    fn policy(&self) -> String {
        let scripts = if self.scripts {
            "script-src 'unsafe-inline'; "
        } else {
            ""
        };
        let beside = if self.pictures_beside { " 'self' file:" } else { "" };
        format!(
            "default-src 'none'; style-src 'unsafe-inline'; {scripts}img-src data:{beside}; base-uri 'none'; form-action 'none'"
        )
    }
}

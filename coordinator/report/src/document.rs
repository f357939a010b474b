//! The frame of a page in one file: the page's head, and its content security policy.

use maud::{DOCTYPE, Markup, PreEscaped, html};

/// A page that is one HTML document. The page sends no data, embeds no content of other sites, and loads at most pictures from
/// its own folder.
#[derive(Debug, Clone, Copy)]
pub struct Document<'a> {
    /// The title, which a browser shows in its tab.
    pub title: &'a str,
    /// The style sheet, for light and dark screens.
    pub style: &'a str,
    /// Whether scripts in the page run.
    pub scripts: bool,
    /// Whether the page shows picture files from its own folder, in addition to embedded pictures.
    pub pictures_beside: bool,
}

impl Document<'_> {
    /// The whole document, with `body` as the content of its body.
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

    /// The page's content security policy: what a browser can load for the page.
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

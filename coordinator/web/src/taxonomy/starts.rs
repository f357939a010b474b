//! The page of a behaviour's robustness: its controller from further starts, with the judge's verdict and a picture of each
//! start.

use super::further_starts::{STARTS, Start, counted};
use crate::asked::Query;
use crate::{
    archived::Created,
    layout::{Part, campaign_page},
    of_campaign::OfCampaign,
    page_error::PageError,
};
use axum::{extract::Path, http::header::CONTENT_TYPE, response::IntoResponse};
use maud::{Markup, html};
use murmuration_model::{CampaignRecord, labels::ClassName};
use murmuration_report::picture::image_png;
use murmuration_swarm::{Verdict, grouped};

/// Side of the square in a start's picture that shows one pixel of its image.
const SCALE: u32 = 2;

/// The page of the further starts of an individual. The script of the page Taxonomy shows its part `starts` in a dialog.
pub(crate) async fn page(
    Path((_, index)): Path<(String, u64)>,
    OfCampaign { web, record, visitor }: OfCampaign,
) -> Result<Markup, PageError> {
    let starts = web.starts.of(&web, &record, index).await?;
    let content = html! {
        div.wide-bar {
            h1 { "Individual " (grouped(index)) }
            a.button href={ "/campaigns/" (record.id) "/taxonomy" } { "Back to the taxonomy" }
        }
        (told(&record, index, &starts))
    };
    Ok(campaign_page(&record, Part::Taxonomy, &visitor, content))
}

/// A verdict in the words of the pages.
pub(super) fn in_words(verdict: Verdict) -> String {
    match (verdict.pattern(), verdict.class()) {
        (None, class) => ClassName::from(class).shown(),
        (Some(pattern), class) => {
            format!(
                "{} ({})",
                pattern.name().replace('_', " "),
                ClassName::from(class).shown()
            )
        }
    }
}

/// The judge's verdicts on the starts, and the pictures of the starts by verdict.
fn told(record: &CampaignRecord, index: u64, starts: &[Start]) -> Markup {
    let verdicts = counted(starts.iter().map(|start| start.verdict));
    let missing = STARTS as usize - starts.len();
    let created = record.archive_version().origin();
    html! {
        section #starts aria-labelledby="starts-title" {
            h2 #starts-title { "From " (STARTS) " further starts" }
            p.verdicts {
                @for (place, (verdict, count)) in verdicts.iter().enumerate() {
                    @if place > 0 { "; " }
                    @if place == 0 { strong { (count) " of " (starts.len()) " starts: " (in_words(*verdict)) } } @else { (count) ": " (in_words(*verdict)) }
                }
                "."
                @if missing > 0 { " " (missing) " could not be simulated." }
            }
            p.reason {
                "The same controller from other starts. The rule-based judge names each motion; on the labelled sets it agrees in about nine of ten "
                "cases with the annotators, each a vision model with a written brief. None of this is stored."
            }
            ul.starts {
                @for (verdict, _) in &verdicts {
                    @for (place, _) in starts.iter().enumerate().filter(|(_, start)| start.verdict == *verdict) {
                        li {
                            img src={ "/campaigns/" (record.id) "/individuals/" (index) "/starts/" (place) "?created=" (created) }
                                width="100" height="100" alt={ "Picture of start " (place + 1) };
                            span { (in_words(*verdict)) }
                        }
                    }
                }
            }
        }
    }
}

/// The picture of a further start, as a PNG.
pub(crate) async fn picture(
    Path((_, index, place)): Path<(String, u64, usize)>,
    Query(created): Query<Created>,
    OfCampaign { web, record, .. }: OfCampaign,
) -> Result<impl IntoResponse, PageError> {
    let starts = web.starts.of(&web, &record, index).await?;
    let start = starts.get(place).ok_or(PageError::NoPage)?;
    let png = image_png(&start.image, record.spec.image().shape(), SCALE)?;
    Ok(([(CONTENT_TYPE, "image/png"), created.keep(&record)], png))
}

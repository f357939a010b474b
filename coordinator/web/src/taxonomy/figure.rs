//! A figure for a paper: the form on the page Taxonomy, and the file to download.

use super::{PicturesOf, ReportState, card::Card, folding, gathered, shown_version::ShownVersion, state};
use crate::{Web, asked::Query, page_error::PageError};
use axum::{
    body::Bytes,
    extract::{Path, State},
    http::header::{CONTENT_DISPOSITION, CONTENT_TYPE},
    response::IntoResponse,
};
use maud::{Markup, html};
use murmuration_engine::blocking::{in_background, parallel};
use murmuration_model::{CampaignId, CampaignRecord};
use murmuration_report::paper::{FigureError, Format, Labels, Options, PaperFigure, Width};
use murmuration_swarm::{Invalid, noun, text::quoted};
use std::{collections::BTreeSet, str::FromStr};
use tonic::Status;

/// The state that a figure depends on, and its options.
pub(super) type FigureState = (ReportState, Options, Format);

/// A behaviour that the form offers.
struct Choice {
    number: usize,
    name: Option<String>,
    chosen: bool,
}

/// The form, behind a button. It works without scripts.
pub(super) fn form(record: &CampaignRecord, shown: &ShownVersion) -> Markup {
    let (distinct, _) = folding(record, shown);
    // Of clusters that the page merges, the first is the figure's.
    let distinct: BTreeSet<usize> = distinct
        .iter()
        .filter_map(|group| group.first().copied())
        .collect();
    let choice = |place: usize| Choice {
        number: place + 1,
        name: Card { record, shown, place }.card_name().map(|name| name.shown()),
        chosen: distinct.contains(&place),
    };
    let choices: Vec<Choice> = (0..shown.taxonomy.medoids.len()).map(choice).collect();
    fields(&record.id, &choices)
}

fn fields(id: &CampaignId, choices: &[Choice]) -> Markup {
    let file = |format: Format| format!("/campaigns/{id}/figure.{}", format.ending());
    html! {
        details.paper {
            summary.button { "Figure for a paper" }
            form method="get" action=(file(Format::Pdf)) {
                fieldset {
                    legend { (noun(choices.len() as u64, "Behaviour")) }
                    @for Choice { number, name, chosen } in choices {
                        label {
                            input type="checkbox" name="behaviours" value=(number) checked[*chosen];
                            (number) @if let Some(name) = name { " " (name) }
                        }
                    }
                }
                div.choices {
                    label { "Width "
                        select name="width" {
                            @for (width, title) in [(Width::COLUMN, "a column, 85 mm"), (Width::PAGE, "a page, 178 mm")] {
                                option value=(width) { (title) }
                            }
                        }
                    }
                    label { "Labels "
                        select name="labels" {
                            @for labels in Labels::ALL { option value=(labels.name()) { (labels.name()) } }
                        }
                    }
                    label { input type="checkbox" name="shares" value="true"; "Shares" }
                    button.main { "Download PDF" }
                    button.plain formaction=(file(Format::Svg)) { "Download SVG" }
                }
            }
        }
    }
}

/// The options in the query of a figure's address. The behaviours can be in one parameter (`behaviours=2,5`) or in several, as a
/// form sends them.
fn options(query: &[(String, String)]) -> Result<Options, Invalid> {
    let behaviours = values(query, "behaviours").join(",");
    Ok(Options {
        behaviours: (!behaviours.is_empty()).then(|| behaviours.parse()).transpose()?,
        width: last(query, "width")?.unwrap_or_default(),
        columns: last(query, "columns")?,
        labels: last(query, "labels")?.unwrap_or_default(),
        shares: match values(query, "shares").last() {
            None | Some(&"false") => false,
            Some(&"true") => true,
            Some(other) => return Err(Invalid::new("shares", quoted(other), "true or false")),
        },
    })
}

fn values<'a>(query: &'a [(String, String)], name: &str) -> Vec<&'a str> {
    let named = query.iter().filter(|(key, _)| key == name);
    named.map(|(_, value)| value.as_str()).collect()
}

/// The last value of a parameter, if there is one.
fn last<T: FromStr<Err = Invalid>>(query: &[(String, String)], name: &str) -> Result<Option<T>, Invalid> {
    values(query, name).last().map(|value| value.parse()).transpose()
}

type Parameters = Query<Vec<(String, String)>>;

pub(crate) async fn svg(
    State(web): State<Web>,
    Path(id): Path<String>,
    Query(query): Parameters,
) -> Result<impl IntoResponse, PageError> {
    download(&web, &id, &query, Format::Svg, "image/svg+xml").await
}

pub(crate) async fn pdf(
    State(web): State<Web>,
    Path(id): Path<String>,
    Query(query): Parameters,
) -> Result<impl IntoResponse, PageError> {
    download(&web, &id, &query, Format::Pdf, "application/pdf").await
}

/// The file of a figure. Workers simulate the motions of the medoids. The response to an error is a page.
async fn download(
    web: &Web,
    id: &str,
    query: &[(String, String)],
    format: Format,
    content: &'static str,
) -> Result<impl IntoResponse + use<>, PageError> {
    let options = options(query)?;
    let (id, state) = state(web, id).await?;
    let of = (state, options.clone(), format);
    let make = draw(web, &id, options, format);
    let file = web.reports.figures.of(&id, of, Bytes::len, make).await?;
    let name = format!("attachment; filename=\"{id}-figure.{}\"", format.ending());
    Ok((
        [(CONTENT_TYPE, content.to_owned()), (CONTENT_DISPOSITION, name)],
        file,
    ))
}

async fn draw(web: &Web, id: &CampaignId, options: Options, format: Format) -> Result<Bytes, PageError> {
    let report = gathered(web, id, PicturesOf::Medoids).await?;
    let draw = move || PaperFigure::draw(&report, &options)?.file(format);
    let drawn = in_background(move |_| parallel(draw)).await?;
    let drawn = drawn.map_err(|error| match error {
        FigureError::Options(invalid) => PageError::Input(invalid),
        other => Status::internal(other.to_string()).into(),
    })?;
    Ok(drawn.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(query: &str) -> Result<Options, Invalid> {
        options(&serde_urlencoded::from_str::<Vec<(String, String)>>(query).unwrap())
    }

    #[test]
    fn an_address_has_the_options_of_a_figure() {
        assert_eq!(asked("").unwrap(), Options::default());
        let several = asked("behaviours=9&behaviours=2&width=page&labels=letters&shares=true").unwrap();
        assert_eq!(
            several,
            asked("behaviours=9,2&width=178mm&labels=letters&shares=true").unwrap()
        );
        assert!(several.shares && several.labels == Labels::Letters && several.width == Width::PAGE);
        for (query, field) in [
            ("behaviours=two", "behaviours"),
            ("width=3mm", "width"),
            ("columns=0", "columns"),
            ("labels=roman", "labels"),
            ("shares=1", "shares"),
        ] {
            let error = asked(query).unwrap_err().to_string();
            assert!(error.starts_with(field), "{error}");
        }
    }

    #[test]
    fn the_form_sends_the_chosen_behaviours_to_the_file_of_a_format() {
        let choice = |number, name: Option<&str>, chosen| Choice {
            number,
            name: name.map(str::to_owned),
            chosen,
        };
        let choices = [choice(1, Some("milling"), true), choice(2, None, false)];
        let form = fields(&"small-1".parse().unwrap(), &choices).into_string();
        for part in [
            "method=\"get\" action=\"/campaigns/small-1/figure.pdf\"",
            "formaction=\"/campaigns/small-1/figure.svg\"",
            "name=\"behaviours\" value=\"1\" checked>1 milling</label>",
            "name=\"behaviours\" value=\"2\">2</label>",
            "<option value=\"page\">",
        ] {
            assert!(form.contains(part), "{part}: {form}");
        }
        assert!(!form.contains("style=") && !form.contains("scripted"));
    }
}

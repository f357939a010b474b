//! Barriers for people who use a keyboard, a screen reader or large type: what axe-core finds on a page.

use crate::browser::driver::Window;
use serde_json::json;

/// axe-core (`tests/axe/README.md`).
const AXE: &str = include_str!("../../../axe/axe.min.js");

/// Each rule that the page breaks, with what breaks it.
const VIOLATIONS: &str = "(async () => { \
    const { violations } = await axe.run(document, { resultTypes: ['violations'] }); \
    return violations.flatMap(({ id, nodes }) => nodes.map(({ html, failureSummary }) => \
        `${id}: ${html.slice(0, 200)}: ${failureSummary.replace(/\\s+/g, ' ')}`)); })()";

/// Fails if axe-core finds a violation on the page as it is now.
pub async fn check_barriers(window: &Window, page: &str) {
    if window.value("typeof axe === 'undefined'").await == json!(true) {
        window.driver.execute(AXE, vec![]).await.unwrap();
    }
    let found = window.value(VIOLATIONS).await;
    assert_eq!(found, json!([]), "{page} has barriers");
}

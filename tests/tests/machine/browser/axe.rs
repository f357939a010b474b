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

/// Times that a page is checked before it is given up.
const TIMES: u32 = 5;

/// Fails if axe-core finds a violation on the page as it is now.
pub async fn check_barriers(window: &Window, page: &str) {
    let script = format!("{AXE}\nreturn {VIOLATIONS}");
    // A page that is loaded again meanwhile gives no answer.
    for _ in 0..TIMES {
        if let Ok(found) = window.driver.execute(script.clone(), vec![]).await {
            assert_eq!(*found.json(), json!([]), "{page} has barriers");
            return;
        }
    }
    panic!("{page} could not be checked in {TIMES} times");
}

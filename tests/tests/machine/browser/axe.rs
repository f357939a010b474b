//! Finds, with axe-core, barriers of a page for people who use a keyboard, a screen reader or large type.

use crate::browser::driver::Window;
use serde_json::json;

/// The script of axe-core (`tests/axe/README.md`).
const AXE: &str = include_str!("../../../axe/axe.min.js");

/// The rules that the page violates, with the elements that violate them.
const VIOLATIONS: &str = "(async () => { \
    const { violations } = await axe.run(document, { resultTypes: ['violations'] }); \
    return violations.flatMap(({ id, nodes }) => nodes.map(({ html, failureSummary }) => \
        `${id}: ${html.slice(0, 200)}: ${failureSummary.replace(/\\s+/g, ' ')}`)); })()";

/// Number of attempts to check a page.
const TIMES: u32 = 5;

/// Fails if axe-core finds a violation on the page.
pub async fn check_barriers(window: &Window, page: &str) {
    let script = format!("{AXE}\nreturn {VIOLATIONS}");
    // A page that reloads during the check gives no answer.
    for _ in 0..TIMES {
        if let Ok(found) = window.driver.execute(script.clone(), vec![]).await {
            assert_eq!(*found.json(), json!([]), "{page} has barriers");
            return;
        }
    }
    panic!("{page} could not be checked in {TIMES} times");
}

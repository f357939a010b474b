// The page of a study: its tables and plots follow the cells that are done, and what people say of its medoids.
import "./live.js";
import "./rejudge.js";

const cells = document.querySelector("[data-live]");
const tables = document.getElementById("tables");
const version = () => cells.querySelector("[data-version]")?.dataset.version;
let shown = version();
let asking = false;

async function renew() {
  if (asking) return;
  asking = true;
  try {
    while (version() !== shown) {
      const now = version();
      const answer = await fetch(tables.dataset.tables);
      // The next change of a cell asks again.
      if (!answer.ok) return;
      tables.innerHTML = await answer.text();
      shown = now;
    }
  } catch {
    // The notice at the bottom of the page says that the coordinator is silent.
  } finally {
    asking = false;
  }
}

new MutationObserver(renew).observe(cells, { subtree: true, childList: true, attributes: true });

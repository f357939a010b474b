// The page of a study: loads its tables and plots again when a cell is completed or a person has judged a medoid.
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
      // The next change of a cell triggers a new request.
      if (!answer.ok) return;
      tables.innerHTML = await answer.text();
      shown = now;
    }
  } catch {
    // The notice at the bottom of the page already reports an unresponsive coordinator.
  } finally {
    asking = false;
  }
}

new MutationObserver(renew).observe(cells, { subtree: true, childList: true, attributes: true });

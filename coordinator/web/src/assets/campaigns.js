// The list of campaigns: requests searches, and restores choices and unfolded studies when the coordinator sends the list again.
import { base } from "./base.js";
import { attend } from "./live.js";

const KEPT = "murmuration.campaigns";
const MOST_COMPARED = 6;
// Delay between a typed key and the search.
const PAUSE_MS = 150;

const list = document.querySelector("[data-live]");
const find = document.getElementById("find");
const compare = document.getElementById("compare");
const clear = document.getElementById("clear");
const told = document.getElementById("comparing");

const kept = JSON.parse(sessionStorage.getItem(KEPT) ?? "{}");
const chosen = new Set(kept.chosen);
const unfolded = new Set(kept.unfolded);
let waiting = 0;

const keep = () => sessionStorage.setItem(KEPT, JSON.stringify({ chosen: [...chosen], unfolded: [...unfolded] }));

// Requests the search that the form describes, and puts the search into the page's address.
function look() {
  const query = new URLSearchParams(new FormData(find));
  history.replaceState(null, "", `/?${query}`);
  list.dataset.live = `${base}/events?${query}`;
  attend(list);
}

for (const kind of ["input", "change"]) {
  find.addEventListener(kind, () => {
    clearTimeout(waiting);
    waiting = setTimeout(look, PAUSE_MS);
  });
}
find.addEventListener("submit", (event) => {
  event.preventDefault();
  clearTimeout(waiting);
  look();
});

// Restores choices and unfolded studies. Elements in the right state stay untouched.
function apply() {
  for (const box of list.querySelectorAll(".choose")) {
    if (box.checked !== chosen.has(box.value)) box.checked = chosen.has(box.value);
  }
  const asked = new URLSearchParams(location.search);
  const filters = ["words", "state", "tag"].some((name) => asked.get(name));
  for (const study of list.querySelectorAll("li.study")) {
    const details = study.querySelector("details");
    const open = filters || unfolded.has(study.id);
    if (details.open !== open) details.open = open;
  }
  tell();
}

// Shows the number of chosen campaigns, including chosen campaigns that are not in the current list.
function tell() {
  const enough = chosen.size >= 2 && chosen.size <= MOST_COMPARED;
  compare.querySelector("button").disabled = !enough;
  clear.hidden = chosen.size === 0;
  const many = chosen.size > MOST_COMPARED ? `${chosen.size} chosen: at most ${MOST_COMPARED} can be compared.` : "";
  const some = chosen.size ? `${chosen.size} chosen: ${[...chosen].join(", ")}.` : "";
  const text = many || (enough && some) || `${some} Choose two to six campaigns with the boxes on the left.`.trim();
  if (told.textContent !== text) told.textContent = text;
}

compare.addEventListener("submit", () => {
  compare.querySelectorAll("[type=hidden]").forEach((field) => field.remove());
  const shown = new Set([...list.querySelectorAll(".choose:checked")].map(({ value }) => value));
  for (const id of chosen) {
    if (shown.has(id)) continue;
    const field = Object.assign(document.createElement("input"), { type: "hidden", name: "campaign", value: id });
    compare.append(field);
  }
});
clear.addEventListener("click", () => {
  chosen.clear();
  keep();
  apply();
});
list.addEventListener("change", ({ target }) => {
  if (!target.matches(".choose")) return;
  if (target.checked) chosen.add(target.value);
  else chosen.delete(target.value);
  keep();
  tell();
});
list.addEventListener("click", ({ target }) => {
  const summary = target.closest(".study > details > summary");
  if (!summary) return;
  const { id } = summary.closest(".study");
  if (summary.parentElement.open) unfolded.delete(id);
  else unfolded.add(id);
  keep();
});
new MutationObserver(apply).observe(list, { childList: true, subtree: true, attributes: true });
apply();

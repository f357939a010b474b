// The page for a new campaign: shows the cost, or all errors, while the form is edited.
const PAUSE_MS = 300;

const form = document.getElementById("new");
const text = document.getElementById("text");
let waiting = 0;
let asked = 0;

async function look() {
  const mine = ++asked;
  const fields = new URLSearchParams(new FormData(form));
  fields.set("step", "outcome");
  try {
    const response = await fetch(form.action, { method: "POST", body: fields });
    if (!response.ok || mine !== asked) return;
    const fresh = document.createElement("div");
    fresh.innerHTML = await response.text();
    if (mine !== asked) return;
    const outcome = document.getElementById("outcome");
    outcome.dataset.defaults = fresh.querySelector("#outcome").dataset.defaults ?? "{}";
    outcome.replaceChildren(...fresh.querySelector("#outcome").childNodes);
    mark();
  } catch {
    // The coordinator does not respond now. If a person submits the form, the browser shows this.
  }
}

// Marks all wrong fields, and shows the defaults of the empty ones.
function mark() {
  const defaults = JSON.parse(document.getElementById("outcome").dataset.defaults ?? "{}");
  const errors = [...document.querySelectorAll("#outcome .error[data-field]")];
  for (const field of form.querySelectorAll("[aria-describedby^=about-]")) {
    const own = errors.filter((error) => error.dataset.field === field.id);
    if (own.length > 0) field.setAttribute("aria-invalid", "true");
    else field.removeAttribute("aria-invalid");
    if (field.name in defaults) field.placeholder = defaults[field.name];
    const place = document.getElementById(field.getAttribute("aria-describedby")).querySelector(".error");
    const label = field.name === "robots" ? "" : `${field.labels[0].textContent} `;
    const told = own.map((error) => {
      const line = document.createElement("span");
      line.textContent = label + error.dataset.brief;
      return line;
    });
    place.replaceChildren(...told);
  }
}

// Selects the first wrong line of a file.
function select() {
  const line = Number(document.querySelector("#outcome .error[data-line]")?.dataset.line);
  if (!text || !line) return;
  const lines = text.value.split("\n");
  const from = lines.slice(0, line - 1).reduce((sum, before) => sum + before.length + 1, 0);
  text.focus();
  text.setSelectionRange(from, from + (lines[line - 1]?.length ?? 0));
}

// A link to a field in a folded section unfolds the section.
document.addEventListener("click", ({ target }) => {
  const field = document.getElementById(target.closest("a[href^='#']")?.hash.slice(1) ?? "");
  for (let folded = field?.closest("details"); folded; folded = folded.parentElement.closest("details")) folded.open = true;
});
// A person who writes own robots means them, not a preset.
document.getElementById("robot")?.addEventListener("input", ({ target }) => {
  if (target.value.trim()) form.elements.model.value = "";
});
form.addEventListener("input", () => {
  clearTimeout(waiting);
  waiting = setTimeout(look, PAUSE_MS);
});
document.getElementById("model")?.addEventListener("change", ({ target }) => {
  if (!target.value) document.querySelector(".own-robots").open = true;
});
document.getElementById("file")?.addEventListener("change", async ({ target }) => {
  const [file] = target.files;
  if (!file) return;
  text.value = await file.text();
  look();
});

// People who follow a link of this page and come back find the form as they left it; browsers do not restore it.
const DRAFT = "murmuration.draft";
addEventListener("pagehide", () => {
  const fields = [...form.elements].filter((field) => field.name && field.type !== "file" && field.type !== "hidden");
  const values = fields.map((field) => [field.name, field.type === "checkbox" ? field.checked : field.value]);
  sessionStorage.setItem(DRAFT, JSON.stringify({ page: location.search, values }));
});
function restore() {
  const { page, values } = JSON.parse(sessionStorage.getItem(DRAFT) ?? "{}");
  const cameBack = performance.getEntriesByType("navigation")[0]?.type === "back_forward";
  if (!cameBack || page !== location.search) return;
  for (const [name, value] of values) {
    const field = form.elements[name];
    if (field?.type === "checkbox") field.checked = value;
    else if (field && "value" in field) field.value = value;
    const section = field?.closest?.("details");
    if (value && section) section.open = true;
  }
  look();
}
mark();
select();
restore();

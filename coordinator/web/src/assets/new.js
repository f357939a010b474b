// The page for a new campaign: shows the cost, or the error, while the form is edited.
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
    document.getElementById("outcome").replaceChildren(...fresh.querySelector("#outcome").childNodes);
    mark();
  } catch {
    // The coordinator does not respond now. If a person submits the form, the browser shows this.
  }
}

// Marks the wrong field.
function mark() {
  const wrong = document.querySelector("#outcome .error")?.dataset.field;
  for (const field of form.querySelectorAll(".field input, .field select")) {
    const is = Boolean(wrong) && (field.name === wrong || field.name.endsWith(`.${wrong}`));
    if (is) field.setAttribute("aria-invalid", "true");
    else field.removeAttribute("aria-invalid");
  }
}

// Selects the wrong line of a file.
function select() {
  const line = Number(document.querySelector("#outcome .error")?.dataset.line);
  if (!text || !line) return;
  const lines = text.value.split("\n");
  const from = lines.slice(0, line - 1).reduce((sum, before) => sum + before.length + 1, 0);
  text.focus();
  text.setSelectionRange(from, from + (lines[line - 1]?.length ?? 0));
}

form.addEventListener("input", () => {
  clearTimeout(waiting);
  waiting = setTimeout(look, PAUSE_MS);
});
document.getElementById("file")?.addEventListener("change", async ({ target }) => {
  const [file] = target.files;
  if (!file) return;
  text.value = await file.text();
  look();
});
mark();
select();

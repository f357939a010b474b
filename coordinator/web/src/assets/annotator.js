// The annotator's name, which the browser keeps, and the id of this window.

const NAME = "murmuration.annotator";
const SESSION = "murmuration.session";

export function random() {
  const bytes = crypto.getRandomValues(new Uint8Array(12));
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}

// The rule-based judge's name is reserved, in upper and lower case and with any characters between its letters.
const isReserved = (name) => name.toLowerCase().replace(/[^\p{L}\p{N}]/gu, "") === "synthetic";

export function annotator() {
  const name = localStorage.getItem(NAME) ?? "";
  return isReserved(name) ? "" : name;
}

export function rename(name) {
  if (name.trim() && !isReserved(name)) localStorage.setItem(NAME, name.trim());
}

// Shows the annotator's name in a field, in which people can change it. Calls `renamed()` after a change in the field or on
// another page of this browser.
export function showName(field, renamed) {
  field.value = annotator();
  field.addEventListener("change", () => {
    rename(field.value);
    field.value = annotator();
    renamed();
  });
  const look = () => {
    if (field.value === annotator()) return;
    field.value = annotator();
    renamed();
  };
  addEventListener("storage", ({ key }) => key === NAME && look());
  addEventListener("pageshow", look);
}

// The window keeps its id through a reload, so that it gets the same questions again. A duplicated window gets a new id.
export async function session() {
  const known = sessionStorage.getItem(SESSION);
  if (known && (await claim(known))) return known;
  const fresh = random();
  sessionStorage.setItem(SESSION, fresh);
  await claim(fresh);
  return fresh;
}

// Locks the window's id for as long as the page is open. Browsers have locks only on trusted connections. On other connections,
// the id is used without a lock.
function claim(id) {
  if (!navigator.locks) return true;
  return new Promise((resolve) => {
    const held = () => {
      resolve(true);
      return new Promise(() => {});
    };
    // A reloaded page possibly waits until the browser has closed the page before it.
    const signal = AbortSignal.timeout(1000);
    navigator.locks.request(`murmuration.${id}`, { signal }, held).catch(() => resolve(false));
  });
}

// Waits until a person has entered the annotator's name on this or another page. If the form is in a dialog, opens the dialog.
// Resolves to false if a person closes the dialog without a name.
export function introduced() {
  if (annotator()) return Promise.resolve(true);
  const form = document.getElementById("who");
  const dialog = form.closest("dialog");
  const ending = new AbortController();
  const { signal } = ending;
  form.hidden = false;
  dialog?.showModal();
  form.elements.annotator.focus();
  return new Promise((resolve) => {
    const end = (isKnown) => {
      ending.abort();
      form.hidden = true;
      form.elements.annotator.blur();
      dialog?.close();
      resolve(isKnown);
    };
    const look = () => annotator() && end(true);
    dialog?.addEventListener("close", () => end(annotator() !== ""), { signal });
    for (const event of ["storage", "pageshow"]) addEventListener(event, look, { signal });
    form.elements.annotator.oninput = (event) => event.target.setCustomValidity("");
    form.onsubmit = (event) => {
      event.preventDefault();
      const field = form.elements.annotator;
      field.setCustomValidity(isReserved(field.value) ? "This name is reserved for the rule-based judge. Choose another." : "");
      if (!form.reportValidity()) return;
      rename(field.value);
      look();
    };
  });
}

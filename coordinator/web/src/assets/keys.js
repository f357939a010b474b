// Which keys are for the page, and which for what has the focus; what the page's keys do, which people choose.
import { shown } from "./words.js";

const WAYS = ["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "Home", "End", "PageUp", "PageDown"];

// The keys that a control needs for itself; without a list, all. Whatever else is pressed on it is for the page.
const OWN = [
  ["input:not([type=checkbox], [type=range]), textarea"],
  ["select", [...WAYS, " ", "Enter", "Escape"]],
  ["[type=range]", WAYS],
  ["[type=checkbox]", [" "]],
  ["button, summary", [" ", "Enter"]],
  ["a", ["Enter"]],
];

// Keys as their marks show them, and those that do the same as another one unless somebody chooses otherwise.
const NAMES = { " ": "Space", ArrowLeft: "←", ArrowRight: "→", ArrowUp: "↑", ArrowDown: "↓" };
const ALIASES = { "=": "+", Backspace: "Delete" };
// Keys that browsers, dialogs and this list need.
const UNFIT = ["Tab", "Enter", "Escape", "?", "Dead", "Unidentified", "Process"];
const MODIFIERS = ["Shift", "Control", "Alt", "AltGraph", "Meta", "CapsLock"];
// The pages on which classes have keys.
const NAMING = ["label", "sheet", "map", "answers"];
// By action, the key that somebody chose for it in this browser.
const CHOSEN = "murmuration.keys";

const list = document.getElementById("keys");
// By name, the usual key of an action, what it does, and the pages that have it.
const actions = new Map(
  JSON.parse(list?.dataset.actions ?? "[]").map(([name, key, what, pages]) => [name, { key, what, pages }]),
);
const here = [...actions.keys()].filter((name) => actions.get(name).pages.includes(list.dataset.page));
let chosen = kept();
// By key, the class that it names on this page.
let classes = new Map();

function kept() {
  try {
    const entries = Object.entries(JSON.parse(localStorage.getItem(CHOSEN)) ?? {});
    return Object.fromEntries(entries.filter(([, key]) => typeof key === "string"));
  } catch {
    return {};
  }
}

// In an open list letters and digits look for an entry. Not every browser says whether a list is open.
const isOpen = (control) => CSS.supports("selector(:open)") && control.matches("select:open");

export function isForPage({ key, target, ctrlKey, metaKey, altKey }) {
  if (ctrlKey || metaKey || altKey || document.querySelector("dialog[open]")) return false;
  const own = OWN.find(([controls]) => target.closest(controls));
  if (!own) return true;
  const [, keys] = own;
  return keys !== undefined && !keys.includes(key) && !isOpen(target);
}

const keyOf = (name) => chosen[name] ?? actions.get(name).key;

// The name of what a key does on this page; nothing if it does nothing, or names a class.
export function actionOf(key) {
  if (classes.has(key)) return undefined;
  return here.find((name) => keyOf(name) === key) ?? here.find((name) => keyOf(name) === ALIASES[key]);
}

// Whether somebody chose a key for anything: no class gets it by itself.
export const isChosen = (key) => Object.values(chosen).includes(key);

// What somebody chose a key for, in words; nothing if it is free.
export function chosenFor(key) {
  const name = [...actions.keys()].find((name) => chosen[name] === key);
  return name && actions.get(name).what;
}

// Hears which keys name classes.
export function claim(keys) {
  classes = keys;
  tell();
}

// Shows the keys in force, on buttons and in the list. A key that a class has does nothing else, and that is said.
function tell() {
  for (const mark of document.querySelectorAll("kbd[data-action]")) {
    const key = keyOf(mark.dataset.action);
    mark.textContent = NAMES[key] ?? key;
    mark.hidden = classes.has(key);
  }
  for (const name of here) {
    const row = list.querySelector(`[data-of="${name}"]`);
    const by = classes.get(keyOf(name));
    row.querySelector(".taken").textContent = by ? `The class “${shown(by)}” has this key, ${keyOf(name)}. Choose another.` : "";
    row.querySelector("[data-do=reset]").hidden = !(name in chosen);
  }
}

// Why an action cannot have a key; nothing if it can.
function clash(name, key) {
  const said = NAMES[key] ?? key;
  if (UNFIT.includes(key) || /^F\d/.test(key)) {
    return `${said} cannot be chosen: browsers and this list need it. Press another key, or Escape to keep the present one.`;
  }
  const by = classes.get(key);
  if (by) return `${said} names the class “${shown(by)}”. Press another key, or give the class another one on the page Classes.`;
  const { pages } = actions.get(name);
  if (/^[1-9]$/.test(key) && !NAMING.includes(list.dataset.page) && pages.some((page) => NAMING.includes(page))) {
    return `${said} may name a class on another page where this key would count too. Press another key.`;
  }
  const other = [...actions].find(([one, of]) => one !== name && keyOf(one) === key && of.pages.some((page) => pages.includes(page)));
  if (other) return `${said} is taken: ${other[1].what}. Press another key, or change that one first.`;
  return undefined;
}

// Gives an action a key, or says why not; whether it did.
function give(name, key) {
  const why = clash(name, key);
  if (why) {
    say(why, true);
    return false;
  }
  if (key === actions.get(name).key) delete chosen[name];
  else chosen[name] = key;
  localStorage.setItem(CHOSEN, JSON.stringify(chosen));
  say(`${NAMES[key] ?? key}: ${actions.get(name).what}.`);
  tell();
  return true;
}

function say(words, isWrong = false) {
  const line = document.getElementById("keys-said");
  line.classList.toggle("wrong", isWrong);
  line.textContent = words;
}

// The button whose action waits for a key, and whether it has one, or keeps its own, once that key is let go: until then the key
// does nothing to the button or the dialog.
let waits = null;
let isDone = false;

function wait(button) {
  waits?.removeAttribute("aria-pressed");
  waits = button;
  isDone = false;
  button?.setAttribute("aria-pressed", "true");
}

function choose(event) {
  if (!waits || MODIFIERS.includes(event.key)) return;
  // The focus goes on, and with it the choice ends.
  if (event.key === "Tab") return;
  event.preventDefault();
  event.stopPropagation();
  if (isDone) return;
  const { key, ctrlKey, altKey, metaKey } = event;
  if (key === "Escape") {
    say("Nothing was changed.");
    isDone = true;
  } else if (ctrlKey || altKey || metaKey) say("Press one key alone.", true);
  else isDone = give(waits.closest("[data-of]").dataset.of, key);
}

function letGo(event) {
  if (!waits || event.key === "Tab") return;
  event.preventDefault();
  if (isDone) wait(null);
}

// A pointer leaves no focus behind: Space and arrows are the page's again. Keys leave it where it is.
document.addEventListener("change", ({ target }) => {
  if (target.matches("select, [type=checkbox], [type=range]") && !target.matches(":focus-visible")) target.blur();
});

// The list of the page's keys.
document.addEventListener("keydown", (event) => {
  if (event.key !== "?" || !list || !isForPage(event)) return;
  event.preventDefault();
  list.showModal();
});
document.querySelector("[data-do=keys]")?.addEventListener("click", () => list.showModal());
list?.addEventListener("click", ({ target }) => {
  const button = target.closest("[data-do]");
  if (!button) return;
  const { of } = button.closest("[data-of]").dataset;
  if (button.dataset.do === "reset") {
    wait(null);
    if (give(of, actions.get(of).key)) button.previousElementSibling.focus();
    return;
  }
  wait(button);
  say(`Press the new key for: ${actions.get(of).what}. Escape keeps ${NAMES[keyOf(of)] ?? keyOf(of)}.`);
});
list?.addEventListener("keydown", choose, true);
list?.addEventListener("keyup", letGo, true);
list?.addEventListener("cancel", (event) => waits && event.preventDefault());
list?.addEventListener("focusout", () => waits && wait(null));
// Another window of this browser chose a key.
addEventListener("storage", ({ key }) => {
  if (key !== CHOSEN) return;
  chosen = kept();
  tell();
});
tell();

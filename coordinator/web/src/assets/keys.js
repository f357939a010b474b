// Divides keys between the page and the focused control, and finds the action of each of the page's keys. People can change these
// keys.
import { shown } from "./words.js";

const WAYS = ["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "Home", "End", "PageUp", "PageDown"];

// The keys that a focused control keeps; a control without a list keeps all keys. The page gets the other keys.
const OWN = [
  ["input:not([type=checkbox], [type=range]), textarea"],
  ["select", [...WAYS, " ", "Enter", "Escape"]],
  ["[type=range]", WAYS],
  ["[type=checkbox]", [" "]],
  ["button, summary", [" ", "Enter"]],
  ["a", ["Enter"]],
];

// Labels of keys, and keys that stand for another key unless a person has chosen them for an action.
const NAMES = { " ": "Space", ArrowLeft: "←", ArrowRight: "→", ArrowUp: "↑", ArrowDown: "↓" };
const ALIASES = { "=": "+", Backspace: "Delete" };
// Keys that are reserved for browsers, dialogs and the list of keys.
const UNFIT = ["Tab", "Enter", "Escape", "?", "Dead", "Unidentified", "Process"];
const MODIFIERS = ["Shift", "Control", "Alt", "AltGraph", "Meta", "CapsLock"];
// The pages on which classes have keys.
const NAMING = ["label", "sheet", "map", "answers"];
// Storage key for the keys that people chose in this browser, by action.
const CHOSEN = "murmuration.keys";

const list = document.getElementById("keys");
// Actions by name: default key, description, and pages.
const actions = new Map(
  JSON.parse(list?.dataset.actions ?? "[]").map(([name, key, what, pages]) => [name, { key, what, pages }]),
);
const here = [...actions.keys()].filter((name) => actions.get(name).pages.includes(list.dataset.page));
let chosen = kept();
// The classes of this page, by key.
let classes = new Map();

function kept() {
  try {
    const entries = Object.entries(JSON.parse(localStorage.getItem(CHOSEN)) ?? {});
    return Object.fromEntries(entries.filter(([, key]) => typeof key === "string"));
  } catch {
    return {};
  }
}

// Whether the list of a menu is open: letters and digits then search for an entry. Some browsers do not show whether a list is
// open.
const isOpen = (control) => CSS.supports("selector(:open)") && control.matches("select:open");

export function isForPage({ key, target, ctrlKey, metaKey, altKey }) {
  if (ctrlKey || metaKey || altKey || document.querySelector("dialog[open]")) return false;
  const own = OWN.find(([controls]) => target.closest(controls));
  if (!own) return true;
  const [, keys] = own;
  return keys !== undefined && !keys.includes(key) && !isOpen(target);
}

const keyOf = (name) => chosen[name] ?? actions.get(name).key;

// The action of a key on this page; undefined if the key has no action, or names a class.
export function actionOf(key) {
  if (classes.has(key)) return undefined;
  return here.find((name) => keyOf(name) === key) ?? here.find((name) => keyOf(name) === ALIASES[key]);
}

// Whether a person chose this key for an action; classes do not get such a key automatically.
export const isChosen = (key) => Object.values(chosen).includes(key);

// The action for which a person chose this key, in words; undefined if nobody chose the key.
export function chosenFor(key) {
  const name = [...actions.keys()].find((name) => chosen[name] === key);
  return name && actions.get(name).what;
}

// Sets the keys that name classes.
export function claim(keys) {
  classes = keys;
  tell();
}

// Shows the current keys, on buttons and in the list of keys. If the key of a class hides an action, the list says so.
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

// The reason why an action cannot have a key; undefined if the action can have the key.
function clash(name, key) {
  const shownKey = NAMES[key] ?? key;
  if (UNFIT.includes(key) || /^F\d/.test(key)) {
    return `${shownKey} cannot be chosen: browsers and this list need it. Press another key, or Escape to keep the present one.`;
  }
  const by = classes.get(key);
  if (by) return `${shownKey} names the class “${shown(by)}”. Press another key, or give the class another one on the page Classes.`;
  const { pages } = actions.get(name);
  if (/^[1-9]$/.test(key) && !NAMING.includes(list.dataset.page) && pages.some((page) => NAMING.includes(page))) {
    return `${shownKey} may name a class on another page on which this action has the same key. Press another key.`;
  }
  const other = [...actions].find(([one, of]) => one !== name && keyOf(one) === key && of.pages.some((page) => pages.includes(page)));
  if (other) return `${shownKey} is taken: ${other[1].what}. Press another key, or change that one first.`;
  return undefined;
}

// Gives an action a key, or shows why the action cannot have this key. Returns whether the action has the key now.
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
  const line = document.getElementById("keys-message");
  line.classList.toggle("wrong", isWrong);
  line.textContent = words;
}

// The button that waits for a key, and whether the choice is done. Until a person releases the key, the key does not act on the
// button or the dialog.
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
  // Tab moves the focus, which ends the choice.
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

// After a click, a control loses the focus, so that Space and arrow keys act on the page again. After a key, the control keeps
// the focus.
document.addEventListener("change", ({ target }) => {
  if (target.matches("select, [type=checkbox], [type=range]") && !target.matches(":focus-visible")) target.blur();
});

// Opens the list of the page's keys.
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
// Another window of this browser changed a key.
addEventListener("storage", ({ key }) => {
  if (key !== CHOSEN) return;
  chosen = kept();
  tell();
});
tell();

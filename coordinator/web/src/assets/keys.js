// Which keys are for the page, and which for what has the focus.

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

// In an open list letters and digits look for an entry. Not every browser says whether a list is open.
const isOpen = (control) => CSS.supports("selector(:open)") && control.matches("select:open");

export function isForPage({ key, target, ctrlKey, metaKey, altKey }) {
  if (ctrlKey || metaKey || altKey || document.querySelector("dialog[open]")) return false;
  const own = OWN.find(([controls]) => target.closest(controls));
  if (!own) return true;
  const [, keys] = own;
  return keys !== undefined && !keys.includes(key) && !isOpen(target);
}

// A pointer leaves no focus behind: Space and arrows are the page's again. Keys leave it where it is.
document.addEventListener("change", ({ target }) => {
  if (target.matches("select, [type=checkbox], [type=range]") && !target.matches(":focus-visible")) target.blur();
});

// The list of the page's keys.
const list = document.getElementById("keys");
document.addEventListener("keydown", (event) => {
  if (event.key !== "?" || !list || !isForPage(event)) return;
  event.preventDefault();
  list.showModal();
});
document.querySelector("[data-do=keys]")?.addEventListener("click", () => list.showModal());

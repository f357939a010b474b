// The classes as buttons with keys, and a field for those that are new.

const KEYS = 9;

// Whether a key is meant for the page, not for what has the focus.
export function isForPage(event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return false;
  const { target } = event;
  if (target.closest("textarea, select")) return false;
  return !target.closest("input") || target.type === "checkbox" || target.type === "range";
}

export class Palette {
  // `answer(text)` hears what was chosen, `undo()` that it is to be taken back.
  constructor({ answer, undo }) {
    this.root = document.querySelector(".palette");
    this.buttons = this.root.querySelector(".classes");
    this.form = this.root.querySelector("form");
    this.field = this.form.elements.class;
    this.answer = answer;
    this.undo = undo;
    this.classes = [];
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      const name = this.field.value.trim();
      if (!name) return this.field.focus();
      this.field.value = "";
      this.field.blur();
      this.answer(name);
    });
    this.field.addEventListener("keydown", (event) => {
      if (event.key !== "Escape") return;
      this.field.value = "";
      this.field.blur();
    });
    this.root.addEventListener("click", (event) => {
      const button = event.target.closest("button");
      if (!button || button.form) return;
      // A pointer leaves no focus behind: Space plays.
      if (event.detail > 0) button.blur();
      if (button.dataset.do === "undo") this.undo();
      else this.answer(button.dataset.answer);
    });
    document.addEventListener("keydown", (event) => {
      if (event.repeat || !isForPage(event)) return;
      if (this.press(event.key)) event.preventDefault();
    });
  }

  press(key) {
    const place = /^[1-9]$/.test(key) ? Number(key) - 1 : -1;
    if (place >= 0) {
      const chosen = this.classes[place];
      if (chosen) this.answer(chosen.name);
      return Boolean(chosen);
    }
    if (key === "n") this.field.focus();
    else if (key === "u") this.undo();
    else if (key === "?" && this.root.querySelector("[data-answer='not sure']")) this.answer("not sure");
    else if (key === "s" && this.root.querySelector("[data-answer='skip']")) this.answer("skip");
    else return false;
    return true;
  }

  // Shows the classes, in their order, so that a key always means the same.
  show(classes) {
    this.classes = classes;
    const focused = this.buttons.contains(document.activeElement) ? document.activeElement.dataset.answer : null;
    this.buttons.replaceChildren(...classes.map((known, place) => this.button(known, place)));
    if (focused) this.buttons.querySelector(`[data-answer="${CSS.escape(focused)}"]`)?.focus();
    this.root.querySelector("datalist").replaceChildren(
      ...classes.map(({ name }) => {
        const option = document.createElement("option");
        option.value = name;
        return option;
      }),
    );
    this.root.classList.toggle("none", classes.length === 0);
  }

  button({ name, colour, labels }, place) {
    const button = document.createElement("button");
    button.type = "button";
    button.className = "class";
    button.dataset.answer = name;
    button.style.setProperty("--class", colour);
    const key = document.createElement("kbd");
    key.textContent = place < KEYS ? place + 1 : "";
    const text = document.createElement("span");
    text.className = "name";
    text.textContent = name;
    const count = document.createElement("span");
    count.className = "labels";
    count.textContent = labels;
    count.title = `${labels} behaviours`;
    button.append(key, text, count);
    return button;
  }
}

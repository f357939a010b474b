// The classes as buttons with keys, and a field for those that are new.
import { isForPage } from "./keys.js";
import { counted, grouped } from "./words.js";

const KEYS = 9;

export class Palette {
  // `answer(text)` names what the page shows and returns the individuals that it named; `outbox` takes later changes of it.
  constructor({ answer, outbox }) {
    this.root = document.querySelector(".palette");
    this.buttons = this.root.querySelector(".classes");
    this.form = this.root.querySelector("form");
    this.field = this.form.elements.class;
    this.choose = answer;
    this.outbox = outbox;
    // By class, the individuals that were called so here.
    this.said = new Map();
    // Pairs of classes of which somebody here said that they differ.
    this.differ = new Set();
    this.similar = null;
    this.classes = [];
    // By key, less one: the class that it means.
    this.keys = new Array(KEYS).fill(null);
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
      if (button.dataset.do === "undo") this.outbox.undo();
      else if (button.dataset.do === "instead") this.instead();
      else if (button.dataset.do === "differ") this.keep();
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
      const chosen = this.keys[place];
      if (chosen !== null) this.answer(chosen);
      return true;
    }
    if (key === "n") this.field.focus();
    else if (key === "u") this.outbox.undo();
    else if (key === "?" && this.root.querySelector("[data-answer='not sure']")) this.answer("not sure");
    else if (key === "s" && this.root.querySelector("[data-answer='skip']")) this.answer("skip");
    else return false;
    return true;
  }

  // A class keeps its key for as long as it is there, whichever others go; one that comes has the first that is free.
  assign(names) {
    this.keys = this.keys.map((name) => (names.includes(name) ? name : null));
    for (const name of names) {
      const free = this.keys.indexOf(null);
      if (free >= 0 && !this.keys.includes(name)) this.keys[free] = name;
    }
  }

  // Shows the classes, in their order.
  show(classes) {
    this.assign(classes.map(({ name }) => name));
    const focused = this.buttons.contains(document.activeElement) ? document.activeElement.dataset.answer : null;
    this.buttons.replaceChildren(...classes.map((known) => this.button(known)));
    if (focused) this.buttons.querySelector(`[data-answer="${CSS.escape(focused)}"]`)?.focus();
    this.root.querySelector("datalist").replaceChildren(
      ...classes.map(({ name }) => {
        const option = document.createElement("option");
        option.value = name;
        return option;
      }),
    );
    this.root.classList.toggle("none", classes.length === 0);
    this.warn(classes);
  }

  // Two names that are nearly the same may be meant to be one: what was said here can be said otherwise at once.
  warn(classes) {
    this.classes = classes;
    const pairs = classes.flatMap(({ name, near }) => near.map((other) => [name, other]));
    const open = pairs.filter((pair) => !this.differ.has(String([...pair].sort())));
    const own = open.filter(([name]) => this.said.has(name));
    this.similar = own.at(-1) ?? open[0] ?? null;
    const hint = this.root.querySelector(".near");
    hint.hidden = this.similar === null;
    if (!this.similar) return;
    const [name, other] = this.similar;
    hint.querySelector("p").textContent = `“${name}” and “${other}” are separate classes. Did you mean the same class?`;
    const instead = hint.querySelector("[data-do=instead]");
    instead.hidden = own.length === 0;
    instead.textContent = `Use “${other}” instead`;
  }

  // What was called by a name that was typed wrongly is called by the other.
  instead() {
    const [name, other] = this.similar;
    const indices = this.said.get(name);
    this.said.delete(name);
    this.outbox.answer(indices, other);
  }

  keep() {
    this.differ.add(String([...this.similar].sort()));
    this.warn(this.classes);
  }

  async answer(text) {
    const indices = await this.choose(text);
    if (indices) this.said.set(text, [...(this.said.get(text) ?? []), ...indices]);
  }

  button({ name, colour, labels }) {
    const button = document.createElement("button");
    button.type = "button";
    button.className = "class";
    button.dataset.answer = name;
    button.style.setProperty("--class", colour);
    const text = document.createElement("span");
    text.className = "name";
    text.textContent = name;
    const count = document.createElement("span");
    count.className = "labels";
    count.textContent = grouped(labels);
    count.title = counted(labels, "answer");
    const place = this.keys.indexOf(name);
    if (place >= 0) {
      const key = document.createElement("kbd");
      key.textContent = place + 1;
      button.append(key);
    }
    button.append(text, count);
    return button;
  }
}

// The classes as buttons with keys, and a field for those that are new.
import { keptAs } from "./coordinator.js";
import { actionOf, claim, isChosen, isForPage } from "./keys.js";
import { counted, grouped, shown } from "./words.js";

// The keys that classes get by themselves, in this order: digits, then the letters that no page uses.
const KEYS = [..."123456789abcdefghijklmopqtvwxyz"];
// Says that somebody does without the paper's classes.
const OFFERS = `${keptAs}.offers`;

export class Palette {
  // `answer(text)` names what the page shows and returns the individuals that it named; `outbox` takes later changes of it.
  constructor({ answer, outbox }) {
    this.root = document.querySelector(".palette");
    this.buttons = this.root.querySelector(".classes");
    this.offers = this.root.querySelector(".offered");
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
    // By key, the class that it means.
    this.keys = new Map();
    // The paper's classes, if they are offered.
    this.paper = null;
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
      else if (button.dataset.do === "own") this.hideOffers();
      else this.answer(button.dataset.answer);
    });
    document.addEventListener("keydown", (event) => {
      if (event.repeat || !isForPage(event)) return;
      if (this.press(event.key)) event.preventDefault();
    });
  }

  press(key) {
    const chosen = this.keys.get(key);
    if (chosen !== undefined) this.answer(chosen);
    else return this.act(actionOf(key)) || /^[1-9]$/.test(key);
    return true;
  }

  // Does what a key of the palette is for; whether it is one.
  act(name) {
    if (name === "name") this.field.focus();
    else if (name === "undo") this.outbox.undo();
    else if (name === "not-sure" && this.root.querySelector("[data-answer='not sure']")) this.answer("not sure");
    else if (name === "skip") this.answer("skip");
    else return false;
    return true;
  }

  // A class has the key that somebody chose for it. Else it keeps its key for as long as it is there, whichever others go; one
  // that comes has the first that is free, and that nobody here chose for something else.
  assign(classes) {
    const former = new Map([...this.keys].map(([key, name]) => [name, key]));
    this.keys = new Map(classes.filter(({ shortcut }) => shortcut).map(({ name, shortcut }) => [shortcut, name]));
    const others = classes.filter(({ shortcut }) => !shortcut).map(({ name }) => name);
    const free = (key) => key !== undefined && !this.keys.has(key) && !isChosen(key);
    const fresh = others.filter((name) => {
      const keeps = free(former.get(name));
      if (keeps) this.keys.set(former.get(name), name);
      return !keeps;
    });
    for (const name of fresh) {
      const key = KEYS.find(free);
      if (key) this.keys.set(key, name);
    }
    claim(this.keys);
  }

  // The paper's classes that no answer names yet. Where others began with words of their own, nothing is offered.
  offered(classes) {
    const names = new Set(classes.map(({ name }) => name));
    if (this.paper === null) {
      const paper = this.root.dataset.offered.split(" ");
      const begun = classes.length > 0 && !paper.some((name) => names.has(name));
      this.paper = begun || localStorage.getItem(OFFERS) === "none" ? [] : paper;
    }
    return this.paper.filter((name) => !names.has(name)).map((name) => ({ name }));
  }

  // The classes in the order in which they get keys: while the paper's are offered, these first, so that theirs are the same
  // whichever of them are named already.
  inOrder(classes, offered) {
    const all = [...classes, ...offered];
    const paper = this.paper.map((name) => all.find((of) => of.name === name));
    return [...paper, ...all.filter(({ name }) => !this.paper.includes(name))];
  }

  hideOffers() {
    localStorage.setItem(OFFERS, "none");
    this.paper = [];
    this.show(this.classes);
  }

  // Shows the classes, in their order, and those that are offered.
  show(classes) {
    const offered = this.offered(classes);
    const inOrder = this.inOrder(classes, offered);
    this.assign(inOrder);
    const focused = this.root.contains(document.activeElement) ? document.activeElement.dataset.answer : null;
    // A class that is offered stays where it is once it is named: whoever aims at the next one must not miss it.
    this.buttons.replaceChildren(...inOrder.map((known) => this.button(known)));
    this.offers.hidden = offered.length === 0;
    this.root.classList.add("ready");
    if (focused) this.root.querySelector(`[data-answer="${CSS.escape(focused)}"]`)?.focus();
    this.root.querySelector("datalist").replaceChildren(
      ...classes.map(({ name }) => {
        const option = document.createElement("option");
        option.value = shown(name);
        return option;
      }),
    );
    this.root.classList.toggle("none", classes.length + offered.length === 0);
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
    hint.querySelector("p").textContent = `“${shown(name)}” and “${shown(other)}” are separate classes. Did you mean the same class?`;
    const instead = hint.querySelector("[data-do=instead]");
    instead.hidden = own.length === 0;
    instead.textContent = `Use “${shown(other)}” instead`;
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

  // A class, or, without a colour, one that is offered.
  button({ name, colour, labels }) {
    const button = document.createElement("button");
    button.type = "button";
    button.className = colour ? "class" : "offer";
    button.dataset.answer = name;
    if (colour) button.style.setProperty("--class", colour);
    const text = document.createElement("span");
    text.className = "name";
    text.textContent = shown(name);
    const key = [...this.keys].find(([, of]) => of === name)?.[0];
    if (key) {
      const mark = document.createElement("kbd");
      mark.textContent = key;
      button.append(mark);
    }
    button.append(text);
    if (colour) {
      const count = document.createElement("span");
      count.className = "labels";
      count.textContent = grouped(labels);
      count.title = counted(labels, "answer");
      button.append(count);
    }
    return button;
  }
}

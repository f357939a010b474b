// The palette: the classes as buttons with keys, and a field for new classes.
import { keptAs } from "./coordinator.js";
import { actionOf, claim, isChosen, isForPage } from "./keys.js";
import { counted, grouped, shown } from "./words.js";

// The default keys of classes, in this order: digits, then letters that no page uses.
const KEYS = [..."123456789abcdefghijklmopqtvwxyz"];
// Storage key for whether a person has hidden the paper's classes.
const OFFERS = `${keptAs}.offers`;

export class Palette {
  // `answer(text)` names the page's individuals and returns them; the palette sends later changes of these answers to `outbox`.
  constructor({ answer, outbox }) {
    this.root = document.querySelector(".palette");
    this.buttons = this.root.querySelector(".classes");
    this.offers = this.root.querySelector(".offered");
    this.form = this.root.querySelector("form");
    this.field = this.form.elements.class;
    this.choose = answer;
    this.outbox = outbox;
    // The individuals that were named on this page, by class.
    this.named = new Map();
    // Pairs of similar classes that a person on this page wants to keep separate.
    this.differ = new Set();
    this.similar = null;
    this.classes = [];
    // Classes by key.
    this.keys = new Map();
    // The paper's classes if the palette offers them; null before the first `show`.
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
      // After a click, the button loses the focus, so that Space plays the motion.
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

  // Performs an action of the palette. Returns whether the palette has an action of this name.
  act(name) {
    if (name === "name") this.field.focus();
    else if (name === "undo") this.outbox.undo();
    else if (name === "not-sure" && this.root.querySelector("[data-answer='not sure']")) this.answer("not sure");
    else if (name === "skip") this.answer("skip");
    else return false;
    return true;
  }

  // Assigns keys to classes. A class has the key that a person chose for it. A class without a chosen key keeps its key for as
  // long as it exists. A new class gets the first key that is free and not chosen for an action.
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

  // The classes of the paper that have no answer. If people began with classes of their own, the palette offers no such class.
  offered(classes) {
    const names = new Set(classes.map(({ name }) => name));
    if (this.paper === null) {
      const paper = this.root.dataset.offered.split(" ");
      const begun = classes.length > 0 && !paper.some((name) => names.has(name));
      this.paper = begun || localStorage.getItem(OFFERS) === "none" ? [] : paper;
    }
    return this.paper.filter((name) => !names.has(name)).map((name) => ({ name }));
  }

  // The classes in the order in which they get keys. If the paper's classes are offered, they come first, so that their keys do
  // not depend on answers.
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

  // Shows the classes and the offered classes, in their order.
  show(classes) {
    const offered = this.offered(classes);
    const inOrder = this.inOrder(classes, offered);
    this.assign(inOrder);
    const focused = this.root.contains(document.activeElement) ? document.activeElement.dataset.answer : null;
    // An offered class stays in place when it gets its first answer, so that a click on its neighbour does not miss.
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

  // Warns of two classes with nearly the same name, and offers to change the answers given on this page.
  warn(classes) {
    this.classes = classes;
    const pairs = classes.flatMap(({ name, near }) => near.map((other) => [name, other]));
    const open = pairs.filter((pair) => !this.differ.has(String([...pair].sort())));
    const own = open.filter(([name]) => this.named.has(name));
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

  // Changes the answers with a mistyped class to the similar class.
  instead() {
    const [name, other] = this.similar;
    const indices = this.named.get(name);
    this.named.delete(name);
    this.outbox.answer(indices, other);
  }

  keep() {
    this.differ.add(String([...this.similar].sort()));
    this.warn(this.classes);
  }

  async answer(text) {
    const indices = await this.choose(text);
    if (indices) this.named.set(text, [...(this.named.get(text) ?? []), ...indices]);
  }

  // The button of a class; without a colour, the button of an offered class.
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

// Marked moments on the page Play: a table of a few moments of one or several swarms, with their pictures, names and features. The
// browser keeps them for as long as its window is open.
import { base } from "./base.js";
import { grouped } from "./words.js";

const KEPT = "murmuration.moments";
const MOST = 6;
// Width of a picture, in pixels.
const WIDTH = 112;

const element = (name, attributes = {}, ...content) => {
  const made = Object.assign(document.createElement(name), attributes);
  made.append(...content);
  return made;
};

// Whether the browser kept all of a moment: another version of this page can have kept it.
const isWhole = (mark) => Boolean(mark?.features?.length && mark.picture?.pixels && mark.query && mark.measured >= 0);

function kept() {
  try {
    const marks = JSON.parse(sessionStorage.getItem(KEPT)) ?? [];
    return Array.isArray(marks) ? marks.filter(isWhole) : [];
  } catch {
    return [];
  }
}

export class Marks {
  // `query` returns the state of the controls, `go` goes to a step of the current swarm, and `features` are the names of the
  // features. `status` is the line for messages.
  constructor(root, { query, go, features, status }) {
    Object.assign(this, { root, query, go, features, status });
    this.marks = kept();
    this.tell();
  }

  // Marks the current step: `moment` has the features and the name, and `canvas` shows the swarm.
  add(step, moment, canvas) {
    if (!moment) return this.say("There are no features to mark yet: wait for a few steps.");
    if (this.marks.length >= MOST) return this.say(`At most ${MOST} moments are kept: remove one first.`);
    const own = { query: this.query(), step, ...moment, picture: pictureOf(canvas) };
    this.marks = [...this.marks.filter((mark) => !isSame(mark, own)), own];
    this.keep();
    this.say(`Step ${grouped(step)} is marked.`);
  }

  remove(mark) {
    this.marks = this.marks.filter((other) => other !== mark);
    this.keep();
  }

  keep() {
    try {
      sessionStorage.setItem(KEPT, JSON.stringify(this.marks));
    } catch {
      this.say("This browser keeps no moments after this page is left.");
    }
    this.tell();
  }

  say(text) {
    this.status.classList.remove("wrong");
    this.status.textContent = text;
  }

  visit(mark) {
    if (mark.query === this.query()) this.go(mark.step);
    else location.assign(`${base}/play?${mark.query}#step=${mark.step}`);
  }

  tell() {
    this.root.hidden = this.marks.length === 0;
    const row = (name, cell) => element("tr", {}, element("th", { scope: "row" }, name), ...this.marks.map(cell));
    const features = this.features.map((name, place) =>
      row(name, ({ features }) => element("td", {}, Number(features[place].toPrecision(3)).toString())),
    );
    const measured = (mark) => element("td", {}, `step ${grouped(mark.measured)}`);
    const remove = (mark) => {
      const button = element("button", { type: "button", className: "plain" }, "Remove");
      button.ariaLabel = `Remove step ${grouped(mark.step)}`;
      button.addEventListener("click", () => this.remove(mark));
      return element("td", {}, button);
    };
    const table = this.root.querySelector("table");
    table.replaceChildren(
      element("thead", {}, this.heads()),
      element("tbody", {}, row("Behaviour", ({ name }) => element("td", {}, name)), ...features, row("Measured at", measured), row("Swarm", (mark) => this.swarm(mark)), row("", remove)),
    );
    // The last row has no name of its own, because its buttons have one each.
    table.querySelector("tbody tr:last-child th").replaceWith(element("td"));
  }

  heads() {
    const head = (mark) => {
      const picture = element("canvas", { ariaHidden: "true" });
      paint(picture, mark.picture);
      const button = element("button", { type: "button", className: "plain moment" }, picture, `Step ${grouped(mark.step)}`);
      button.addEventListener("click", () => this.visit(mark));
      return element("th", { scope: "col" }, button);
    };
    return element("tr", {}, element("td"), ...this.marks.map(head));
  }

  swarm({ query }) {
    const given = new URLSearchParams(query);
    const robots = given.get("robots");
    const named = [given.get("model") ?? "described", robots && `${robots} robots`, `seed ${given.get("seed")}`];
    return element("td", {}, query === this.query() ? "this one" : named.filter(Boolean).join(", "));
  }
}

const isSame = (one, other) => one.query === other.query && one.step === other.step;

// A small copy of a picture. The pages' Content-Security-Policy allows no pictures in addresses, so the pixels are kept.
function pictureOf(canvas) {
  const small = element("canvas", { width: WIDTH, height: Math.max(Math.round((WIDTH * canvas.height) / canvas.width), 1) });
  const pen = small.getContext("2d");
  pen.drawImage(canvas, 0, 0, small.width, small.height);
  const { data } = pen.getImageData(0, 0, small.width, small.height);
  return { height: small.height, pixels: btoa(Array.from(data, (value) => String.fromCharCode(value)).join("")) };
}

function paint(canvas, { height, pixels }) {
  Object.assign(canvas, { width: WIDTH, height });
  const data = Uint8ClampedArray.from(atob(pixels), (it) => it.charCodeAt(0));
  canvas.getContext("2d").putImageData(new ImageData(data, WIDTH, height), 0, 0);
}

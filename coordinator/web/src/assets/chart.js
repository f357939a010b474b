// A chart of lines over a common axis. It shows the values at the pointer or at a place that arrow keys choose.
import { grouped } from "./words.js";

const SVG = "http://www.w3.org/2000/svg";
const ROOM = { left: 52, right: 12, top: 10, bottom: 24 };
// Approximate number of grid lines besides the axis.
const GRID = 4;
const USUAL_HEIGHT = 180;
// Minimum grid step of an axis that does not begin at 0: with this step, three digits distinguish neighbouring percentages.
const LEAST_STEP = 0.1;

const element = (name, attributes = {}, text = "") => {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.textContent = text;
  return made;
};

// Rounds a value up to 1, 2 or 5 times a power of ten.
function roundUp(value) {
  const unit = 10 ** Math.floor(Math.log10(value));
  return unit * [1, 2, 5, 10].find((times) => times * unit >= value * (1 - 1e-9));
}

const short = (value) => (Number.isFinite(value) ? Number(value.toPrecision(3)).toString() : "–");
const lastOf = (values) => values.findLast(Number.isFinite);

export class Chart {
  // `across` is the name of the axis, `lines` has the names of the lines, and `name` formats a place on the axis. The vertical
  // axis begins at 0. With `fromLeast`, it begins below the lowest value, for percentages that are all high; `leastStep` is the
  // smallest distance between its grid lines. `chosen` is called with the place on the axis that a click or the key Enter chooses.
  constructor(root, { across, lines, name = grouped, fromLeast = false, leastStep = LEAST_STEP, height = USUAL_HEIGHT, chosen }) {
    this.root = root;
    this.across = across;
    this.lines = lines;
    this.name = name;
    this.fromLeast = fromLeast;
    this.leastStep = leastStep;
    this.height = height;
    this.gridLines = height < USUAL_HEIGHT ? GRID / 2 : GRID;
    this.chosen = chosen;
    this.events = [];
    // Linked charts, which show their values at the same place.
    this.beside = [];
    this.at = -1;
    // The place of the mark while there is no pointer on the chart; -1 for no mark.
    this.resting = -1;
    this.x = [];
    // The chart needs arrow keys, which screen readers pass to applications only.
    this.svg = element("svg", { role: "application", "aria-roledescription": "chart", tabindex: "0" });
    this.told = document.createElement("p");
    this.told.className = "reason";
    // Text for screen readers, which changes when a person presses a key, but not when values arrive.
    this.spoken = document.createElement("p");
    this.spoken.className = "unseen";
    this.spoken.setAttribute("role", "status");
    root.append(this.svg, this.told, this.spoken);
    this.svg.addEventListener("pointermove", ({ offsetX }) => this.point(this.nearest(offsetX)));
    this.svg.addEventListener("pointerleave", () => this.point(-1));
    this.svg.addEventListener("click", () => this.choose());
    this.svg.addEventListener("keydown", (event) => {
      if (event.key === "Enter") this.choose();
      const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (!way || this.x.length === 0) return;
      event.preventDefault();
      // On the page Play, the arrow keys have actions of their own.
      event.stopPropagation();
      const now = this.at < 0 ? this.resting : this.at;
      const from = now < 0 ? this.x.length - 1 : now + way;
      this.point(Math.min(Math.max(from, 0), this.x.length - 1));
      this.spoken.textContent = [this, ...this.beside].map(({ told }) => told.textContent).join("; ");
    });
    new ResizeObserver(() => this.draw()).observe(root);
  }

  // Links another chart, so that both charts show their values at the same place.
  link(other) {
    this.beside.push(other);
    other.beside.push(this);
  }

  // Shows the values of each line at each x, and marks events; a missing value is NaN. An event has an x and a text. It can also
  // have the place of the only line that it belongs to, a short label, and a mark that lines break at the event.
  show(x, values, events = []) {
    this.x = x;
    this.values = values;
    this.events = events.filter(({ x: at }) => at >= x[0] && at <= x.at(-1));
    const none = this.root.querySelector(".none");
    if (none) none.hidden = x.length > 1;
    for (const part of [this.svg, this.told]) part.toggleAttribute("hidden", x.length < 2);
    if (this.at >= x.length) this.at = -1;
    this.draw();
  }

  draw() {
    const width = this.root.clientWidth;
    if (this.x.length < 2 || width === 0) return;
    const finite = this.values.flat().filter(Number.isFinite);
    const [first, last] = [this.x[0], this.x.at(-1)];
    const most = Math.max(...finite, 0);
    // The axis can begin at 0, because no value is below 0.
    const least = this.fromLeast && finite.length ? Math.min(...finite) : 0;
    const fitting = roundUp((most - least || 1) / this.gridLines);
    const step = this.fromLeast ? Math.max(fitting, this.leastStep) : fitting;
    const low = step * Math.floor(least / step + 1e-9);
    const high = Math.max(step * Math.ceil(most / step - 1e-9), low + step);
    const [wide, tall] = [width - ROOM.left - ROOM.right, this.height - ROOM.top - ROOM.bottom];
    this.acrossOf = (x) => ROOM.left + ((x - first) / (last - first)) * wide;
    this.downOf = (y) => ROOM.top + tall * (1 - (y - low) / (high - low));
    this.svg.setAttribute("viewBox", `0 0 ${width} ${this.height}`);
    this.svg.setAttribute("height", this.height);
    this.svg.setAttribute("aria-label", this.summary());
    this.svg.replaceChildren(...this.grid(step, low, high, width), ...this.marked(), ...this.curves(), this.mark());
    this.tell();
  }

  grid(step, low, high, width) {
    const heights = Array.from({ length: Math.round((high - low) / step) + 1 }, (_, i) => low + step * i);
    const lines = heights.flatMap((value) => {
      const y = this.downOf(value);
      return [
        element("line", { class: "grid", x1: ROOM.left, x2: width - ROOM.right, y1: y, y2: y }),
        element("text", { x: ROOM.left - 6, y: y + 4, "text-anchor": "end" }, short(value)),
      ];
    });
    const y = this.height - 6;
    return [
      ...lines,
      element("text", { x: ROOM.left, y }, this.name(this.x[0])),
      element("text", { x: width / 2, y, "text-anchor": "middle" }, this.across),
      element("text", { x: width - ROOM.right, y, "text-anchor": "end" }, this.name(this.x.at(-1))),
    ];
  }

  // A vertical line for each event, with a flag whose title is the event's text.
  marked() {
    return this.events.map(({ x: at, text, line, label }) => {
      const x = this.acrossOf(at);
      const group = element("g", { class: line === undefined ? "event" : `event of-line key-${line}` });
      const title = element("title", {}, text);
      const flag = element("path", { d: `M${x - 5} ${ROOM.top - 8}h10l-5 7z` });
      group.append(title, element("line", { x1: x, x2: x, y1: ROOM.top, y2: this.height - ROOM.bottom }), flag);
      if (label && line === undefined) group.append(element("text", { x: x + 8, y: ROOM.top + 2 }, label));
      return group;
    });
  }

  curves() {
    return this.values.flatMap((values, line) => this.pieces(line).map(([from, to]) => {
      const points = values.slice(from, to).map((y, i) => [this.acrossOf(this.x[from + i]), this.downOf(y)]);
      const told = points.filter(([, y]) => Number.isFinite(y)).map((point) => point.join(","));
      // A piece of one point is drawn as a line without length, which its round caps make visible.
      return element("polyline", { class: `line line-${line}`, points: (told.length === 1 ? [...told, ...told] : told).join(" ") });
    }));
  }

  // The ranges over which a line has no break.
  pieces(line) {
    const breaks = this.events.filter((event) => event.breaks && (event.line ?? line) === line);
    const ends = breaks.map(({ x }) => this.nearestTo(x));
    return [0, ...ends].map((from, i) => [from, ends[i] ?? this.x.length]);
  }

  mark() {
    const group = element("g", { class: "mark-at" });
    const at = this.at < 0 ? Math.min(this.resting, this.x.length - 1) : this.at;
    if (at < 0) return group;
    const x = this.acrossOf(this.x[at]);
    group.append(element("line", { x1: x, x2: x, y1: ROOM.top, y2: this.height - ROOM.bottom }));
    this.values.forEach((values, line) => {
      const y = values[at];
      if (Number.isFinite(y)) group.append(element("circle", { class: `dot-${line}`, cx: x, cy: this.downOf(y), r: 4 }));
    });
    return group;
  }

  nearest(offset) {
    if (this.x.length < 2 || !this.acrossOf) return -1;
    return this.nearestBy((x) => Math.abs(this.acrossOf(x) - offset));
  }

  // The place of the x that is nearest to an event.
  nearestTo(at) {
    return this.nearestBy((x) => Math.abs(x - at));
  }

  nearestBy(distance) {
    let best = 0;
    for (let i = 1; i < this.x.length; i++) if (distance(this.x[i]) < distance(this.x[best])) best = i;
    return best;
  }

  point(at) {
    if (at === this.at) return;
    this.at = at;
    this.svg.querySelector(".mark-at")?.replaceWith(this.mark());
    this.tell();
    for (const chart of this.beside) chart.point(at);
  }

  // Moves the mark that is shown while there is no pointer on the chart to the value nearest to `x`.
  rest(x) {
    const place = this.x.length > 1 ? this.nearestTo(x) : -1;
    if (place === this.resting || !this.acrossOf) return;
    this.resting = place;
    if (this.at >= 0 || place < 0) return;
    this.svg.querySelector(".mark-at")?.replaceWith(this.mark());
    this.tell();
  }

  choose() {
    if (this.chosen && this.at >= 0) this.chosen(this.x[this.at]);
  }

  // Shows the values at the pointer, or else those at the resting mark or the last values.
  tell() {
    const marked = this.at < 0 ? Math.min(this.resting, this.x.length - 1) : this.at;
    const at = marked < 0 ? this.x.length - 1 : marked;
    const events = this.events.filter((event) => this.nearestTo(event.x) === at).map(({ text }) => ` · ${text}`);
    this.told.replaceChildren(
      `${this.across} ${this.name(this.x[at])}: `,
      ...this.lines.flatMap((name, line) => {
        const key = document.createElement("span");
        key.className = `key-${line}`;
        // A line that ends before the other lines shows the place of its end.
        const place = marked < 0 ? this.values[line].findLastIndex((value) => Number.isFinite(value)) : at;
        const where = place >= 0 && place !== at ? ` (${this.across} ${this.name(this.x[place])})` : "";
        key.textContent = `${name} ${short(this.values[line][place])}${where}`;
        return line === 0 ? [key] : [" · ", key];
      }),
      ...events,
    );
  }

  summary() {
    const last = this.lines.map((name, line) => `${name} ${short(lastOf(this.values[line]))}`).join(", ");
    return `${this.lines.join(" and ")} by ${this.across}, last ${last}. Arrow keys move from value to value${this.chosen ? "; Enter goes to the value" : ""}.`;
  }
}

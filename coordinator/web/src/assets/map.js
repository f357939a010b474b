// The Map page: shows which behaviours are alike; people name the behaviours inside a line that they draw.
import { introduced, session } from "./annotator.js";
import { NAMELESS_CLASS, colouring, legendEntry } from "./colours.js";
import { archived, follow, get, insist, keptAs, path, pause } from "./coordinator.js";
import { column } from "./drawing.js";
import { Filter } from "./filter.js";
import { Gallery } from "./gallery.js";
import { isForPage } from "./keys.js";
import { lasso } from "./lasso.js";
import { Menus } from "./menus.js";
import { Outbox, beforeLearning, complain, tellDoing } from "./outbox.js";
import { agreed } from "./overwrite.js";
import { Palette } from "./palette.js";
import { layPaths } from "./paths.js";
import { Player, playerKey } from "./player.js";
import { Pins } from "./pins.js";
import { steer, zoomButtons } from "./plot.js";
import { Points } from "./points.js";
import { Sketch } from "./sketch.js";
import { Views } from "./views.js";
import { counted, grouped, shown } from "./words.js";

const at = (id) => document.getElementById(id);
const status = at("status");
const over = at("over");
const tip = at("tip");
const dark = matchMedia("(prefers-color-scheme: dark)");
const plot = new Points(at("points"));
const sketch = new Sketch(over, plot, () => points?.isMedoid ?? [], (pen) => {
  if (points && pinned) pins.lead(pen, points.medoids.map((i) => [plot.across[i], plot.down[i]]), dark.matches, () => 0.9);
});
const player = new Player(document.querySelector(".player"));
const filter = new Filter(`${keptAs}.map`);
const pins = new Pins(at("pins"), document.querySelector(".zoom"));
const menus = new Menus(filter, (kind) => (kind === "annotator" ? answeredBy() : sift()));
const views = new Views(plot, (canGoBack) => (at("back").disabled = !canGoBack));
const gallery = new Gallery(at("gallery"), at("gallery-line"), {
  play: choose,
  drop: (i) => select([...selected].filter((other) => other !== i)),
});
// Delay before a motion is requested, because a pointer that passes a point needs no motion.
const STAYS_MS = 150;
// Prefix of the storage keys for choices on this page, which all campaigns share.
const CHOICE = "murmuration.map.";
const MOST_PINS = 60;
let known = { classes: [], of: new Map(), machine: new Set() };
let points = null;
// The view for which the pins were arranged; empty if there are no pins.
let pinned = "";
// Individuals that the filter's annotator has answered.
let answered = null;
let selected = new Set();
// The current colour of each point.
let colourOf = () => 0;

const outbox = new Outbox(await session(), {
  told: (_, reply) => palette.show(reply.classes),
  refused: (_, error) => complain(status, error),
  changed: (outbox) => outbox.tell(status),
});
const palette = new Palette({ answer, outbox });
beforeLearning(outbox);

async function answer(text) {
  if (selected.size === 0) {
    complain(status, new Error("Select behaviours first: draw a line around them."));
    return;
  }
  if (!(await introduced())) return;
  const indices = await agreed(known, [...selected], text);
  if (indices.length === 0) return;
  outbox.answer(indices, text);
  select([]);
  return indices;
}

// Repaints the points and the legend.
function paint() {
  if (!points) return;
  const kind = at("colouring").value;
  const { of, entries } = colouring(kind, points, known, dark.matches);
  colourOf = of;
  const focused = document.activeElement?.closest("#legend button")?.dataset.value;
  at("legend").replaceChildren(...entries.map((entry) => legendEntry(entry, filter.hidden[kind])));
  if (focused !== undefined) at("legend").querySelector(`[data-value="${CSS.escape(focused)}"]`)?.focus();
  tellShown();
  draw();
}

// Repaints the points in their current colours.
function draw() {
  plot.show(colourOf, { selected, standsOut: (i) => known.of.has(i) || points.isMedoid.has(i) }, dark.matches);
  pin();
  sketch.draw();
}

// Arranges the pins of the medoids, if the map has changed its size or its part since. Many medoids have only rings.
function pin() {
  const { clientWidth: width, clientHeight: height } = over;
  const view = [width, height, plot.reach, plot.corner, at("projection").value, points.archive_version].join(" ");
  if (view === pinned || points.medoids.length > MOST_PINS) return;
  pinned = view;
  const places = points.medoids.map((i) => [plot.across[i], plot.down[i]]);
  pins.arrange(places, [width, height], (x, y) => plot.isOn(x, y));
}

// The value by which a filter hides a point.
function valueOf(kind, i) {
  if (kind === "class") return known.classes[known.of.get(i)]?.name ?? NAMELESS_CLASS;
  if (kind === "cluster") return points.cluster[i];
  if (kind === "robustness") return points.robust[i];
  if (kind === "annotator") return answered?.has(i) ? filter.picked.annotator : null;
  return Math.floor(i / points.population);
}

// Applies the filter, and deselects hidden points.
function sift() {
  if (!points) return;
  filter.keep();
  plot.visible = filter.shown(points.count, valueOf);
  plot.sort();
  if (plot.visible) selected = new Set([...selected].filter((i) => plot.visible[i]));
  hover(-1);
  tellSelected();
  paint();
}

function tellShown() {
  const shown = plot.visible ? plot.visible.reduce((sum, is) => sum + is, 0) : points.count;
  const all = counted(points.count, "individual");
  at("shown").textContent = plot.visible ? `${grouped(shown)} of ${all} are shown.` : `All ${all} are shown.`;
  at("show-all").disabled = plot.visible === null;
}

function nameOf(i) {
  if (!known.of.has(i)) return "unnamed";
  const { name } = known.classes[known.of.get(i)];
  return known.machine.has(i) ? `${shown(name)} (by the rule-based judge)` : shown(name);
}

// The number of an individual's cluster, in words; empty if the individual has no cluster yet.
function clusterOf(i) {
  const cluster = points.cluster[i];
  if (cluster === undefined) return "";
  return points.isMedoid.has(i) ? ` · medoid of cluster ${cluster + 1}` : ` · cluster ${cluster + 1}`;
}

// Says that an individual is the centre of a sweep; empty for all others.
const centreOf = (i) => (i === points.centre ? " · the centre of the sweep" : "");

// The robustness of an individual, in words; empty if individuals have only one start.
function robustnessOf(i) {
  return i < points.robust.length ? ` · robustness ${points.robust[i]} of ${points.starts}` : "";
}

let stays = 0;
function hover(i) {
  if (i === sketch.hovered) return;
  sketch.hovered = i;
  tip.hidden = i < 0;
  tip.querySelector(".paths")?.remove();
  clearTimeout(stays);
  if (i >= 0) stays = setTimeout(() => layPaths(tip, i, () => sketch.hovered === i), STAYS_MS);
  if (i >= 0) {
    tip.querySelector("img").src = path(archived(i));
    tip.querySelector("p").textContent = `${grouped(i)} · ${nameOf(i)}${clusterOf(i)}${robustnessOf(i)}${centreOf(i)}`;
    const [x, y] = [plot.across[i], plot.down[i]];
    const left = x + 14 + tip.offsetWidth > over.clientWidth ? x - tip.offsetWidth - 14 : x + 14;
    tip.style.left = `${Math.max(left, 4)}px`;
    tip.style.top = `${Math.min(Math.max(y - tip.offsetHeight / 2, 4), over.clientHeight - tip.offsetHeight - 4)}px`;
  }
  sketch.draw();
}

function choose(i) {
  if (i < 0) return;
  at("chosen").textContent = `Individual ${grouped(i)}, generation ${grouped(Math.floor(i / points.population))}, ${nameOf(i)}${clusterOf(i)}${robustnessOf(i)}${centreOf(i)}.`;
  const examples = at("examples").querySelector("form");
  examples.action = path(`individuals/${i}/search`);
  for (const button of examples.querySelectorAll("button")) button.disabled = false;
  player.show(i).catch((error) => complain(status, error));
  const card = at("gallery").querySelector(`[data-index="${i}"]`);
  if (card) layPaths(card, i);
}

function select(indices, adds = false) {
  selected = new Set(adds ? [...selected, ...indices] : indices);
  tellSelected();
  paint();
}

// Shows the number of selected individuals, and how many of them have a class that an answer would change.
function tellSelected() {
  const named = [...selected].filter((i) => known.of.has(i)).length;
  const already = named === 0 ? "" : named === selected.size ? ", all already named" : `, ${grouped(named)} of them already named`;
  gallery.show([...selected], nameOf);
  at("selected").textContent = selected.size
    ? `${grouped(selected.size)} selected${already}: which class?`
    : "Draw a line around behaviours to label them.";
}

const moves = (event) => event.button === 1 || (event.button === 0 && (event.ctrlKey || isMoving()));
const isMoving = () => at("move").getAttribute("aria-pressed") === "true";
at("move").addEventListener("click", () => at("move").setAttribute("aria-pressed", String(!isMoving())));
function moved() {
  if (!points) return;
  views.moved();
  hover(-1);
  redraw();
}
function back() {
  if (!points || !views.back()) return;
  hover(-1);
  redraw();
}
at("back").addEventListener("click", back);
// Each click on a zoom button is a separate step in the history of views.
document.querySelector(".zoom").addEventListener("click", () => views.settle(), true);
// The map is repainted at most once per frame, even if it moves more often.
let due = false;
function redraw() {
  if (due) return;
  due = true;
  requestAnimationFrame(() => {
    due = false;
    plot.layOut();
    plot.repaint(true);
    pin();
    sketch.draw();
  });
}
steer(over, plot, { wheels: () => true, drags: moves, changed: moved });
zoomButtons(document.querySelector(".zoom"), plot, moved);
lasso(over, over, {
  draws: (event) => !moves(event),
  click: ([x, y]) => choose(plot.nearest(x, y)),
  inside: (drawn, adds) => select(plot.within(drawn), adds),
  draw: (drawn) => {
    sketch.line = drawn;
    sketch.draw();
  },
});
over.addEventListener("pointermove", (event) => {
  if (!sketch.line) hover(plot.nearest(event.offsetX, event.offsetY));
});
over.addEventListener("pointerleave", () => hover(-1));
over.addEventListener("keydown", (event) => {
  const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  const way = ways[event.key];
  const { hovered } = sketch;
  if (way) {
    const next = plot.towards(hovered, ...way);
    if (next >= 0 && plot.reveal(next)) {
      views.moved();
      draw();
    }
    hover(next);
  } else if (event.key === "+" || event.key === "-" || event.key === "Home") {
    document.querySelector(`[data-zoom=${{ "+": "in", "-": "out", Home: "whole" }[event.key]}]`).click();
  } else if (event.key === "Backspace") back();
  else if (event.key === "Enter") choose(hovered);
  else if (event.key === " " && hovered >= 0) {
    if (selected.has(hovered)) select([...selected].filter((i) => i !== hovered));
    else select([hovered], true);
  } else return;
  event.preventDefault();
  event.stopPropagation();
});
document.addEventListener("keydown", (event) => {
  if (!isForPage(event)) return;
  if (event.key === "Escape") select([]);
  else if (playerKey(player, event)) event.preventDefault();
});
at("legend").addEventListener("click", (event) => {
  const button = event.target.closest("button");
  if (!button) return;
  const kind = at("colouring").value;
  const valueOn = ({ dataset }) => (kind === "class" ? dataset.value : Number(dataset.value));
  const value = valueOn(button);
  const all = [...at("legend").querySelectorAll("button")].map(valueOn);
  if (event.shiftKey) filter.only(kind, value, all);
  else filter.toggle(kind, value);
  sift();
});
// Loads the answers of the filter's annotator.
async function answeredBy() {
  const name = filter.picked.annotator;
  if (name !== null) {
    const told = await insist(() => get("answers/standing"));
    if (name !== filter.picked.annotator) return;
    const [individual, by] = [column(told.individual, Uint32Array), column(told.annotator, Uint16Array)];
    answered = new Set(individual.filter((_, i) => told.annotators[by[i]] === name));
  }
  sift();
}
at("colouring").addEventListener("change", () => {
  localStorage.setItem(`${CHOICE}colouring`, at("colouring").value);
  paint();
});
at("projection").addEventListener("change", () => {
  localStorage.setItem(`${CHOICE}projection`, at("projection").value);
  plot.whole();
  views.forget();
  settle();
});
dark.addEventListener("change", paint);
addEventListener("resize", () => {
  if (!points) return;
  plot.layOut();
  paint();
});

const read = (places) => [column(places.x, Uint16Array), column(places.y, Uint16Array), places.spans];

// Explanations of distances on the map.
const DISTANCES = {
  axes:
    "The axes are the two directions in which the behaviours vary most, both at the same scale. Behaviours that are far " +
    "apart here differ; behaviours that are close may still differ in other directions.",
  neighbours: "Behaviours that are close here are alike. The distance between groups means nothing.",
};

function settle() {
  const places = points.places[at("projection").value] ?? points.places.axes;
  at("distances").textContent = DISTANCES[at("projection").value];
  plot.place(...places);
  sift();
}

// Restores the chosen colouring. The default is by class if any individual has a class, or else by cluster.
function chooseColours() {
  const menu = at("colouring");
  const kept = localStorage.getItem(`${CHOICE}colouring`);
  const offered = (value) => menu.querySelector(`[value="${CSS.escape(value ?? "")}"]:not(:disabled)`);
  menu.value = offered(kept) ? kept : known.of.size === 0 && offered("cluster") ? "cluster" : "class";
}

// Loads the points of the current archive, and their places by t-SNE once these are computed.
async function load() {
  const [about, axes] = await Promise.all([insist(() => get("points")), insist(() => get("points/axes"))]);
  const cluster = column(about.cluster, Uint16Array);
  filter.of(`${about.archive_version} ${about.medoids}`);
  const sizes = about.medoids.map(() => 0);
  for (const of of cluster) sizes[of]++;
  const [robust, isMedoid] = [column(about.robust, Uint8Array), new Set(about.medoids)];
  points = { ...about, cluster, sizes, robust, isMedoid, places: { axes: read(axes) } };
  points.count = points.places.axes[0].length;
  sketch.centre = points.centre;
  document.querySelector(".plane .empty").hidden = points.count > 0;
  pinned = "";
  pins.fill(
    points.medoids.slice(0, points.medoids.length > MOST_PINS ? 0 : MOST_PINS).map((index, place) => ({
      picture: path(archived(index)),
      colour: points.clusterColours[place],
      name: points.clusterLabels[place] ?? "",
    })),
  );
  for (const option of at("colouring")) {
    if (option.value === "cluster") option.disabled = sizes.length === 0;
    if (option.value === "robustness") option.disabled = points.robust.length === 0;
  }
  menus.offer("cluster", sizes.map((size, place) => [place, `${place + 1} (${grouped(size)})`]));
  offer(false);
  chooseColours();
  settle();
  begin();
  const loaded = points;
  for (;;) {
    const neighbours = await insist(() => get("points/neighbours"));
    if (points !== loaded) return;
    if (neighbours) {
      loaded.places.neighbours = read(neighbours);
      return offer(true);
    }
    await pause(1000);
  }
}

// Enables or disables the choice of t-SNE, depending on whether its places are computed.
function offer(there) {
  const option = at("projection").querySelector("[value=neighbours]");
  option.disabled = !there;
  option.textContent = there ? "t-SNE" : "t-SNE (being computed)";
  if (!there) at("projection").value = "axes";
  else if (localStorage.getItem(`${CHOICE}projection`) === "neighbours" && at("projection").value === "axes") {
    at("projection").value = "neighbours";
    settle();
  }
}

async function label() {
  const labels = await insist(() => get("labels"));
  const individual = column(labels.individual, Uint32Array);
  const of = column(labels.class, Uint16Array);
  const machine = column(labels.machine, Uint8Array);
  known = {
    classes: labels.classes,
    of: new Map(Array.from(individual, (index, i) => [index, of[i]])),
    machine: new Set(individual.filter((_, i) => machine[i])),
  };
  palette.show(labels.classes);
  menus.offer("annotator", labels.annotators.map((name) => [name, name]));
  menus.offer("class", [...labels.classes.map(({ name }) => [name, shown(name)]), [NAMELESS_CLASS, "unnamed"]]);
  if (points) chooseColours();
  await answeredBy();
}

// Shows the individual that the address names, once, when points and names have been loaded.
let named = /^#individual-(\d{1,9})$/.exec(location.hash)?.[1];
function begin() {
  if (!points || entries === null || !(named < points.count)) return;
  choose(Number(named));
  named = undefined;
}

let stands = null;
let entries = null;
follow(async (seen) => {
  tellDoing(seen);
  const [moved, labelled] = [seen.archive_state !== stands, seen.labels !== entries];
  [stands, entries] = [seen.archive_state, seen.labels];
  if (moved) load().catch((error) => complain(status, error));
  if (labelled) await label();
  begin();
});

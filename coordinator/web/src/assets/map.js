// The Map page: shows which behaviours are alike, and names those that a line is drawn around.
import { introduced, session } from "./annotator.js";
import { archived, follow, get, insist, path, pause } from "./coordinator.js";
import { column, fit } from "./drawing.js";
import { isForPage } from "./keys.js";
import { lasso, trace } from "./lasso.js";
import { Outbox, beforeLearning, complain, tellDoing } from "./outbox.js";
import { Palette } from "./palette.js";
import { Player, playerKey } from "./player.js";
import { Points } from "./points.js";
import { grouped } from "./words.js";

const at = (id) => document.getElementById(id);
const status = at("status");
const over = at("over");
const tip = at("tip");
const dark = matchMedia("(prefers-color-scheme: dark)");
const NAMELESS = { light: 0xa5a39b, dark: 0x6d6e68 };
const plot = new Points(at("points"));
const player = new Player(document.querySelector(".player"));
let known = { classes: [], of: new Map(), machine: new Set() };
let points = null;
let selected = new Set();
let hovered = -1;
let line = null;

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
  await introduced();
  const indices = [...selected];
  outbox.answer(indices, text);
  select([]);
  return indices;
}

const number = (colour) => parseInt(colour.slice(1), 16);

// A colour for each point, and what the colours mean.
function colouring() {
  const nameless = dark.matches ? NAMELESS.dark : NAMELESS.light;
  switch (at("colouring").value) {
    case "cluster": {
      const colours = points.clusterColours.map(number);
      const entries = points.clusterColours.map((colour, i) => [colour, `cluster ${i + 1}`, points.sizes[i]]);
      return { of: (i) => colours[points.cluster[i]] ?? nameless, entries };
    }
    case "generation": {
      const last = Math.max(Math.ceil(points.count / points.population) - 1, 1);
      const of = (i) => shade(Math.floor(i / points.population) / last);
      const mark = (part) => [`#${shade(part).toString(16).padStart(6, "0")}`, `generation ${grouped(Math.round(part * last))}`];
      return { of, entries: [0, 0.5, 1].map(mark) };
    }
    case "robustness": {
      const of = (i) => (i < points.robust.length ? shade(points.robust[i] / points.starts) : nameless);
      const counts = Array.from({ length: points.starts + 1 }, () => 0);
      for (const robust of points.robust) counts[robust]++;
      const mark = (count, robust) => [
        `#${shade(robust / points.starts).toString(16).padStart(6, "0")}`,
        `${robust} of ${points.starts} trials nearest to the individual's medoid`,
        count,
      ];
      return { of, entries: counts.map(mark) };
    }
    default: {
      const colours = known.classes.map(({ colour }) => number(colour));
      const entries = known.classes.map(({ colour, name }, place) => [colour, name, individualsOf(place)]).filter(([, , of]) => of);
      entries.push([`#${nameless.toString(16)}`, "unnamed", points.count - known.of.size]);
      return { of: (i) => (known.of.has(i) ? colours[known.of.get(i)] : nameless), entries };
    }
  }
}

// How many individuals are of a class, and how many of them only the rule-based judge named; nothing if there are none.
function individualsOf(place) {
  const all = [...known.of].filter(([, of]) => of === place).map(([index]) => index);
  const machine = all.filter((index) => known.machine.has(index)).length;
  if (all.length === 0) return null;
  if (machine === 0) return grouped(all.length);
  if (machine === all.length) return `${grouped(all.length)}, named only by the rule-based judge`;
  return `${grouped(all.length)}, ${grouped(machine)} of them only by the rule-based judge`;
}

// From early to late: three colours that differ in lightness too.
function shade(part) {
  const stops = dark.matches ? [0x3f5f9e, 0x3fa58c, 0xf0dc5a] : [0xd9b51f, 0x2f8f83, 0x33337f];
  const from = stops[part < 0.5 ? 0 : 1];
  const to = stops[part < 0.5 ? 1 : 2];
  const way = (part * 2) % 1 || (part === 0 ? 0 : part === 0.5 ? 0 : 1);
  const mix = (shift) => Math.round(((from >> shift) & 255) * (1 - way) + ((to >> shift) & 255) * way) << shift;
  return mix(16) | mix(8) | mix(0);
}

function paint() {
  if (!points) return;
  const { of, entries } = colouring();
  plot.show(of, selected, dark.matches);
  at("legend").replaceChildren(...entries.map(entry));
  sketch();
}

function entry([colour, name, count]) {
  const item = document.createElement("li");
  const mark = document.createElement("span");
  mark.className = "mark";
  mark.style.setProperty("--class", colour);
  item.append(mark, count === undefined ? name : `${name} · ${typeof count === "number" ? grouped(count) : count}`);
  return item;
}

// What changes with the pointer, above the points.
function sketch() {
  fit(over);
  const pen = over.getContext("2d");
  const dense = over.width / Math.max(over.clientWidth, 1);
  pen.setTransform(dense, 0, 0, dense, 0, 0);
  pen.clearRect(0, 0, over.clientWidth, over.clientHeight);
  const ink = getComputedStyle(over).color;
  if (line) trace(pen, line, ink);
  if (hovered < 0) return;
  pen.strokeStyle = ink;
  pen.lineWidth = 2;
  pen.beginPath();
  pen.arc(plot.across[hovered], plot.down[hovered], 7, 0, 2 * Math.PI);
  pen.stroke();
}

function nameOf(i) {
  if (!known.of.has(i)) return "unnamed";
  const { name } = known.classes[known.of.get(i)];
  return known.machine.has(i) ? `${name} (by the rule-based judge)` : name;
}

// How many of its starts lead to the behaviour of its cluster; nothing where individuals have one.
function robustnessOf(i) {
  return i < points.robust.length ? ` · robustness ${points.robust[i]} of ${points.starts}` : "";
}

function hover(i) {
  if (i === hovered) return;
  hovered = i;
  tip.hidden = i < 0;
  if (i >= 0) {
    tip.querySelector("img").src = path(archived(i));
    tip.querySelector("p").textContent = `${grouped(i)} · ${nameOf(i)}${robustnessOf(i)}`;
    const [x, y] = [plot.across[i], plot.down[i]];
    const left = x + 14 + tip.offsetWidth > over.clientWidth ? x - tip.offsetWidth - 14 : x + 14;
    tip.style.left = `${Math.max(left, 4)}px`;
    tip.style.top = `${Math.min(Math.max(y - tip.offsetHeight / 2, 4), over.clientHeight - tip.offsetHeight - 4)}px`;
  }
  sketch();
}

function choose(i) {
  if (i < 0) return;
  at("chosen").textContent = `Individual ${grouped(i)}, generation ${grouped(Math.floor(i / points.population))}, ${nameOf(i)}${robustnessOf(i)}.`;
  player.show(i).catch((error) => complain(status, error));
}

function select(indices, adds = false) {
  selected = new Set(adds ? [...selected, ...indices] : indices);
  tellSelected();
  paint();
}

// Says how many are selected, and how many of these have a class that an answer would change.
function tellSelected() {
  const named = [...selected].filter((i) => known.of.has(i)).length;
  const already = named === 0 ? "" : named === selected.size ? ", all already named" : `, ${grouped(named)} of them already named`;
  at("selected").textContent = selected.size
    ? `${grouped(selected.size)} selected${already}: which class?`
    : "Draw a line around behaviours to label them.";
}

lasso(over, over, {
  click: ([x, y]) => choose(plot.nearest(x, y)),
  inside: (drawn, adds) => select(plot.within(drawn), adds),
  draw: (drawn) => {
    line = drawn;
    sketch();
  },
});
over.addEventListener("pointermove", (event) => {
  if (!line) hover(plot.nearest(event.offsetX, event.offsetY));
});
over.addEventListener("pointerleave", () => hover(-1));
over.addEventListener("keydown", (event) => {
  const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  const way = ways[event.key];
  if (way) hover(plot.towards(hovered, ...way));
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
at("colouring").addEventListener("change", paint);
at("projection").addEventListener("change", settle);
dark.addEventListener("change", paint);
addEventListener("resize", () => {
  if (!points) return;
  plot.layOut();
  paint();
});

const read = (places) => [column(places.x, Uint16Array), column(places.y, Uint16Array), places.spans];

// The meaning of a distance on the map.
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
  hover(-1);
  paint();
}

// Reads the archive as it stands; t-SNE follows when it is there.
async function load() {
  const [about, axes] = await Promise.all([insist(() => get("points")), insist(() => get("points/axes"))]);
  const cluster = column(about.cluster, Uint16Array);
  const sizes = about.medoids.map(() => 0);
  for (const of of cluster) sizes[of]++;
  points = { ...about, cluster, sizes, robust: column(about.robust, Uint8Array), places: { axes: read(axes) } };
  points.count = points.places.axes[0].length;
  document.querySelector(".plane .empty").hidden = points.count > 0;
  for (const option of at("colouring")) {
    if (option.value === "cluster") option.disabled = sizes.length === 0;
    if (option.value === "robustness") option.disabled = points.robust.length === 0;
  }
  offer(false);
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

// t-SNE can be chosen once it is known.
function offer(there) {
  const option = at("projection").querySelector("[value=neighbours]");
  option.disabled = !there;
  option.textContent = there ? "t-SNE" : "t-SNE (being computed)";
  if (!there) at("projection").value = "axes";
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
  tellSelected();
  paint();
}

// The individual that an address names is shown once, when it is there with its name.
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
  const now = `${seen.archive_version} ${seen.individuals} ${seen.completed}`;
  const [moved, said] = [now !== stands, seen.labels !== entries];
  [stands, entries] = [now, seen.labels];
  if (moved) load().catch((error) => complain(status, error));
  if (said) await label();
  begin();
});

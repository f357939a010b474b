// A cluster at once: those that differ are marked, the others are named together.
import { annotator, introduced, session } from "./annotator.js";
import { archived, follow, get, insist, path } from "./coordinator.js";
import { column, fit } from "./drawing.js";
import { encloses, lasso, trace } from "./lasso.js";
import { Outbox, beforeLearning, complain, tellDoing } from "./outbox.js";
import { Palette, isForPage } from "./palette.js";
import { Player } from "./player.js";

const SHOWN = 28;

const at = (id) => document.getElementById(id);
const status = at("status");
const sheet = at("sheet");
const over = at("over");
const player = new Player(document.querySelector(".player"));
let clusters = [];
let labelled = new Set();
// Those that were put off: they come again once there is nothing else.
let later = new Set();

await introduced();
const outbox = new Outbox(await session(), {
  async told(item, reply) {
    palette.show(reply.classes);
    if (item.path === "undo") await load();
  },
  async refused(_, error) {
    complain(status, error);
    await load();
  },
  changed: (outbox) => outbox.tell(status),
});
const palette = new Palette({ answer, undo });
beforeLearning(outbox);

function answer(text) {
  const rest = cards().filter((card) => card.getAttribute("aria-pressed") === "false");
  if (rest.length === 0) return;
  const answers = rest.map((card) => ({ index: Number(card.dataset.index), answer: text }));
  for (const { index } of answers) labelled.add(index);
  for (const card of cards()) if (card.getAttribute("aria-pressed") === "true") later.add(Number(card.dataset.index));
  outbox.add("labels", { annotator: annotator(), answers });
  lay();
}

function undo() {
  outbox.add("undo", { annotator: annotator() });
}

const cards = () => [...sheet.children];

function lay() {
  const members = clusters[Number(at("cluster").value)] ?? [];
  const open = members.filter((index) => !labelled.has(index));
  let shown = open.filter((index) => !later.has(index));
  if (shown.length === 0) {
    later = new Set();
    shown = open;
  }
  shown = shown.slice(0, SHOWN);
  sheet.replaceChildren(...shown.map(card));
  const empty = document.querySelector(".sheet .empty");
  empty.hidden = shown.length > 0;
  empty.textContent = clusters.length
    ? "Every behaviour of this cluster has a name."
    : "There are no clusters yet: they are made when the search has ended.";
  tell(open.length);
}

function card(index) {
  const button = document.createElement("button");
  button.type = "button";
  button.className = "card";
  button.dataset.index = index;
  button.setAttribute("aria-pressed", "false");
  button.setAttribute("aria-label", `Individual ${index} differs`);
  const image = document.createElement("img");
  image.src = path(archived(index));
  image.width = 100;
  image.height = 100;
  image.alt = "";
  image.draggable = false;
  button.append(image);
  return button;
}

function toggle(card, differs = card.getAttribute("aria-pressed") === "false") {
  card.setAttribute("aria-pressed", String(differs));
  tell();
}

let open = 0;
function tell(count = open) {
  open = count;
  const all = cards().length;
  const marked = cards().filter((card) => card.getAttribute("aria-pressed") === "true").length;
  at("rest").textContent = all
    ? `${all - marked} of ${all} alike, ${marked} differ${marked === 1 ? "s" : ""}; ${open} of this cluster without a name.`
    : "Nothing to name here.";
}

function go(by) {
  const cluster = at("cluster");
  const next = cluster.selectedIndex + by;
  if (next < 0 || next >= cluster.length) return;
  cluster.selectedIndex = next;
  lay();
}

lasso(over, sheet, {
  click: ([x, y]) => {
    const place = sheet.getBoundingClientRect();
    const hit = document.elementFromPoint(x + place.left, y + place.top)?.closest(".card");
    if (hit) toggle(hit);
  },
  inside: (line) => {
    const place = sheet.getBoundingClientRect();
    for (const card of cards()) {
      const box = card.getBoundingClientRect();
      const [x, y] = [(box.left + box.right) / 2 - place.left, (box.top + box.bottom) / 2 - place.top];
      if (encloses(line, x, y)) toggle(card);
    }
  },
  draw: (line) => {
    fit(over);
    const pen = over.getContext("2d");
    const dense = over.width / Math.max(over.clientWidth, 1);
    pen.setTransform(dense, 0, 0, dense, 0, 0);
    pen.clearRect(0, 0, over.clientWidth, over.clientHeight);
    if (line) trace(pen, line, getComputedStyle(over).color);
  },
});
sheet.addEventListener("click", (event) => {
  // Pointers are the lasso's; this is the keyboard.
  if (event.detail === 0) toggle(event.target.closest(".card"));
});
// A pointer that only passes wants no motion.
let looking = 0;
const look = (event) => {
  const card = event.target.closest(".card");
  clearTimeout(looking);
  if (!card || Number(card.dataset.index) === player.index) return;
  looking = setTimeout(() => player.show(Number(card.dataset.index)).catch((error) => complain(status, error)), 150);
};
sheet.addEventListener("pointerover", look);
sheet.addEventListener("focusin", look);
at("cluster").addEventListener("change", lay);
at("before").addEventListener("click", () => go(-1));
at("after").addEventListener("click", () => go(1));
document.addEventListener("keydown", (event) => {
  if (!isForPage(event)) return;
  if (event.key === "ArrowLeft") go(-1);
  else if (event.key === "ArrowRight") go(1);
});

async function load() {
  const [points, labels] = await Promise.all([insist(() => get("points")), insist(() => get("labels"))]);
  const of = column(points.cluster, Uint16Array);
  clusters = points.medoids.map((medoid) => [medoid]);
  of.forEach((cluster, index) => {
    if (index !== points.medoids[cluster]) clusters[cluster].push(index);
  });
  labelled = new Set(column(labels.individual, Uint32Array));
  const chosen = at("cluster").value;
  at("cluster").replaceChildren(
    ...clusters.map((members, place) => new Option(`${place + 1} (${members.length})`, place)),
  );
  if (chosen && chosen < clusters.length) at("cluster").value = chosen;
  palette.show(labels.classes);
  lay();
}
await load();

let stands = null;
follow((seen) => {
  tellDoing(seen);
  const now = `${seen.checkpoint} ${seen.completed}`;
  // Other clusters.
  if (stands !== null && stands !== now) load();
  stands = now;
});

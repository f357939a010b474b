// The Sheet page: shows a whole cluster; people mark the behaviours that differ and name the other behaviours together.
import { introduced, session } from "./annotator.js";
import { archived, follow, get, insist, path } from "./coordinator.js";
import { column, fit } from "./drawing.js";
import { actionOf, isForPage } from "./keys.js";
import { encloses, lasso, trace } from "./lasso.js";
import { Outbox, beforeLearning, complain, tellDoing } from "./outbox.js";
import { Palette } from "./palette.js";
import { layPaths } from "./paths.js";
import { Player } from "./player.js";
import { counted, grouped } from "./words.js";

const SHOWN = 28;

const at = (id) => document.getElementById(id);
const status = at("status");
const sheet = at("sheet");
const over = at("over");
const player = new Player(document.querySelector(".player"));
let clusters = [];
// Properties of the clustering: its number of individuals, its archive version, and whether it is final.
let made = { of: 0, archive_version: null, final: false };
// New clusters, which are shown after the next answer or choice, so that nothing moves before a click.
let coming = null;
let labelled = new Set();
// Individuals that were answered on this page, acknowledged or not.
const answered = new Set();
// Individuals that people marked as different, which are shown again when no other individual is left.
let later = new Set();

await introduced();
const outbox = new Outbox(await session(), {
  async told(item, reply) {
    palette.show(reply.classes);
    if (item.path === "undo") await forget(reply.individuals);
  },
  async refused(item, error) {
    complain(status, error);
    await forget((item.body.answers ?? []).map(({ index }) => index));
  },
  changed: (outbox) => outbox.tell(status),
});
const palette = new Palette({ answer, outbox });
beforeLearning(outbox);

function answer(text) {
  const rest = cards().filter((card) => card.getAttribute("aria-pressed") === "false");
  if (rest.length === 0) return;
  const indices = rest.map((card) => Number(card.dataset.index));
  for (const index of indices) {
    answered.add(index);
    labelled.add(index);
  }
  for (const card of cards()) if (card.getAttribute("aria-pressed") === "true") later.add(Number(card.dataset.index));
  outbox.answer(indices, text);
  look();
  return indices;
}

// Shows individuals again whose answers were refused or undone.
async function forget(indices) {
  for (const index of indices) answered.delete(index);
  await load();
  if (coming) show(coming);
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
    ? "Every behaviour in this cluster is named."
    : "There are no behaviours until the first generation is complete.";
  tell(open.length);
}

function card(index) {
  const button = document.createElement("button");
  button.type = "button";
  button.className = "card";
  button.dataset.index = index;
  button.setAttribute("aria-pressed", "false");
  button.setAttribute("aria-label", `Individual ${grouped(index)} differs`);
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
    ? `${all} shown: your answer names ${all - marked}; ${marked} marked as different. ${grouped(open)} in this cluster are unnamed.`
    : "There is nothing to name here.";
}

function go(by) {
  const cluster = at("cluster");
  const next = cluster.selectedIndex + by;
  if (next < 0 || next >= cluster.length) return;
  cluster.selectedIndex = next;
  look();
}

// Shows the chosen cluster, from the newest clusters.
function look() {
  if (coming) show(coming);
  else lay();
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
  // Only clicks by key are handled here; the lasso handles pointers.
  if (event.detail === 0) toggle(event.target.closest(".card"));
});
// A motion is requested after a delay, because a pointer that passes a card needs no motion.
let looking = 0;
const watch = (event) => {
  const card = event.target.closest(".card");
  clearTimeout(looking);
  if (!card || Number(card.dataset.index) === player.index) return;
  looking = setTimeout(() => {
    player.show(Number(card.dataset.index)).catch((error) => complain(status, error));
    layPaths(card, Number(card.dataset.index));
  }, 150);
};
sheet.addEventListener("pointerover", watch);
sheet.addEventListener("focusin", watch);
at("cluster").addEventListener("change", look);
at("fresh").addEventListener("click", look);
at("before").addEventListener("click", () => go(-1));
at("after").addEventListener("click", () => go(1));
document.addEventListener("keydown", (event) => {
  if (!isForPage(event)) return;
  const name = actionOf(event.key);
  if (name === "previous") go(-1);
  else if (name === "next") go(1);
});

// Loads the current clusters; the displayed cluster stays until the next choice or answer.
async function load() {
  const [points, labels] = await Promise.all([insist(() => get("points")), insist(() => get("labels"))]);
  labelled = new Set([...column(labels.individual, Uint32Array), ...answered]);
  palette.show(labels.classes);
  const of = column(points.cluster, Uint16Array);
  made = { of: of.length, archive_version: points.archive_version, final: points.final };
  const fresh = points.medoids.map((medoid) => [medoid]);
  of.forEach((cluster, index) => {
    if (index !== points.medoids[cluster]) fresh[cluster].push(index);
  });
  if (cards().length === 0) return show(fresh);
  coming = fresh;
  tellHowFar();
}

// Switches to other clusters, and chooses the cluster with the medoid of the cluster that was displayed before.
function show(fresh) {
  const first = clusters[Number(at("cluster").value)]?.[0];
  const chosen = fresh.findIndex((members) => members.includes(first));
  clusters = fresh;
  coming = null;
  at("cluster").replaceChildren(
    ...clusters.map((members, place) => new Option(`${place + 1} (${grouped(members.length)})`, place)),
  );
  if (chosen >= 0) at("cluster").value = chosen;
  tellHowFar();
  lay();
}

// Shows which behaviours the clusters come from, and whether new clusters wait.
function tellHowFar() {
  at("fresh").hidden = coming === null;
  if (coming) at("so-far").textContent = "The archive has been clustered again. The new clusters appear with your next answer.";
  else if (made.final || made.of === 0) at("so-far").textContent = "";
  else at("so-far").textContent = `These are the clusters of the first ${counted(made.of, "behaviour")}; the search may continue.`;
}

// Whether the coordinator has newer clusters. During the search, newer clusters count only once the archive has grown by a
// quarter.
function isOutgrown(seen) {
  const grown = seen.individuals > made.of + Math.floor(made.of / 4);
  return grown || seen.archive_version !== made.archive_version || (seen.completed && !made.final);
}

let latest = null;
let busy = false;
async function keepUp(seen) {
  latest = seen;
  if (busy) return;
  busy = true;
  for (let looked = null; looked !== latest; ) {
    looked = latest;
    if (isOutgrown(looked)) await load().catch((error) => complain(status, error));
  }
  busy = false;
}

await load();
follow((seen) => {
  tellDoing(seen);
  keepUp(seen);
});

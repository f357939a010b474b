// The Answers page: shows the standing answers; people select answers, and change or withdraw their own answers.
import { annotator, introduced, session } from "./annotator.js";
import { archived, follow, get, insist, path, pause } from "./coordinator.js";
import { column } from "./drawing.js";
import { actionOf, isForPage } from "./keys.js";
import { Outbox, complain } from "./outbox.js";
import { Palette } from "./palette.js";
import { layPaths } from "./paths.js";
import { Player } from "./player.js";
import { counted, grouped, shown } from "./words.js";

// Minimum time between two requests for all answers.
const PAUSE_MS = 1000;
// Number of pictures that are added at a time.
const PART = 60;
// Numbers of answers that name no class.
const NOT_SURE = 65535;
const SKIP = 65534;

const at = (id) => document.getElementById(id);
const status = at("status");
const list = at("answers");
const player = new Player(document.querySelector(".player"));
let told = { classes: [], annotators: [] };
// All standing answers, newest first.
let answers = [];
let found = [];
let room = PART;
// The selected answers, by the key from `keyOf`.
const selected = new Map();

const keyOf = ({ index, by }) => `${index} ${by}`;

await introduced();
const outbox = new Outbox(await session(), {
  told: (_, reply) => palette.show(reply.classes),
  refused: (_, error) => complain(status, error),
  changed: (outbox) => outbox.tell(status),
});
const palette = new Palette({ answer, outbox });

// The individuals of the selected answers, without duplicates.
const individuals = () => [...new Set([...selected.values()].map(({ index }) => index))];
const own = (indices) => answers.filter(({ index, by }) => by === annotator() && indices.includes(index));

async function answer(text) {
  const indices = individuals();
  if (indices.length === 0) {
    complain(status, new Error("Select pictures first: click them."));
    return;
  }
  const others = own(indices).filter(({ given }) => given !== text);
  if (indices.length > 1 && others.length > 0) {
    const asked =
      `You have already answered ${grouped(others.length)} of the ${counted(indices.length, "selected behaviour")} differently. ` +
      `“${shown(text)}” would replace your earlier answers.`;
    if (!(await agreed("Replace your answers?", asked, `Name all ${grouped(indices.length)}`))) return;
  }
  outbox.answer(indices, text);
  select([]);
  return indices;
}

async function withdraw() {
  const indices = own(individuals()).map(({ index }) => index);
  if (indices.length === 0) {
    complain(status, new Error("None of the selected answers is yours. You can withdraw only your own."));
    return;
  }
  if (indices.length > 1) {
    const asked =
      `${counted(indices.length, "answer")} of yours will no longer count, and these behaviours are asked about again. ` +
      "Undo does not bring them back.";
    if (!(await agreed("Withdraw your answers?", asked, `Withdraw ${grouped(indices.length)}`))) return;
  }
  outbox.add("withdraw", { annotator: annotator(), individuals: indices });
  select([]);
}

async function agreed(title, text, yes) {
  const dialog = at("confirm");
  at("confirm-title").textContent = title;
  dialog.querySelector("p").textContent = text;
  dialog.querySelector("[value=yes]").textContent = yes;
  dialog.returnValue = "";
  dialog.showModal();
  await new Promise((resolve) => dialog.addEventListener("close", resolve, { once: true }));
  return dialog.returnValue === "yes";
}

function select(chosen) {
  selected.clear();
  for (const one of chosen) selected.set(keyOf(one), one);
  tell();
}

function toggle(one) {
  if (!selected.delete(keyOf(one))) {
    selected.set(keyOf(one), one);
    player.show(one.index).catch((error) => complain(status, error));
    layPaths(list.querySelector(`[data-key="${CSS.escape(keyOf(one))}"]`), one.index);
  }
  status.classList.remove("wrong");
  outbox.tell(status);
  tell();
}

function tell() {
  for (const card of list.children) card.setAttribute("aria-pressed", String(selected.has(card.dataset.key)));
  const mine = own(individuals()).length;
  at("selected").textContent =
    selected.size === 0
      ? "Nothing is selected."
      : `${counted(selected.size, "answer")} selected, ${grouped(mine)} of them yours: which class?`;
  at("withdraw").disabled = mine === 0;
}

// Shows the answers that match the menus.
function sift() {
  const [by, given] = [at("by").value, at("given").value];
  found = answers.filter((one) => (by === "" || one.by === by) && (given === "" || one.given === given));
  for (const [key, one] of selected) if (!found.includes(one)) selected.delete(key);
  lay();
}

function lay() {
  const focused = list.contains(document.activeElement) ? document.activeElement.dataset.key : null;
  list.replaceChildren(...found.slice(0, room).map(card));
  if (focused) list.querySelector(`[data-key="${CSS.escape(focused)}"]`)?.focus();
  at("counted").textContent = `${counted(found.length, "answer")}${found.length === answers.length ? "" : ` of ${grouped(answers.length)}`}`;
  at("more").hidden = found.length <= room;
  const empty = document.querySelector(".sight .empty");
  empty.hidden = found.length > 0;
  empty.textContent = answers.length ? "No answers match these filters." : "Nobody has answered yet.";
  tell();
}

function card(one) {
  const button = document.createElement("button");
  button.type = "button";
  button.className = "answer";
  button.dataset.key = keyOf(one);
  const picture = document.createElement("img");
  picture.loading = "lazy";
  picture.width = 100;
  picture.height = 100;
  picture.alt = "";
  picture.src = path(archived(one.index));
  const what = document.createElement("span");
  what.className = "given";
  what.textContent = shown(one.given);
  if (one.colour) what.style.setProperty("--class", one.colour);
  const who = document.createElement("span");
  who.className = "reason";
  who.textContent = `${grouped(one.index)} · ${one.by}`;
  who.title = new Date(one.time).toLocaleString("en");
  button.append(picture, what, who);
  button.addEventListener("click", () => toggle(one));
  return button;
}

async function load() {
  told = await insist(() => get("answers/standing"));
  const [index, by] = [column(told.individual, Uint32Array), column(told.annotator, Uint16Array)];
  const [given, time] = [column(told.answer, Uint16Array), column(told.time, Float64Array)];
  const nameOf = (place) => (place === NOT_SURE ? "not sure" : place === SKIP ? "skip" : told.classes[place].name);
  answers = Array.from(index, (of, i) => ({
    index: of,
    by: told.annotators[by[i]],
    given: nameOf(given[i]),
    colour: told.classes[given[i]]?.colour,
    time: time[i],
  }));
  answers.sort((one, other) => other.time - one.time || other.index - one.index);
  const chosen = [...selected.keys()];
  selected.clear();
  for (const one of answers) if (chosen.includes(keyOf(one))) selected.set(keyOf(one), one);
  palette.show(told.classes);
  fill(at("by"), "everybody", [...told.annotators].sort().map((name) => [name, name]));
  const used = [...new Set(answers.map(({ given }) => given))].sort();
  fill(at("given"), "any", used.map((name) => [name, shown(name)]));
  sift();
}

// Fills a menu with values, and keeps the current choice.
function fill(menu, all, entries) {
  const chosen = menu.value;
  menu.replaceChildren(new Option(all, ""), ...entries.map(([value, text]) => new Option(text, value)));
  menu.value = entries.some(([value]) => value === chosen) ? chosen : "";
}

for (const id of ["by", "given"]) {
  at(id).addEventListener("change", () => {
    room = PART;
    sift();
  });
}
at("more").addEventListener("click", () => {
  room += PART;
  lay();
});
at("all").addEventListener("click", () => select(found.slice(0, room)));
at("withdraw").addEventListener("click", withdraw);
document.addEventListener("keydown", (event) => {
  if (!isForPage(event)) return;
  const name = actionOf(event.key);
  if (event.key === "Escape") select([]);
  else if (name === "not-sure") answer("not sure");
  else if (name === "withdraw") withdraw();
  else return;
  event.preventDefault();
});

// Current length of the label log, its length when the answers were loaded, and whether answers are being loaded.
let entries = null;
let loaded = null;
let loading = false;

async function renew() {
  if (loading) return;
  loading = true;
  try {
    while (loaded !== entries) {
      loaded = entries;
      await load();
      await pause(PAUSE_MS);
    }
  } finally {
    loading = false;
  }
}

follow((seen) => {
  entries = seen.labels;
  renew();
});

// The medoids on a study's page: a click on a medoid plays its motion, and people give medoids other classes.
import { annotator, introduced } from "./annotator.js";
import { base } from "./base.js";
import { insist, reply } from "./coordinator.js";
import { Endless } from "./endless.js";
import { complain } from "./outbox.js";

const root = document.getElementById("judging");
const status = document.getElementById("status");
const calm = matchMedia("(prefers-reduced-motion: reduce)");

// The medoid whose motion plays.
const state = {
  swarm: null,
  index: 0,
  query: () => `index=${state.index}`,
  shown: () => ({ swarm: state.swarm, counts: [Infinity], genes: state.genes }),
  genes: [],
};

function play(endless, card) {
  const { campaign, swarm } = card.parentElement.dataset;
  state.swarm = JSON.parse(swarm);
  state.index = Number(card.dataset.index);
  const { width, height } = state.swarm.world;
  endless.canvas.parentElement.style.aspectRatio = `${width} / ${height}`;
  endless.button.disabled = false;
  endless.pieces.url = `${base}/campaigns/${campaign}/pieces`;
  for (const other of root.querySelectorAll(".played")) other.classList.remove("played");
  card.classList.add("played");
  endless.begin(0);
  if (calm.matches) endless.pause();
  else endless.play();
}

// The newest unsaved answer about each individual, oldest first. Answers are sent one at a time, so that a retry of an older
// answer cannot arrive after a newer answer.
const unsent = new Map();
let sending = false;

async function say(card, text) {
  const details = card.closest("details");
  const { cell } = card.parentElement.dataset;
  const index = Number(card.dataset.index);
  await introduced();
  const body = JSON.stringify({ cell, index, class: text, by: annotator() });
  unsent.set(`${cell} ${index}`, { details, body });
  if (!sending) await send();
}

async function send() {
  sending = true;
  status.classList.remove("wrong");
  status.textContent = "Saving…";
  let refused = null;
  try {
    while (unsent.size > 0) {
      const [about, { details }] = unsent.entries().next().value;
      try {
        await keep(about);
        // If other answers about this cell are still unsaved, a reload would seem to revert them.
        if (![...unsent.values()].some((word) => word.details === details)) await open(details);
      } catch (error) {
        unsent.delete(about);
        refused = error;
      }
    }
  } finally {
    sending = false;
  }
  if (refused) throw refused;
  status.textContent = "All saved.";
}

// Saves the newest answer about an individual.
async function keep(about) {
  let word;
  const ask = () => {
    word = unsent.get(about);
    const headers = { "content-type": "application/json" };
    return reply(fetch(root.dataset.classes, { method: "POST", headers, body: word.body }));
  };
  await insist(ask, ({ message }) => (status.textContent = `Not saved yet: ${message}.`));
  // A newer answer can have replaced this answer during the request.
  if (unsent.get(about) === word) unsent.delete(about);
}

// Shows the current medoids of a cell, and keeps the focus.
async function open(details) {
  const focused = document.activeElement?.closest("[data-class]");
  const [index, text] = [focused?.closest("[data-index]")?.dataset.index, focused?.dataset.class];
  const answer = await insist(() => reply(fetch(details.dataset.medoids)));
  details.lastElementChild.innerHTML = await answer.text();
  if (index === undefined) return;
  const card = details.querySelector(`[data-index="${index}"]`);
  (card?.querySelector(`[data-class="${text}"]`) ?? card?.querySelector("[aria-pressed=true]"))?.focus();
}

if (root) {
  const endless = new Endless(root.querySelector(".player"), state, status);
  const tell = (error) => complain(status, error);
  for (const details of root.querySelectorAll("details")) {
    details.addEventListener("toggle", () => details.open && open(details).catch(tell));
  }
  root.addEventListener("click", ({ target }) => {
    const card = target.closest("[data-index]");
    if (!card) return;
    if (target.closest(".stage")) return play(endless, card);
    const button = target.closest("[data-class]");
    if (button) say(card, button.dataset.class).catch(tell);
  });
}

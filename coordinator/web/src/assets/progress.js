// The Progress page: the coordinator sends the parts that change, and this script draws novelty and trainings as curves.
import { Chart } from "./chart.js";
import { get, insist, path, pause, reply } from "./coordinator.js";
import { eventsOf, noveltyOf, trainingOf } from "./curves.js";
import { fill } from "./live.js";
import { follow } from "./moving.js";

// Minimum time between two requests for the curves.
const PAUSE_MS = 1000;

const live = document.querySelector("[data-live]");
const facts = () => live.querySelector("[data-generations]").dataset;
let nameOfEpoch = String;
const novelty = new Chart(document.querySelector("#novelty .chart"), { across: "generation", lines: ["best", "mean"] });
const overEpochs = (id, line, heights = {}) =>
  new Chart(document.getElementById(id), { across: "epoch", lines: [line], name: (x) => nameOfEpoch(x), ...heights });
const accuracy = overEpochs("accuracy", "accuracy on held-out triplets, %", { fromLeast: true });
const loss = overEpochs("loss", "mean loss");
accuracy.link(loss);
// The campaign's state when the curves were drawn.
let drawn = "";
let asking = false;

const stand = () => {
  const { generations, epoch, notices } = facts();
  return [generations, epoch, notices].join(" ");
};

function show(section, chart, x, values, events) {
  if (x.length > 1) document.getElementById(section).hidden = false;
  chart.show(x, values, events);
}

async function draw() {
  const now = stand();
  if (asking || now === drawn) return;
  asking = true;
  try {
    const [generations, told] = await Promise.all(["generations", "epochs"].map((what) => insist(() => get(what))));
    drawn = now;
    const { generation, best, mean } = noveltyOf(generations);
    show("novelty", novelty, generation, [best, mean], eventsOf(told));
    const training = trainingOf(told.epochs);
    nameOfEpoch = training.name;
    show("training", accuracy, training.x, [training.accuracy], training.events);
    show("training", loss, training.x, [training.loss], training.events);
    await pause(PAUSE_MS);
  } finally {
    asking = false;
  }
  draw();
}

const searching = () => facts().searching !== undefined;

const found = document.getElementById("found");
const cards = document.getElementById("cards");
// The state of the cards on the page.
let carded = facts().cards;

// Requests the cards again if the taxonomy or the labels have changed.
async function deal() {
  const now = facts().cards;
  if (now === carded) return;
  carded = now;
  const fresh = document.createElement("div");
  if (now !== undefined) fresh.innerHTML = await insist(async () => (await reply(fetch(path("cards")))).text());
  if (now === carded) fill(cards, fresh);
}

// Replaces the moving behaviours with the cards, without moving the content below.
function replace() {
  const shown = document.getElementById("shown");
  if (shown.hidden || cards.childElementCount === 0) return;
  found.style.minHeight = `${shown.offsetHeight + parseFloat(getComputedStyle(shown).marginTop)}px`;
  shown.hidden = true;
}

function changed() {
  replace();
  deal();
  draw();
  follow(searching);
}

const observer = new MutationObserver(changed);
for (const slot of live.querySelectorAll("[data-slot], #cards")) {
  observer.observe(slot, { childList: true, subtree: true, attributes: true, characterData: true });
}
changed();

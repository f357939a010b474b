// The Progress page: the coordinator sends the parts that change, and this script draws novelty and trainings as curves.
import "./live.js";
import { Chart } from "./chart.js";
import { get, insist, pause } from "./coordinator.js";
import { eventsOf, noveltyOf, trainingOf } from "./curves.js";
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
const taxonomy = live.querySelector("[data-slot=taxonomy]");

// Replaces the moving behaviours with the taxonomy, without moving the content below.
function replace() {
  const shown = document.getElementById("shown");
  const there = taxonomy.childElementCount > 0;
  if (shown.hidden || !there) return;
  found.style.minHeight = `${shown.offsetHeight + parseFloat(getComputedStyle(shown).marginTop)}px`;
  shown.hidden = true;
}

function changed() {
  replace();
  draw();
  follow(searching);
}

const observer = new MutationObserver(changed);
for (const slot of live.querySelectorAll("[data-slot]")) {
  observer.observe(slot, { childList: true, subtree: true, attributes: true, characterData: true });
}
changed();

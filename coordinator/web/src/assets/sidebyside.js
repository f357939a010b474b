// The page of campaigns side by side: the campaigns' curves in shared charts.
import { base } from "./base.js";
import { Chart } from "./chart.js";
import { insist, reply } from "./coordinator.js";
import { eventsOf, noveltyOf, trainingOf } from "./curves.js";

const ids = [...document.querySelectorAll(".compared [data-campaign]")].map(({ dataset }) => dataset.campaign);
const ask = async (id, what) => (await reply(fetch(`${base}/campaigns/${id}/${what}`))).json();

// Puts lines with different places on one axis. At a place where only other lines have values, a line keeps its previous value.
function over(lines) {
  const x = [...new Set(lines.flatMap((line) => line.x))].sort((a, b) => a - b);
  const values = lines.map((line) => {
    let at = -1;
    return x.map((place) => {
      while (at + 1 < line.x.length && line.x[at + 1] <= place) at += 1;
      return at < 0 || place > line.x.at(-1) ? NaN : line.y[at];
    });
  });
  return { x, values };
}

// The events of all campaigns; each event has the id and the line of its campaign.
const named = (events) =>
  events.flatMap((own, line) => own.map(({ x, text, breaks }) => ({ x, text: `${ids[line]}: ${text}`, breaks, line })));

function draw(section, across, lines, events, heights = {}) {
  const root = document.querySelector(`#${section} .chart`);
  // The page has no charts of trainings if no campaign has an embedding.
  if (!root) return;
  const { x, values } = over(lines);
  document.querySelector(`#${section} .none`).hidden = x.length > 1;
  new Chart(root, { across, lines: ids, ...heights }).show(x, values, named(events));
}

const [novelty, training] = await Promise.all(
  ["generations", "epochs"].map((what) => Promise.all(ids.map((id) => insist(() => ask(id, what))))),
);
const curves = novelty.map(noveltyOf);
for (const which of ["best", "mean"]) {
  draw(which, "generation", curves.map((curve) => ({ x: curve.generation, y: curve[which] })), training.map(eventsOf));
}
const trainings = training.map(({ epochs }) => trainingOf(epochs));
for (const [which, heights] of [["accuracy", { fromLeast: true }], ["loss", {}]]) {
  const lines = trainings.map((curve) => ({ x: curve.x, y: curve[which] }));
  draw(which, "epoch", lines, trainings.map(({ events }) => events), heights);
}

// The page Play: a person sets a controller, and watches the swarm.
import { Around } from "./around.js";
import { base } from "./base.js";
import { Comparison } from "./compare.js";
import { pause } from "./coordinator.js";
import { Endless } from "./endless.js";
import { actionOf, isForPage } from "./keys.js";
import { Marks } from "./marks.js";
import { edited } from "./roboteditor.js";
import { Timeline } from "./timeline.js";

// After a change of the controller, the new motion is shown from the current step on, with two limits. LOOKED_AT is the last step
// that the paper looks at. AT_ONCE is the number of steps times robots that can be simulated without a delay.
const LOOKED_AT = 1200;
const AT_ONCE = 120_000;
const calm = matchMedia("(prefers-reduced-motion: reduce)");
const at = (id) => document.getElementById(id);
const root = at("play");

// The state of the controls, in the format of the address.
class State {
  constructor() {
    this.swarm = JSON.parse(root.dataset.swarm);
    this.genes = [...root.querySelectorAll("[data-gene]")];
  }

  numbers() {
    return this.genes.map((gene) => Number(gene.value));
  }

  // `robot` is a description of other robots, for the same controller; with `isRecounted`, it also gives their number.
  query({ robot = null, isRecounted = false } = {}) {
    const given = new URLSearchParams(location.search);
    const query = new URLSearchParams();
    if (robot !== null) query.set("robot", robot);
    else if (root.dataset.model) query.set("model", root.dataset.model);
    else query.set("robot", given.get("robot"));
    query.set("genes", this.genes.map((gene) => gene.value).join(","));
    query.set("seed", at("seed").value);
    if (at("robots") && !isRecounted) query.set("robots", at("robots").value);
    return query.toString();
  }

  // The data of the swarm that the drawing needs.
  shown() {
    const { swarm } = this;
    const genes = this.numbers();
    const ratio = swarm.ratios.length > 1 ? genes.at(-1) : 0;
    const counts = swarm.ratios[ratio] ?? [Infinity];
    return { swarm, counts, genes };
  }
}

// The player of this page, which also shows the moments of the motion.
class Watched extends Endless {
  constructor(...given) {
    super(...given);
    this.timeline = new Timeline(at("timeline"), at("judged"), (step) => this.seek(step));
  }

  came(piece, isNew) {
    if (isNew) this.timeline.begin();
    this.timeline.add(piece.moments);
    super.came(piece, isNew);
  }

  tell() {
    super.tell();
    if (this.piece) this.timeline.show(this.step, this.farthest, this.piece.robots);
  }

  // The moment that a person marks: the last one up to the current step, with its name.
  moment() {
    const now = this.timeline.now();
    return now && { measured: now.step, features: now.features, name: this.timeline.nameOf(now) ?? "no name" };
  }
}

// The step in the address, with which the motion begins; null if there is none.
function addressed() {
  const step = new URLSearchParams(location.hash.slice(1)).get("step");
  return step !== null && /^\d{1,7}$/.test(step) ? Number(step) : null;
}

function playground() {
  const state = new State();
  const player = root.querySelector(".player");
  player.querySelector(".stage").style.aspectRatio = `${state.swarm.world.width} / ${state.swarm.world.height}`;
  const endless = new Watched(player, state, at("status"));
  const marks = new Marks(at("marks"), {
    query: () => state.query(),
    go: (step) => endless.seek(step),
    features: endless.timeline.features,
    status: at("status"),
  });
  const isValid = () => [...root.querySelectorAll(".number")].every((control) => control.value && control.checkValidity());

  const comparison = new Comparison(() => state.query());
  const around = new Around(at("around"), () => state.query());
  // The motion changes while a person changes a control; the address changes at the end of the change.
  const changed = (step) => {
    complain();
    comparison.forget();
    if (isValid()) endless.begin(step);
  };
  let told = `?${state.query()}`;
  const settled = () => {
    if (!isValid() || `?${state.query()}` === told) return;
    told = `?${state.query()}`;
    history.pushState(null, "", told);
    marks.tell();
    around.settled();
  };
  const seen = () => {
    const robots = endless.piece?.robots ?? 1;
    return Math.floor(Math.min(endless.target ?? endless.step, LOOKED_AT, AT_ONCE / robots));
  };

  for (const slider of root.querySelectorAll(".side [type=range]")) {
    const number = slider.dataset.slides ? at(slider.dataset.slides) : at("robots");
    const isRobots = number.id === "robots";
    slider.addEventListener("input", () => {
      const rounded = Number(Number(slider.value).toFixed(4));
      number.value = Math.min(Math.max(rounded, Number(number.min)), Number(number.max));
      changed(isRobots ? 0 : seen());
    });
    number.addEventListener("input", () => {
      slider.value = number.value;
      changed(isRobots ? 0 : seen());
    });
  }
  for (const choice of root.querySelectorAll("select[data-gene]")) choice.addEventListener("change", () => changed(seen()));
  // A person who edited the robot sees that robot, so the campaign has it. The form is sent once the editor has read its text.
  const form = at("search");
  let isReady = false;
  form.addEventListener("submit", async (event) => {
    if (isReady) return;
    event.preventDefault();
    const { problem, ...edits } = await edited();
    comparison.tell(problem, true);
    if (problem || !isValid()) return;
    form.action = `${base}/play/search?${state.query(edits)}`;
    // A form cannot be sent while its own event is handled.
    await pause(0);
    isReady = true;
    form.requestSubmit(event.submitter);
    isReady = false;
  });
  at("seed").addEventListener("input", () => changed(0));
  at("controller").addEventListener("change", settled);
  at("controller").addEventListener("submit", (event) => event.preventDefault());

  const acts = {
    anew() {
      const seed = at("seed").validity.valid ? BigInt(at("seed").value || 0) : 0n;
      at("seed").value = String(seed + 1n);
      changed(0);
      settled();
    },
    restart: () => isValid() && endless.begin(0),
    once: () => endless.once(),
    back: () => endless.once(-1),
    mark: () => isValid() && endless.piece && marks.add(Math.floor(endless.step), endless.moment(), endless.canvas),
  };
  at("anew").addEventListener("click", acts.anew);
  at("restart").addEventListener("click", acts.restart);
  at("one-step").addEventListener("click", acts.once);
  at("step-back").addEventListener("click", acts.back);
  at("mark").addEventListener("click", acts.mark);
  document.addEventListener("keydown", (event) => {
    if (!isForPage(event)) return;
    const name = actionOf(event.key);
    if (name === "play") endless.toggle();
    else if (name === "step") acts.once();
    else if (name === "step-back") acts.back();
    else if (name === "mark") acts.mark();
    else if (name === "restart") acts.restart();
    else if (name === "anew") acts.anew();
    else if (name === "like") comparison.ask();
    else if (name === "faster") endless.pace(true);
    else if (name === "slower") endless.pace(false);
    else return;
    event.preventDefault();
  });
  // Links within the page also change the address, so that only a new query reloads the page.
  addEventListener("popstate", () => new URL(location).search !== new URL(told, location).search && location.reload());

  history.replaceState(null, "", `${told}${location.hash}`);
  const first = addressed();
  endless.begin(first ?? 0);
  if (calm.matches || first !== null) endless.pause();
  else endless.play();
}

// Shows the allowed values of a wrong number; browsers only mark the number as wrong.
function complain() {
  const wrong = [...root.querySelectorAll(".number")].find((control) => !control.value || !control.checkValidity());
  const status = at("status");
  const name = wrong?.ariaLabel || wrong?.labels[0].textContent;
  const allowed = wrong?.max ? `a number from ${wrong.min} to ${wrong.max}` : "a whole number";
  status.textContent = wrong ? `${name} must be ${allowed}.` : "";
  status.classList.toggle("wrong", Boolean(wrong));
}

if (root) playground();

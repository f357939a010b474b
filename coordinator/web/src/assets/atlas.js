// The Atlas page: the map of all controllers, and the motion of the chosen controller.
import { base } from "./base.js";
import { archived, get, insist, path } from "./coordinator.js";
import { Endless } from "./endless.js";
import { isForPage } from "./keys.js";
import { complain } from "./outbox.js";
import { showAtlas } from "./showatlas.js";

// Delay between a choice and its simulation, because arrow keys quickly choose many controllers.
const SETTLED_MS = 150;
const calm = matchMedia("(prefers-reduced-motion: reduce)");
const root = document.querySelector(".atlas");
const status = document.getElementById("status");

// The swarm of the chosen controller.
const state = {
  swarm: root && JSON.parse(root.dataset.swarm),
  at: null,
  genes: [],
  query: () => `index=${state.at.entry}`,
  shown: () => ({ swarm: state.swarm, counts: [Infinity], genes: state.genes }),
};

function begin() {
  const player = root.querySelector(".player");
  const stage = player.querySelector(".stage");
  const toggle = player.querySelector(".toggle");
  stage.style.aspectRatio = `${state.swarm.world.width} / ${state.swarm.world.height}`;
  const endless = new Endless(player, state, status, path("pieces"));
  let due = 0;
  const choose = (at, genes) => {
    clearTimeout(due);
    if (!at) {
      endless.await(false);
      return endless.pause();
    }
    // Until the chosen motion arrives, the stage can show an older motion.
    endless.await(true);
    due = setTimeout(() => {
      [state.at, state.genes] = [at, genes];
      // The motion of a mirror image is the simulated motion, shown mirrored.
      endless.canvas.classList.toggle("mirrored", at.mirrored);
      toggle.disabled = false;
      endless.begin(0);
      if (calm.matches) endless.pause();
      else endless.play();
    }, SETTLED_MS);
  };
  document.addEventListener("keydown", (event) => {
    if (event.key !== " " || !state.at || !isForPage(event)) return;
    event.preventDefault();
    endless.toggle();
  });
  return choose;
}

// The view of the atlas from which a slider opened this page. The view is in the address, so that the browser's button Back
// restores it.
function seenBefore() {
  const told = new URLSearchParams(location.hash.slice(1));
  const [zoom, x, y] = ["zoom", "x", "y"].map((name) => Number(told.get(name) ?? NaN));
  if (![zoom, x, y].every(Number.isFinite) || zoom <= 0) return null;
  const at = told.get("at")?.split(",").map(Number) ?? [];
  return { zoom, x, y, at: at.length === 2 && at.every(Number.isInteger) ? at : null };
}

// Connects the sliders, which switch to atlases with other numbers of robots and other noise, at the same place and zoom.
function switches(atlas) {
  const others = document.querySelector(".others");
  if (!others) return;
  const told = JSON.parse(others.dataset.others);
  const here = { robots: told.atlases[0][1], noise: told.atlases[0][2] };
  const tell = (slider) => {
    const value = String(told[slider.name][slider.value]);
    slider.parentElement.querySelector("output").textContent = value;
    slider.setAttribute("aria-valuetext", value);
  };
  const go = (axis, value) => {
    const other = axis === "robots" ? "noise" : "robots";
    const placed = told.atlases.map(([id, robots, noise]) => ({ id, robots, noise }));
    // Some pairs of a number of robots and a noise have no atlas, so that the nearest atlas is opened.
    const [to] = placed
      .filter((place) => place[axis] === value)
      .sort((a, b) => Math.abs(a[other] - here[other]) - Math.abs(b[other] - here[other]));
    if (value === here[axis]) return;
    const { at, ...seen } = atlas.seen();
    const address = new URLSearchParams({ ...seen, slider: axis });
    if (at) address.set("at", at.join());
    location.assign(`${base}/campaigns/${to.id}/atlas#${address}`);
  };
  const sliders = [...others.querySelectorAll("input")];
  for (const slider of sliders) {
    slider.addEventListener("input", () => tell(slider));
    slider.addEventListener("change", () => go(slider.name, Number(slider.value)));
  }
  // On a page from the browser's cache, the sliders still have the positions to which a person moved them.
  addEventListener("pageshow", () => {
    for (const slider of sliders) {
      slider.value = slider.defaultValue;
      tell(slider);
    }
  });
  const used = new URLSearchParams(location.hash.slice(1)).get("slider");
  sliders.find((slider) => slider.name === used)?.focus({ preventScroll: true });
}

if (root) {
  const choose = begin();
  insist(() => get("atlas/data"))
    .then((data) => switches(showAtlas(data, { choose, pictureOf: (entry) => path(archived(entry)), seen: seenBefore() })))
    .catch((error) => complain(status, error));
}

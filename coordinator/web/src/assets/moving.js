// Plays behaviours of a searching campaign as small moving pictures: the newest and the most novel behaviours.
import { archived, get, insist, path, pause } from "./coordinator.js";
import { Player } from "./player.js";
import { grouped } from "./words.js";

// Minimum time for which a behaviour is shown, in milliseconds.
const PAUSE_MS = 10000;

const rest = document.getElementById("rest");
const calm = matchMedia("(prefers-reduced-motion: reduce)");
const players = { newest: [], novel: [] };
for (const [kind, all] of Object.entries(players)) {
  for (const root of document.querySelectorAll(`#${kind} .player`)) all.push({ root, player: new Player(root), index: null });
}
const all = () => Object.values(players).flat();
let resting = calm.matches;
let asking = false;

function tell() {
  rest.hidden = calm.matches;
  rest.setAttribute("aria-pressed", String(resting));
}

rest.addEventListener("click", () => {
  resting = !resting;
  for (const { player } of all()) if (player.motion) resting ? player.pause() : player.play();
  tell();
});
tell();

// Shows the picture of an individual until its motion arrives. Returns whether the individual is new in its place.
function put(place, found) {
  if (!found || place.index === found[0]) return false;
  const [index, generation, novelty] = found;
  place.index = index;
  place.player.stop();
  place.player.wait("");
  const words = `individual ${grouped(index)}, generation ${grouped(generation)}, novelty ${novelty.toPrecision(3)}`;
  place.root.querySelector(".reason").textContent = words;
  place.root.querySelector("canvas").setAttribute("aria-label", `Motion of ${words}`);
  place.root.querySelector("img").src = path(archived(index));
  place.root.querySelector("img").hidden = false;
  return true;
}

async function move({ root, player, index }) {
  await player.show(index);
  if (player.index !== index) return;
  root.querySelector("img").hidden = true;
  if (resting) player.pause();
}

// Shows behaviours that were found for as long as `searching()` is true; the last behaviours stay after that.
export async function follow(searching) {
  if (asking) return;
  if (!searching()) {
    for (const { player } of all()) player.pause();
    return;
  }
  asking = true;
  try {
    const told = await insist(() => get("shown"));
    const fresh = Object.entries(players).flatMap(([kind, places]) => places.filter((place, i) => put(place, told[kind][i])));
    // Motions are requested one at a time, because replays take a little time from the search.
    for (const place of fresh) await move(place);
    await pause(PAUSE_MS);
  } finally {
    asking = false;
  }
  follow(searching);
}

// The page Comparisons: shows three behaviours and takes the answer which of two is more like the reference.
import { annotator, introduced, session, showName } from "./annotator.js";
import { follow, insist, post } from "./coordinator.js";
import { actionOf, isForPage } from "./keys.js";
import { Outbox, beforeLearning, complain, tellDoing } from "./outbox.js";
import { Player } from "./player.js";
import { counted, grouped } from "./words.js";

const PLACES = ["left", "reference", "right"];
const PREFERENCES = ["left", "right", "neither"];

const at = (id) => document.getElementById(id);
const status = at("status");
const calm = matchMedia("(prefers-reduced-motion: reduce)");
const players = Object.fromEntries(PLACES.map((place) => [place, new Player(at(place))]));
// What is asked; null while an answer is on its way, or if there is nothing to ask.
let question = null;
let asking = false;
// How many comparisons of the annotator stand, as far as told.
let standing = 0;
let resting = calm.matches;

await introduced();
const outbox = new Outbox(await session(), {
  told(item, reply) {
    // Replies to what another page left behind have no question.
    if ("triple" in reply && outbox.items.length === 0 && item.body.annotator === annotator()) show(reply);
    else if (outbox.items.length === 0) ask();
  },
  refused(item, error) {
    complain(status, error);
    question = null;
    ask();
  },
  changed(outbox) {
    outbox.tell(status);
    tellPossible();
  },
});
beforeLearning(outbox);

// Asks for a question, unless one is shown, or an answer is on its way, whose reply brings the next one.
async function ask() {
  if (asking || question || outbox.items.length > 0) return;
  asking = true;
  const who = annotator();
  try {
    let complained = false;
    const told = await insist(
      () => post("comparisons/question", { annotator: who }),
      (error) => {
        complained = true;
        complain(status, error);
      },
    );
    if (complained) {
      status.classList.remove("wrong");
      outbox.tell(status);
    }
    if (outbox.items.length === 0 && who === annotator()) show(told);
  } catch (error) {
    complain(status, error);
  } finally {
    asking = false;
  }
  // Somebody else answers from now on.
  if (who !== annotator()) ask();
}

function show({ triple, own, comparisons, individuals }) {
  standing = own;
  at("count").textContent = `${counted(own, "comparison")} by you`;
  at("others").textContent = `${grouped(comparisons - own)} by others`;
  question = triple;
  for (const place of PLACES) {
    const { [place]: player } = players;
    const which = at(place).querySelector(".which");
    if (!triple) {
      player.stop();
      player.canvas.getContext("2d").clearRect(0, 0, player.canvas.width, player.canvas.height);
      player.canvas.setAttribute("aria-label", "No behaviour");
      which.textContent = "";
      continue;
    }
    which.textContent = `individual ${grouped(triple[place])}`;
    player.canvas.setAttribute("aria-label", `Motion of the behaviour, ${place}: individual ${grouped(triple[place])}`);
    if (player.index !== triple[place]) move(player, triple[place]);
  }
  at("question").textContent = triple ? inWords(triple) : nothing(individuals);
  tellPossible();
}

// Has the buttons look like what they do now.
function tellPossible() {
  for (const button of document.querySelectorAll("[data-preference]")) button.ariaDisabled = String(!question);
  // An answer that is not acknowledged yet can be withdrawn too.
  at("undo").disabled = standing === 0 && !outbox.items.some(({ path }) => path === "comparisons");
  at("several").disabled = standing === 0;
}

function inWords({ reference, left, right }) {
  return `Is individual ${grouped(left)} or individual ${grouped(right)} more like individual ${grouped(reference)}?`;
}

async function move(player, index) {
  try {
    await player.show(index);
    if (player.index === index && resting) player.pause();
  } catch (error) {
    complain(status, error);
  }
}

function nothing(individuals) {
  if (individuals < 3) return "The first generation is not complete yet. Questions appear by themselves.";
  return "There is nothing left to compare.";
}

function answer(preference) {
  if (!question) return;
  const asked = question;
  question = null;
  status.classList.remove("wrong");
  outbox.add("comparisons", { annotator: annotator(), ...asked, preference });
}

function withdraw(count = 1) {
  question = null;
  status.classList.remove("wrong");
  outbox.add("comparisons/withdraw", { annotator: annotator() }, count);
}

// Asks how many of the last comparisons to withdraw, and withdraws them.
async function withdrawSeveral() {
  const dialog = at("withdraw");
  const { count } = dialog.querySelector("form").elements;
  count.max = standing;
  count.value = 1;
  tellEffect(count);
  dialog.returnValue = "";
  dialog.showModal();
  count.select();
  await new Promise((resolve) => dialog.addEventListener("close", resolve, { once: true }));
  if (dialog.returnValue === "yes") withdraw(Number(count.value));
}

function tellEffect(count) {
  const many = Number(count.value);
  const which = many === 1 ? "Your last comparison" : `Your last ${grouped(many)} comparisons`;
  at("effect").textContent = count.validity.valid
    ? `${which} will no longer count. The questions come again, the oldest first.`
    : `You have ${counted(standing, "comparison")}: choose a number from 1 to ${grouped(standing)}.`;
}

function rest() {
  resting = !resting;
  for (const player of Object.values(players)) if (player.motion) resting ? player.pause() : player.play();
  at("rest").setAttribute("aria-pressed", String(resting));
}

// A pointer leaves no focus behind: Space plays, and does not answer again.
function onClick(button, act) {
  button.addEventListener("click", ({ detail }) => {
    if (detail > 0) button.blur();
    act();
  });
}

at("rest").setAttribute("aria-pressed", String(resting));
onClick(at("rest"), rest);
onClick(at("undo"), () => withdraw());
onClick(at("several"), withdrawSeveral);
at("withdraw").querySelector("[name=count]").addEventListener("input", (event) => tellEffect(event.target));
at("withdraw").querySelector("[data-do=back]").addEventListener("click", () => at("withdraw").close());
for (const button of document.querySelectorAll("[data-preference]")) onClick(button, () => answer(button.dataset.preference));
document.addEventListener("keydown", (event) => {
  if (!isForPage(event) || event.repeat) return;
  const name = actionOf(event.key);
  if (PREFERENCES.includes(name)) answer(name);
  else if (name === "withdraw-last") withdraw();
  else if (name === "play") rest();
  else return;
  event.preventDefault();
});
showName(at("annotator"), () => {
  question = null;
  tellPossible();
  ask();
});
ask();

// The archive grows while the page is open; what is shown stays until it is answered.
follow((seen) => {
  tellDoing(seen);
  ask();
});

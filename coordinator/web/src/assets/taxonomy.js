// The Taxonomy page: plays the motions of medoids; people name medoids, merge clusters and try further starts.
import { introduced, session } from "./annotator.js";
import { follow, insist, reply } from "./coordinator.js";
import "./keys.js";
import { Outbox, complain } from "./outbox.js";
import { Player } from "./player.js";

const status = document.getElementById("status");
const calm = matchMedia("(prefers-reduced-motion: reduce)");

for (const card of document.querySelectorAll(".medoid")) {
  const film = card.querySelector(".film");
  const stage = film.querySelector(".stage");
  const player = new Player(film);
  const play = async () => {
    await player.show(Number(card.dataset.index));
    // The pointer can have left the picture meanwhile.
    if (player.index !== null) stage.classList.add("in-motion");
  };
  const rest = () => {
    player.stop();
    stage.classList.remove("in-motion");
  };
  const turn = () => {
    if (!stage.classList.contains("in-motion")) play();
    else if (player.playing) player.toggle();
    else player.play();
  };
  stage.addEventListener("pointerenter", (event) => {
    if (event.pointerType === "mouse" && !calm.matches) play();
  });
  film.addEventListener("pointerleave", (event) => event.pointerType === "mouse" && rest());
  film.addEventListener("focusout", ({ relatedTarget }) => film.contains(relatedTarget) || rest());
  // The control plays and pauses a motion that has arrived; before, it requests the motion.
  film.querySelector(".toggle").addEventListener("click", () => stage.classList.contains("in-motion") || play());
  stage.addEventListener("click", turn);
  stage.addEventListener("keydown", (event) => {
    if (event.key !== " " && event.key !== "Enter") return;
    event.preventDefault();
    turn();
  });
}

// Reloads the page when the archive has changed since the page was made. Even if the archive grows fast, a page stays for some
// seconds.
const { archiveState } = document.getElementById("content").dataset;
const STAYS_MS = 3000;
let next = null;
follow((seen) => {
  if (next !== null || seen.archive_state === archiveState) return;
  next = setTimeout(reload, Math.max(0, STAYS_MS - performance.now()));
});

// Message to show after the reload.
const MESSAGE = "murmuration.message";
const message = sessionStorage.getItem(MESSAGE);
if (message && status) {
  sessionStorage.removeItem(MESSAGE);
  status.textContent = message;
}

function again(words) {
  sessionStorage.setItem(MESSAGE, words);
  reload();
}

// Names that were typed and not saved stay over a reload.
const TYPED = "murmuration.typed";
const fields = () => [...document.querySelectorAll(".medoid .naming")].map((form) => [form.dataset.index, form.elements.name]);
function reload() {
  const typed = fields().filter(([, field]) => field.value !== field.defaultValue);
  sessionStorage.setItem(TYPED, JSON.stringify(Object.fromEntries(typed.map(([index, field]) => [index, field.value]))));
  location.reload();
}
const typed = JSON.parse(sessionStorage.getItem(TYPED) ?? "{}");
sessionStorage.removeItem(TYPED);
for (const [index, field] of fields()) if (index in typed) field.value = typed[index];

// Shows on the cards of an individual the name that was saved.
function show(index, name) {
  for (const card of document.querySelectorAll(`.medoid[data-index="${index}"]`)) {
    const [heading, form] = [card.querySelector(".name h2"), card.querySelector(".naming")];
    const swatch = heading?.querySelector(".swatch");
    if (swatch) heading.replaceChildren(swatch, Object.assign(document.createElement("span"), { textContent: name }));
    const field = form.elements.name;
    // Something else may be typed into the field by now.
    if (field.value === "" || field.value === name) field.value = field.defaultValue = name;
    delete form.dataset.suggested;
    field.placeholder = "Name it";
    form.querySelector("button").textContent = "Saved";
    field.addEventListener("input", () => (form.querySelector("button").textContent = "Save"), { once: true });
  }
}

// Shows the further starts of a medoid in a dialog; the link itself leads to a page of these starts.
const further = document.querySelectorAll(".further");
for (const link of further) {
  link.addEventListener("click", (event) => {
    if (event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    tryStarts(link);
  });
}

async function tryStarts(link) {
  if (link.getAttribute("aria-busy") === "true") return;
  link.setAttribute("aria-busy", "true");
  const dialog = document.createElement("dialog");
  dialog.className = "further-starts";
  dialog.setAttribute("aria-label", link.textContent);
  const place = document.createElement("div");
  place.setAttribute("role", "status");
  place.textContent = "Workers simulate and judge 20 starts…";
  const form = document.createElement("form");
  form.method = "dialog";
  const close = document.createElement("button");
  close.className = "plain";
  close.textContent = "Close";
  form.append(close);
  dialog.append(place, form);
  dialog.addEventListener("close", () => {
    dialog.remove();
    link.focus();
  });
  document.body.append(dialog);
  dialog.showModal();
  try {
    const text = await (await insist(() => reply(fetch(link.href)), ({ message }) => (place.textContent = `Still waiting: ${message}.`))).text();
    const found = new DOMParser().parseFromString(text, "text/html").getElementById("starts");
    place.replaceChildren(...(found ? [document.adoptNode(found)] : ["The coordinator sent an unexpected page. Close this and try again."]));
  } catch (error) {
    place.textContent = error.message;
  } finally {
    link.removeAttribute("aria-busy");
  }
}

if (status) {
  // The message that the page shows after its reload, if the answer that is being sent changes the page.
  let after = null;
  const outbox = new Outbox(await session(), {
    told({ path, body }, reply) {
      if (path === "labels" && body.answers.length === 1) show(body.answers[0].index, body.answers[0].answer);
      if (path === "undo") after = reply.individuals.length ? "Your last answer is undone." : "There is nothing to undo.";
    },
    refused(_, error) {
      after = null;
      complain(status, error);
    },
    changed(outbox) {
      if (outbox.items.length === 0 && after !== null) again(after);
      else outbox.tell(status);
    },
  });
  // Sends an answer about individuals. It asks for the annotator's name only if there is an answer; `words` is the message for an
  // answer that changes the page.
  async function name(indices, answer, words = null) {
    if (!answer || !(await introduced())) return;
    if (words !== null) after = words;
    outbox.answer(indices, answer);
  }
  for (const form of document.querySelectorAll(".medoid .naming")) {
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      name([Number(form.dataset.index)], form.elements.name.value.trim() || form.dataset.suggested);
      form.elements.name.blur();
    });
  }
  for (const form of document.querySelectorAll(".merge")) {
    const field = form.elements.name;
    field.addEventListener("input", () => {
      const random = field.value.trim().toLowerCase() === "random";
      field.setCustomValidity(random ? "Behaviours of the class random need not be alike: choose another name." : "");
    });
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      const answer = field.value.trim();
      if (!answer) return;
      const words = `Merged as “${answer}”. “Undo my last answer” reverts that.`;
      name(form.dataset.indices.split(" ").map(Number), answer, words);
    });
  }
  document.querySelector("[data-do=undo]").addEventListener("click", async () => {
    if (await introduced()) outbox.undo();
  });
}

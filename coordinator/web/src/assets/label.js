// The Label page: shows one behaviour at a time and takes the answer.
import { introduced, session, showName } from "./annotator.js";
import { archived, follow, get, insist, keptAs, path } from "./coordinator.js";
import { isForPage } from "./keys.js";
import { Outbox, beforeLearning, complain, tellDoing } from "./outbox.js";
import { Palette } from "./palette.js";
import { drawPaths } from "./paths.js";
import { Player, motionOf, playerKey } from "./player.js";
import { Queue } from "./queue.js";
import { counted, grouped, sentence } from "./words.js";

const SLOWEST_MS = 60_000;
const RECENT = 20;

const at = (id) => document.getElementById(id);
const status = at("status");
const player = new Player(document.querySelector(".player"));
let shown = null;
let since = 0;
const durations = [];

await introduced();
const queue = new Queue(await session(), show);
const outbox = new Outbox(queue.session, {
  told(item, reply) {
    palette.show(reply.classes);
    if (item.path === "undo") queue.giveBack(reply.individuals);
    else queue.top();
  },
  refused(item, error) {
    complain(status, error);
    for (const { index } of item.body.answers ?? []) queue.answeredHere.delete(index);
    queue.top();
  },
  changed(outbox) {
    outbox.tell(status);
    count();
  },
});
const palette = new Palette({ answer, outbox });
beforeLearning(outbox);

function answer(text) {
  if (!queue.first) return;
  const { index } = queue.first;
  durations.push(Math.min(performance.now() - since, SLOWEST_MS));
  if (durations.length > RECENT) durations.shift();
  queue.take();
  outbox.answer([index], text);
  return [index];
}

function show() {
  count();
  const question = queue.first;
  if (question?.index === shown) return;
  shown = question?.index ?? null;
  since = performance.now();
  const picture = at("picture");
  picture.classList.toggle("absent", !question);
  at("paths").classList.add("absent");
  if (!question) {
    player.stop();
    [at("which").textContent, at("reason").textContent] = nothing();
    return;
  }
  picture.src = path(archived(question.index));
  picture.alt = `Picture of individual ${grouped(question.index)}`;
  at("which").textContent = `Individual ${grouped(question.index)}`;
  at("reason").textContent = `Why this one: ${question.reason}.`;
  player.show(question.index).catch((error) => complain(status, error));
  showPaths(question.index);
}

async function showPaths(index) {
  // The player shows why a motion is missing.
  const motion = await motionOf(index).motion.catch(() => null);
  if (!motion || shown !== index) return;
  const paths = at("paths");
  paths.setAttribute("aria-label", `Paths of the robots of individual ${grouped(index)}`);
  paths.classList.remove("absent");
  drawPaths(paths, motion);
}

// The reason why no question is shown.
function nothing() {
  if (queue.trouble) return ["No question available", `${sentence(queue.trouble.message)} New questions appear by themselves.`];
  if (!queue.loaded || !queue.exhausted) return ["…", ""];
  const why = queue.individuals === 0
    ? "The first generation is not complete yet. Questions appear by themselves."
    : queue.agreement
      ? "You have answered every behaviour that others have classified, or another window is asking about the rest."
      : "Every behaviour has been answered, or another window is asking about the rest.";
  return ["No questions left", why];
}

function count() {
  const unsent = outbox?.items.filter((item) => item.path === "labels").length ?? 0;
  const done = queue.own + unsent;
  const open = Math.max(queue.individuals - queue.answered - unsent, 0);
  // In agreement mode, the questions are about behaviours with answers by other annotators.
  const most = queue.agreement ? Math.max(queue.answered, done) : done + open;
  const goal = at("goal").value === "all" ? most : Math.min(Number(at("goal").value), most);
  at("share").max = Math.max(goal, 1);
  at("share").value = Math.min(done, goal);
  at("count").textContent = queue.loaded ? howMany(done, goal) : "…";
  at("others").textContent = queue.loaded ? whoElse(open) : "";
}

function howMany(done, goal) {
  if (done > goal) return `${grouped(done)} answered by you, more than the goal of ${grouped(goal)}`;
  return `${grouped(done)} of ${grouped(goal)} answered by you${left(goal - done)}`;
}

// The numbers of behaviours that other annotators answered and of unanswered behaviours, in words.
function whoElse(open) {
  const people = queue.answered - queue.own - queue.synthetic;
  const parts = [`${grouped(open)} not answered yet`];
  if (queue.synthetic > 0) parts.unshift(`${grouped(queue.synthetic)} by the rule-based judge only`);
  if (people > 0) parts.unshift(`${grouped(people)} by other annotators`);
  return parts.join(", ");
}

function left(open) {
  if (open <= 0 || durations.length < 3) return "";
  const sorted = [...durations].sort((a, b) => a - b);
  const minutes = (open * sorted[sorted.length >> 1]) / 60_000;
  if (minutes < 1) return ", less than a minute left";
  return `, about ${counted(Math.round(minutes), "minute")} left`;
}

function settings() {
  localStorage.setItem(`${keptAs}.settings`, JSON.stringify([at("strategy").value, at("goal").value]));
  queue.set(at("strategy").value, at("agreement").checked);
}

document.addEventListener("keydown", (event) => {
  if (isForPage(event) && playerKey(player, event)) event.preventDefault();
});

showName(at("annotator"), () => queue.top());
const [strategy, goal] = JSON.parse(localStorage.getItem(`${keptAs}.settings`) ?? "[]");
if ([...at("strategy").options].some((option) => option.value === strategy)) at("strategy").value = strategy;
if (goal) at("goal").value = goal;
for (const id of ["strategy", "agreement"]) at(id).addEventListener("change", settings);
at("goal").addEventListener("change", () => {
  settings();
  count();
});
palette.show((await insist(() => get("labels"))).classes);
settings();

// While the page is open, other annotators also answer, and the archive grows.
let labels = null;
let stands = null;
follow(async (seen) => {
  tellDoing(seen);
  const grown = `${seen.labels} ${seen.archive_version} ${seen.individuals}`;
  if (grown === stands) return;
  stands = grown;
  queue.top();
  if (labels !== seen.labels) palette.show((await insist(() => get("labels"))).classes);
  labels = seen.labels;
});

// Answers that the coordinator has not yet acknowledged. Answers are sent at once, one at a time, each with its own id, so that
// an unacknowledged answer can be sent again. The browser keeps an answer until it is acknowledged, even if the page, the browser
// or the coordinator restarts.
import { annotator, random } from "./annotator.js";
import "./ask.js";
import { Refused, Silent, keptAs, pause, post } from "./coordinator.js";
import { keeping } from "./events.js";
import { counted } from "./words.js";

const KEPT = `${keptAs}.unsent.`;

export class Outbox {
  // Calls `told(item, reply)` for each acknowledged item and `refused(item, error)` for each refused item. Calls
  // `changed(outbox)` whenever an item was added, acknowledged, refused or delayed.
  constructor(session, { told, refused, changed }) {
    this.key = KEPT + session;
    this.told = told;
    this.refused = refused;
    this.changed = changed;
    // The error that delays the acknowledgement of items, if any.
    this.trouble = null;
    this.sending = false;
    this.items = this.left();
    this.keep();
    this.send();
  }

  // Unsent items of this window and of closed windows. If another open window also sends an item, the duplicate does no harm.
  left() {
    const keys = Object.keys(localStorage).filter((key) => key.startsWith(KEPT));
    const items = keys.flatMap((key) => JSON.parse(localStorage.getItem(key)));
    keys.forEach((key) => localStorage.removeItem(key));
    return items;
  }

  keep() {
    if (this.items.length) localStorage.setItem(this.key, JSON.stringify(this.items));
    else localStorage.removeItem(this.key);
  }

  // Adds answers about individuals.
  answer(indices, text) {
    this.add("labels", { annotator: annotator(), answers: indices.map((index) => ({ index, answer: text })) });
  }

  // Undoes the answers of the annotator's newest request.
  undo() {
    this.add("undo", { annotator: annotator() });
  }

  // Adds an item: `path` is the address of its request, `body` the content of the request without the id.
  add(path, body) {
    this.items.push({ path, body: { request_id: random(), ...body } });
    this.keep();
    this.changed(this);
    this.send();
  }

  async send() {
    if (this.sending) return;
    this.sending = true;
    for (let wait = 250; this.items.length; ) {
      const item = this.items[0];
      try {
        const reply = await post(item.path, item.body);
        this.items.shift();
        this.keep();
        this.trouble = null;
        wait = 250;
        this.told(item, reply);
      } catch (error) {
        if (!(error instanceof Refused)) {
          this.trouble = error;
          this.changed(this);
          await pause(wait);
          wait = Math.min(wait * 2, 4000);
          continue;
        }
        this.items.shift();
        this.keep();
        this.trouble = null;
        this.refused(item, error);
      }
      this.changed(this);
    }
    this.sending = false;
  }

  // Shows the state in the page's line for messages, and unsent items at the bottom of the page.
  tell(line) {
    const { items, trouble } = this;
    const open = items.length > 0;
    if (trouble) line.textContent = `Not saved yet: ${trouble.message}.`;
    else if (open) line.textContent = "Saving…";
    else if (!line.classList.contains("wrong")) line.textContent = "All saved.";
    if (open) line.classList.remove("wrong");
    const why = trouble instanceof Silent || !trouble ? "" : `Not saved yet: ${trouble.message}. `;
    keeping(trouble && open ? why + this.kept() : "");
  }

  kept() {
    // Items with another path than `labels` are withdrawals.
    const isAnswer = ({ path }) => path === "labels";
    const answers = this.items.filter(isAnswer).reduce((sum, { body }) => sum + body.answers.length, 0);
    const others = this.items.filter((item) => !isAnswer(item)).length;
    const parts = [answers && counted(answers, "answer"), others && counted(others, "withdrawal")].filter(Boolean);
    return `${parts.join(" and ")} ${answers + others === 1 ? "is" : "are"} stored in this browser and will be sent.`;
  }
}

// Delays learning until the coordinator has acknowledged every answer.
export function beforeLearning(outbox) {
  const form = document.querySelector("form.learn");
  form?.addEventListener("submit", async (event) => {
    if (outbox.items.length === 0) return;
    event.preventDefault();
    while (outbox.items.length) await pause(50);
    form.requestSubmit();
  });
}

// Shows the campaign's current activity, if the page has a place for it.
export function tellDoing({ doing }) {
  const line = document.getElementById("doing");
  if (line) line.textContent = doing ?? "";
}

export function complain(line, error) {
  line.classList.add("wrong");
  line.textContent = error.message;
}

// The questions of this window; some questions are loaded in advance.
import { annotator } from "./annotator.js";
import { archived, insist, path, post } from "./coordinator.js";
import { motionOf } from "./player.js";

// Number of questions: the current question and the next three.
const HELD = 4;
// The coordinator's limit on the individuals that a window can ask for again.
const AGAIN = 100;
// Interval at which a window renews its questions. It is shorter than the time after which the coordinator gives these questions
// to other windows.
const RENEW_MS = 60_000;

export class Queue {
  // Calls `changed()` when the first question or the counts have changed.
  constructor(session, changed) {
    this.session = session;
    this.changed = changed;
    this.questions = [];
    // Numbers of individuals with an answer by anybody, by this annotator, and by the rule-based judge alone; and the number of
    // all individuals.
    this.answered = 0;
    this.own = 0;
    this.synthetic = 0;
    this.individuals = 0;
    this.loaded = false;
    // Whether the last request returned no question.
    this.exhausted = false;
    // The error of the last request, if any.
    this.trouble = null;
    this.answeredHere = new Set();
    this.again = [];
    this.asking = false;
    this.wanted = false;
    this.strategy = "medoids";
    this.agreement = false;
    setInterval(() => {
      if (!document.hidden) this.top();
    }, RENEW_MS);
  }

  get first() {
    return this.questions[0];
  }

  // Removes the first question, which was answered.
  take() {
    this.answeredHere.add(this.questions.shift().index);
    this.changed();
    // If no question is left, a request for more questions starts at once.
    if (this.questions.length === 0) this.top();
  }

  // Puts the questions of undone answers at the front again, newest first.
  giveBack(indices) {
    for (const index of indices) this.answeredHere.delete(index);
    this.again = [...indices, ...this.again].slice(0, AGAIN);
    this.top();
  }

  // Switches to another kind of question.
  set(strategy, agreement) {
    this.strategy = strategy;
    this.agreement = agreement;
    this.top();
  }

  // Loads questions until the window has enough.
  async top() {
    this.wanted = true;
    if (this.asking) return;
    this.asking = true;
    try {
      while (this.wanted) {
        this.wanted = false;
        await this.ask();
      }
    } finally {
      this.asking = false;
    }
  }

  async ask() {
    const { again } = this;
    const ask = () =>
      post("questions", {
        annotator: annotator(),
        session: this.session,
        strategy: this.strategy,
        agreement: this.agreement,
        count: HELD,
        again,
      });
    const asked = await insist(ask, (trouble) => {
      this.trouble = trouble;
      this.changed();
    });
    this.trouble = null;
    this.again = this.again.filter((index) => !again.includes(index));
    // Questions that were answered during the request are left out.
    this.questions = asked.queries.filter(({ index }) => !this.answeredHere.has(index));
    this.answered = asked.answered;
    this.own = asked.own;
    this.synthetic = asked.synthetic;
    this.individuals = asked.individuals;
    this.loaded = true;
    this.exhausted = asked.queries.length === 0;
    for (const { index } of this.questions) {
      motionOf(index).motion.catch(() => {});
      new Image().src = path(archived(index));
    }
    this.changed();
  }
}

// This window's questions, some of them loaded in advance.
import { annotator } from "./annotator.js";
import { archived, insist, path, post } from "./coordinator.js";
import { motionOf } from "./player.js";

// The current question, and the next three.
const HELD = 4;
// The coordinator's limit of requested questions.
const AGAIN = 100;
// Interval of renewals, shorter than the time after which the coordinator gives a window's questions to others.
const RENEW_MS = 60_000;

export class Queue {
  // Calls `changed()` after a new first question and after new counts.
  constructor(session, changed) {
    this.session = session;
    this.changed = changed;
    this.questions = [];
    // Numbers of individuals: with an answer by anybody, by this annotator, by the rule-based judge alone; and all.
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

  // Removes the first question after its answer.
  take() {
    this.answeredHere.add(this.questions.shift().index);
    this.changed();
    // Without a question left, no acknowledgement will trigger the next request.
    if (this.questions.length === 0) this.top();
  }

  // Puts the questions of undone answers, newest first, at the front again.
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

  // Fills the window's questions.
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
    // Leave out questions answered during the request.
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

// What this window is asked, some of it before it is needed.
import { annotator } from "./annotator.js";
import { archived, insist, path, post } from "./coordinator.js";
import { motionOf } from "./player.js";

// The one that is looked at, and the next three.
const HELD = 4;
// As many as the coordinator lets a window wish for.
const AGAIN = 100;
// Before others are given what this window holds.
const RENEW_MS = 60_000;

export class Queue {
  // `changed()` hears of a new first question and of new counts.
  constructor(session, changed) {
    this.session = session;
    this.changed = changed;
    this.questions = [];
    // Individuals: answered by anybody, by whoever sits here, by the rule-based judge alone; and all that there are.
    this.answered = 0;
    this.own = 0;
    this.synthetic = 0;
    this.individuals = 0;
    this.loaded = false;
    // Whether the coordinator had no question when it was last asked.
    this.exhausted = false;
    // Why it cannot be asked at present, if it cannot.
    this.trouble = null;
    this.said = new Set();
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

  // The first question was answered.
  take() {
    this.said.add(this.questions.shift().index);
    this.changed();
    // Where nothing arrives, no acknowledged answer has the next ones be asked for.
    if (this.questions.length === 0) this.top();
  }

  // Answers were undone, the newest first: those questions come first again.
  giveBack(indices) {
    for (const index of indices) this.said.delete(index);
    this.again = [...indices, ...this.again].slice(0, AGAIN);
    this.top();
  }

  // Another kind of question from now on.
  set(strategy, agreement) {
    this.strategy = strategy;
    this.agreement = agreement;
    this.top();
  }

  // Has the window hold as many questions as it should.
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
    // What was answered meanwhile was on its way.
    this.questions = asked.queries.filter(({ index }) => !this.said.has(index));
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

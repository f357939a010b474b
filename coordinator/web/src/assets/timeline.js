// The features of a swarm over time, and the judge's name of its motion.
import { Chart } from "./chart.js";
import { grouped } from "./words.js";

const CHART_HEIGHT = 120;
// Smallest distance between grid lines: smaller differences of a feature are rounding.
const LEAST_STEP = 1e-6;
// Maximum number of points of a line, and of flags for changes of the name. Longer motions have a point at every second moment, or
// at fewer moments, and flags for the latest changes.
const MOST_POINTS = 400;
const MOST_FLAGS = 40;
// Minimum time between two drawings of the charts.
const REDRAW_MS = 250;

export class Timeline {
  // `root` contains the charts, and `judged` is the line for the name; `chosen` is called with the step that a person chooses on
  // a chart.
  constructor(root, judged, chosen) {
    this.verdicts = JSON.parse(root.dataset.verdicts);
    this.features = JSON.parse(root.dataset.features);
    this.least = Number(root.dataset.least);
    this.judged = judged;
    const options = { across: "step", fromLeast: true, leastStep: LEAST_STEP, height: CHART_HEIGHT, chosen };
    this.charts = [...root.querySelectorAll(".chart")].map(
      (chart, place) => new Chart(chart, { ...options, lines: [this.features[place]] }),
    );
    this.charts.forEach((chart, place) => this.charts.slice(place + 1).forEach((other) => chart.link(other)));
    this.due = null;
    this.begin();
  }

  // Forgets the moments of the last motion.
  begin() {
    // The moments that are known, by their steps.
    this.moments = [];
    // Number of moments in the charts; -1 if the charts show others.
    this.drawn = -1;
    this.step = 0;
    this.farthest = 0;
  }

  add(moments) {
    if (moments.length === 0) return;
    const known = new Set(this.moments.map(({ step }) => step));
    const added = moments.filter(({ step }) => !known.has(step));
    this.moments = [...this.moments, ...added].sort((a, b) => a.step - b.step);
    this.drawn = -1;
  }

  // Shows the current step of a number of robots; the charts end with the farthest step that was shown.
  show(step, farthest, robots) {
    [this.step, this.farthest] = [step, farthest];
    const text = robots < this.least ? `The judge names only the motion of ${this.least} or more robots.` : this.sentence();
    if (this.judged.textContent !== text) this.judged.textContent = text;
    for (const chart of this.charts) chart.rest(step);
    const reached = this.reached();
    if (reached !== this.drawn) this.due ??= setTimeout(() => this.draw(), REDRAW_MS);
  }

  // Number of moments up to the farthest step.
  reached() {
    const place = this.moments.findLastIndex(({ step }) => step <= this.farthest);
    return place + 1;
  }

  // The last moment up to the current step; undefined if there is none.
  now() {
    return this.moments.findLast(({ step }) => step <= this.step);
  }

  nameOf(moment) {
    return this.verdicts[moment.verdict - 1];
  }

  sentence() {
    const now = this.now();
    const name = now && this.nameOf(now);
    if (!name) return "Not enough motion yet for a name.";
    const before = this.moments.findLast(({ step, verdict }) => step < now.step && verdict !== now.verdict);
    const since = this.moments.find(({ step }) => step > (before?.step ?? -1));
    return `The judge calls this ${name}, since step ${grouped(since.step)}.`;
  }

  draw() {
    this.due = null;
    this.drawn = this.reached();
    const shown = this.moments.slice(0, this.drawn);
    const every = Math.ceil(shown.length / MOST_POINTS);
    const points = shown.filter((_, place) => (shown.length - 1 - place) % every === 0);
    const steps = points.map(({ step }) => step);
    const flags = this.changes(shown);
    this.charts.forEach((chart, place) => {
      chart.show(steps, [points.map(({ features }) => features[place])], flags);
      chart.rest(this.step);
    });
  }

  // The changes of the name, as events of a chart.
  changes(moments) {
    const changes = moments.filter(({ verdict }, place) => verdict > 0 && verdict !== (moments[place - 1]?.verdict ?? 0));
    return changes.slice(-MOST_FLAGS).map((moment) => ({ x: moment.step, text: this.nameOf(moment) }));
  }
}

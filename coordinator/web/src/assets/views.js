// The views of a map, to go back to.

// After so long without movement, the map rests: the next movement is a new step of the history.
const REST_MS = 400;
const MOST = 100;

const same = (one, other) => one.every((part, i) => part === other[i]);

export class Views {
  // `plot` is the map; calls `told(canGoBack)` after changes of the history.
  constructor(plot, told) {
    this.plot = plot;
    this.told = told;
    this.forget();
  }

  now() {
    return [this.plot.zoom, ...this.plot.middle];
  }

  // Clears the history, because the map shows something else.
  forget() {
    this.past = [];
    this.settle();
    this.told(false);
  }

  // Called when the map moves: stores the view of its last rest.
  moved() {
    if (this.timer === null) {
      if (same(this.rest, this.now())) return;
      this.past.push(this.rest);
      if (this.past.length > MOST) this.past.shift();
      this.told(true);
    }
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.settle(), REST_MS);
  }

  // Ends the current movement; the next one is a new step.
  settle() {
    clearTimeout(this.timer);
    this.timer = null;
    this.rest = this.now();
  }

  // Returns to the previous view, once the map is laid out again; returns whether there was one.
  back() {
    this.settle();
    const view = this.past.pop();
    if (!view) return false;
    [this.plot.zoom, ...this.plot.middle] = view;
    this.rest = view;
    this.told(this.past.length > 0);
    return true;
  }
}

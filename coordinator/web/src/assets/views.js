// The history of the views of a map, through which people can go back.

// Milliseconds without movement after which the map rests. The next movement is then a new step of the history.
const REST_MS = 400;
const MOST = 100;

const same = (one, other) => one.every((part, i) => part === other[i]);

export class Views {
  // `plot` is the map. The class calls `told(canGoBack)` after every change of the history.
  constructor(plot, told) {
    this.plot = plot;
    this.told = told;
    this.forget();
  }

  now() {
    return [this.plot.zoom, ...this.plot.middle];
  }

  // Clears the history, because the map shows another projection.
  forget() {
    this.past = [];
    this.settle();
    this.told(false);
  }

  // Stores the view in which the map last rested. The page calls this method when the map moves.
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

  // Ends the current movement, so that the next movement is a new step of the history.
  settle() {
    clearTimeout(this.timer);
    this.timer = null;
    this.rest = this.now();
  }

  // Restores the previous view, which appears at the next layout of the map. Returns whether there was a previous view.
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

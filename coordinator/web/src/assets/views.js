// The parts of a map that were shown before, to go back to.

// A map that was not moved for so long has come to rest: the next movement is another step back.
const REST_MS = 400;
const MOST = 100;

const same = (one, other) => one.every((part, i) => part === other[i]);

export class Views {
  // `plot` is the map; `told(canGoBack)` hears whether there is anything to go back to.
  constructor(plot, told) {
    this.plot = plot;
    this.told = told;
    this.forget();
  }

  now() {
    return [this.plot.zoom, ...this.plot.middle];
  }

  // Forgets the views: the map shows something else.
  forget() {
    this.past = [];
    this.settle();
    this.told(false);
  }

  // The map was moved, or is being moved: what it showed when it last rested is kept.
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

  // A movement ends here, whatever follows.
  settle() {
    clearTimeout(this.timer);
    this.timer = null;
    this.rest = this.now();
  }

  // Shows what was shown before, once the map is laid out again; whether there was anything.
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

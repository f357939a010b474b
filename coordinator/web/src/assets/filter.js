// Which points of the map are shown: those that the menus ask for, of no class, cluster or robustness that somebody has hidden.
// The browser keeps it, for each campaign.

const KINDS = ["class", "cluster", "robustness"];

export class Filter {
  // `key` is where the browser keeps it.
  constructor(key) {
    this.key = key;
    this.showAll();
    this.read();
  }

  showAll() {
    // By what points are coloured, the values that are hidden. Classes are known by their names: their places change.
    this.hidden = Object.fromEntries(KINDS.map((kind) => [kind, new Set()]));
    this.generations = [0, Infinity];
    // The only values that are shown; null for all.
    this.picked = { class: null, cluster: null, annotator: null };
  }

  // What was kept, as far as it can be read.
  read() {
    try {
      const kept = JSON.parse(localStorage.getItem(this.key)) ?? {};
      // Which clusters those are that it names.
      this.clusters = kept.clusters ?? null;
      for (const kind of KINDS) this.hidden[kind] = new Set(kept.hidden?.[kind] ?? []);
      const [first, last] = kept.generations ?? [];
      this.generations = [first ?? 0, last ?? Infinity];
      this.picked = { ...this.picked, ...kept.picked };
    } catch {
      this.showAll();
    }
  }

  keep() {
    if (this.isOpen()) return localStorage.removeItem(this.key);
    const { clusters, generations, picked } = this;
    const hidden = Object.fromEntries(KINDS.map((kind) => [kind, [...this.hidden[kind]]]));
    localStorage.setItem(this.key, JSON.stringify({ clusters, generations, picked, hidden }));
  }

  // Hears which clusters there are. If they are others, what was hidden by their numbers is shown again.
  of(clusters) {
    if (this.clusters === clusters) return;
    if (this.clusters !== null) {
      this.hidden.cluster.clear();
      this.hidden.robustness.clear();
      this.picked.cluster = null;
    }
    this.clusters = clusters;
  }

  // Hides what has a value, or shows it again.
  toggle(kind, value) {
    const hidden = this.hidden[kind];
    if (!hidden.delete(value)) hidden.add(value);
  }

  // Shows nothing but what has a value; everything, if that is so already.
  only(kind, value, all) {
    const others = all.filter((other) => other !== value);
    const is = others.every((other) => this.hidden[kind].has(other)) && !this.hidden[kind].has(value);
    this.hidden[kind] = new Set(is ? [] : others);
  }

  isOpen() {
    const [first, last] = this.generations;
    const all = Object.values(this.picked).every((value) => value === null);
    return all && first === 0 && last === Infinity && Object.values(this.hidden).every((values) => values.size === 0);
  }

  // For each of `count` points whether it is shown, by its values; null where all are.
  shown(count, valueOf) {
    if (this.isOpen()) return null;
    const [first, last] = this.generations;
    const picked = Object.entries(this.picked).filter(([, value]) => value !== null);
    const kinds = Object.entries(this.hidden).filter(([, values]) => values.size > 0);
    return Uint8Array.from({ length: count }, (_, i) => {
      const generation = valueOf("generation", i);
      if (!picked.every(([kind, value]) => valueOf(kind, i) === value)) return false;
      return generation >= first && generation <= last && kinds.every(([kind, values]) => !values.has(valueOf(kind, i)));
    });
  }
}

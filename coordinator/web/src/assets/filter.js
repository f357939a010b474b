// Which points of the map are shown: those of no class, cluster or generation that somebody has hidden.

export class Filter {
  constructor() {
    this.showAll();
  }

  showAll() {
    // By what points are coloured, the values that are hidden. Classes are known by their names: their places change.
    this.hidden = { class: new Set(), cluster: new Set(), robustness: new Set() };
    this.generations = [0, Infinity];
    // The only values that are shown; null for all.
    this.picked = { cluster: null, annotator: null };
  }

  // Shows again what was hidden by clusters, whose numbers now mean others.
  forgetClusters() {
    this.hidden.cluster.clear();
    this.hidden.robustness.clear();
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

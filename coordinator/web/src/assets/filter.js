// The filter selects the points that the map shows: points that match the menus and whose class, cluster or robustness is not
// hidden. The browser keeps the filter of each campaign.

const KINDS = ["class", "cluster", "robustness"];

export class Filter {
  // `key` is the filter's key in the browser's storage.
  constructor(key) {
    this.key = key;
    this.showAll();
    this.read();
  }

  showAll() {
    // The hidden values: classes, clusters and numbers of robust trials. Classes are stored by name, because their places change.
    this.hidden = Object.fromEntries(KINDS.map((kind) => [kind, new Set()]));
    this.generations = [0, Infinity];
    // The only class, cluster and annotator whose points are shown; null shows all.
    this.picked = { class: null, cluster: null, annotator: null };
  }

  // Reads the stored filter; an unreadable filter shows all points.
  read() {
    try {
      const kept = JSON.parse(localStorage.getItem(this.key)) ?? {};
      // The clustering that the stored cluster numbers belong to.
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

  // Sets the current clustering. If the clustering has changed, hidden clusters and robustness are shown again.
  of(clusters) {
    if (this.clusters === clusters) return;
    if (this.clusters !== null) {
      this.hidden.cluster.clear();
      this.hidden.robustness.clear();
      this.picked.cluster = null;
    }
    this.clusters = clusters;
  }

  // Hides a value, or shows it again.
  toggle(kind, value) {
    const hidden = this.hidden[kind];
    if (!hidden.delete(value)) hidden.add(value);
  }

  // Hides all values except one; if they are hidden already, shows all values.
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

  // Whether each of `count` points is shown, by the point's values; null if all points are shown.
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

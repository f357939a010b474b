// The points of the map, which keys go through and lines are drawn around.
import { encloses } from "./lasso.js";
import { Plot } from "./plot.js";

export class Points extends Plot {
  // The nearest point that lies in a direction, for keys; the one in the middle where there was none before.
  towards(from, dx, dy) {
    if (from < 0) return this.middle();
    let best = from;
    let least = Infinity;
    for (let i = 0; i < this.count; i++) {
      const ahead = (this.across[i] - this.across[from]) * dx + (this.down[i] - this.down[from]) * dy;
      const aside = Math.abs((this.across[i] - this.across[from]) * dy) + Math.abs((this.down[i] - this.down[from]) * dx);
      const cost = ahead + 2 * aside;
      if (ahead > 0.5 && aside <= 2 * ahead && cost < least) [best, least] = [i, cost];
    }
    return best;
  }

  middle() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    let best = -1;
    let closest = Infinity;
    for (let i = 0; i < this.count; i++) {
      const distance = Math.hypot(this.across[i] - width / 2, this.down[i] - height / 2);
      if (distance < closest) [best, closest] = [i, distance];
    }
    return best;
  }

  within(line) {
    const found = [];
    for (let i = 0; i < this.count; i++) if (encloses(line, this.across[i], this.down[i])) found.push(i);
    return found;
  }

  // Paints every point; with a selection, the others under it and faded.
  show(colourOf, selected, isDark) {
    const others = [];
    const chosen = [];
    for (let i = 0; i < this.count; i++) (selected.has(i) ? chosen : others).push(i);
    this.paint(isDark, [
      { points: others, colourOf, strength: selected.size === 0 ? 0.85 : 0.18 },
      { points: chosen, colourOf, strength: 0.85 },
    ]);
  }
}

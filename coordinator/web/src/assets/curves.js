// The curves of a campaign as the coordinator tells them.
import { column } from "./drawing.js";

// The novelty of generations, in order.
export function noveltyOf(told) {
  const of = (values, Kind) => Array.from(column(values, Kind));
  return { generation: of(told.generation, Uint32Array), best: of(told.best, Float64Array), mean: of(told.mean, Float64Array) };
}

// The accuracy after each epoch, in percent, the trainings of rounds after the first; `epochs` are lists of round, epoch, loss and
// accuracy. Where a round begins is an event.
export function trainingOf(epochs) {
  const measured = epochs.filter(([, , , accuracy]) => accuracy !== null);
  const events = measured.flatMap(([round], i) =>
    i > 0 && measured[i - 1][0] !== round ? [{ x: i + 1, text: `round ${round} begins` }] : [],
  );
  return {
    x: measured.map((_, i) => i + 1),
    accuracy: measured.map(([, , , accuracy]) => 100 * accuracy),
    name: (x) => {
      const [round, epoch] = measured[Math.round(x) - 1] ?? [0, x];
      return round > 0 ? `${epoch} of round ${round}` : String(epoch);
    },
    events,
  };
}

// The curves of a campaign, decoded from the coordinator's responses.
import { column } from "./drawing.js";

// The novelty of generations, in order.
export function noveltyOf(told) {
  const of = (values, Kind) => Array.from(column(values, Kind));
  return { generation: of(told.generation, Uint32Array), best: of(told.best, Float64Array), mean: of(told.mean, Float64Array) };
}

// Measurements of each epoch: accuracy in percent and loss, or NaN if not measured. The epochs of the first training come first,
// and then those of each round. `epochs` are lists of round, epoch, loss and accuracy. Lines break where a round begins, because
// its losses belong to other triplets.
export function trainingOf(epochs) {
  const events = epochs.flatMap(([round], i) =>
    i > 0 && epochs[i - 1][0] !== round ? [{ x: i + 1, text: `round ${round} begins`, label: `round ${round}`, breaks: true }] : [],
  );
  return {
    x: epochs.map((_, i) => i + 1),
    accuracy: epochs.map(([, , , accuracy]) => (accuracy === null ? NaN : 100 * accuracy)),
    loss: epochs.map(([, , loss]) => loss ?? NaN),
    name: (x) => {
      const [round, epoch] = epochs[Math.round(x) - 1] ?? [0, x];
      return round > 0 ? `${epoch} of round ${round}` : String(epoch);
    },
    events,
  };
}

// The events of a search, for a chart over its generations.
export const eventsOf = ({ events }) => events.map(({ generation, text }) => ({ x: Math.max(generation - 1, 0), text }));

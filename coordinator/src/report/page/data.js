// Reads the block of data: columns of binary numbers, and the motion of every medoid.
const content = JSON.parse(document.getElementById("data").textContent);

function column(text, Kind) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Kind(bytes.buffer);
}

// A swarm's motion, to be asked for its poses at any step.
class Run {
  constructor({ agents, steps, x, y, heading }) {
    this.agents = agents;
    this.steps = steps;
    this.x = column(x, Uint16Array);
    this.y = column(y, Uint16Array);
    this.heading = column(heading, Uint8Array);
    this.last = steps[steps.length - 1];
  }

  // The last frame at or before a step.
  frameAt(step) {
    let low = 0;
    let high = this.steps.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.steps[middle] <= step) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  // Poses between two frames; the heading takes the shorter way round.
  posesAt(step, poses) {
    const frame = this.frameAt(step);
    const next = Math.min(frame + 1, this.steps.length - 1);
    const length = this.steps[next] - this.steps[frame];
    const part = length > 0 ? (step - this.steps[frame]) / length : 0;
    const from = frame * this.agents;
    const to = next * this.agents;
    for (let i = 0; i < this.agents; i++) {
      poses.x[i] = this.x[from + i] + part * (this.x[to + i] - this.x[from + i]);
      poses.y[i] = this.y[from + i] + part * (this.y[to + i] - this.y[from + i]);
      const turn = ((this.heading[to + i] - this.heading[from + i] + 384) % 256) - 128;
      poses.heading[i] = ((this.heading[from + i] + part * turn) * Math.PI) / 128;
    }
    return frame;
  }
}

const { archive } = content;
window.murmuration = {
  world: content.world,
  agentColours: content.agentColours,
  clusterColours: content.clusterColours,
  runs: content.runs.map((run) => new Run(run)),
  archive: {
    x: column(archive.x, Uint16Array),
    y: column(archive.y, Uint16Array),
    cluster: column(archive.cluster, Uint16Array),
    index: column(archive.index, Uint32Array),
    generation: column(archive.generation, Uint32Array),
    novelty: column(archive.novelty, Float32Array),
    genes: column(archive.genes, Int16Array),
    medoids: archive.medoids,
  },
  // Fits a canvas to its place on the page; true where that changed it.
  fit(canvas) {
    const dense = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.round(canvas.clientWidth * dense);
    const height = Math.round(canvas.clientHeight * dense);
    if (canvas.width === width && canvas.height === height) return false;
    canvas.width = width;
    canvas.height = height;
    return true;
  },
};
document.documentElement.classList.add("scripts");

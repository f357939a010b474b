// Reads the page's block of data: columns of binary numbers, and the motion of every medoid.
const content = JSON.parse(document.getElementById("data").textContent);

const { archive } = content;
window.murmuration = {
  world: content.world,
  agentColours: content.agentColours,
  clusterColours: content.clusterColours,
  classes: content.classes,
  runs: content.runs.map((run) => new Run(run)),
  archive: {
    x: column(archive.x, Uint16Array),
    y: column(archive.y, Uint16Array),
    spans: archive.spans,
    cluster: column(archive.cluster, Uint16Array),
    index: column(archive.index, Uint32Array),
    class: column(archive.class, Uint16Array),
    machine: column(archive.machine, Uint8Array),
    generation: column(archive.generation, Uint32Array),
    novelty: column(archive.novelty, Float32Array),
    robust: column(archive.robust, Uint8Array),
    genes: column(archive.genes, Int16Array),
    geneUnit: archive.geneUnit,
    tile: column(archive.tile, Uint16Array),
    trials: archive.trials,
    medoids: archive.medoids,
  },
  pictures: {
    ...content.pictures,
    genes: column(content.pictures.genes, Float64Array),
    seeds: column(content.pictures.seeds, BigUint64Array),
  },
  simulator: content.simulator,
  Pins,
  Playback,
  Plot,
  counted,
  equalScale,
  fit,
  grouped,
  short: (value) => String(Number(value.toPrecision(4))),
  steer,
  zoomButtons,
};
document.documentElement.classList.add("scripts");

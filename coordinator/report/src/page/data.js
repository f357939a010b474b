// Reads the block of data: columns of binary numbers, and the motion of every medoid.
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
    medoids: archive.medoids,
  },
  Playback,
  Plot,
  counted,
  equalScale,
  fit,
  grouped,
  steer,
  zoomButtons,
};
document.documentElement.classList.add("scripts");

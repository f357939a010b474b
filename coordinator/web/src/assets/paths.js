// The whole motion of a swarm in one picture: the path of each robot in its colour, and where the robots end.
import { drawArena, drawBodies, fit } from "./drawing.js";
import { motionOf } from "./player.js";

// Poses that are joined by lines, at most: of longer motions of larger swarms every so many steps.
const MOST_POSES = 60_000;
// Half a world: on a torus, a longer way between two frames is a jump to the other side.
const JUMP = 32768;

// Lays the paths of an individual over its picture, which `root` holds, once its motion is there, if that is still wanted.
export async function layPaths(root, index, isWanted = () => root.isConnected) {
  // The player says why there is no motion.
  const motion = await motionOf(index, isWanted).motion.catch(() => null);
  if (!motion || !isWanted()) return;
  let canvas = root.querySelector(".paths");
  if (!canvas) {
    canvas = document.createElement("canvas");
    canvas.className = "paths";
    canvas.setAttribute("aria-hidden", "true");
    root.append(canvas);
  }
  drawPaths(canvas, motion);
}

export function drawPaths(canvas, { run, world, colours }) {
  fit(canvas);
  const pen = canvas.getContext("2d");
  const scale = Math.min(canvas.width / world.width, canvas.height / world.height);
  pen.clearRect(0, 0, canvas.width, canvas.height);
  pen.save();
  pen.translate((canvas.width - scale * world.width) / 2, (canvas.height - scale * world.height) / 2);
  drawArena(pen, world, scale);
  const [across, down] = [(scale * world.width) / 65535, (scale * world.height) / 65535];
  const stride = Math.max(Math.ceil((run.agents * run.steps.length) / MOST_POSES), 1);
  pen.lineWidth = Math.max(canvas.width / 200, 1);
  pen.lineJoin = "round";
  pen.globalAlpha = 0.45;
  for (let agent = 0; agent < run.agents; agent++) {
    pen.strokeStyle = colours[run.colourOf(agent, colours)];
    pen.stroke(pathOf(run, agent, stride, world.torus, across, down));
  }
  run.wraps = world.torus;
  run.posesAt(run.last, run.poses);
  drawBodies(pen, run, colours, (place) => Math.max((run.radii?.[place] ?? world.radius) * scale, 1.2), across, down);
  pen.restore();
}

function pathOf(run, agent, stride, wraps, across, down) {
  const path = new Path2D();
  let before = null;
  for (let frame = 0; frame < run.steps.length; frame += stride) {
    const at = frame * run.agents + agent;
    const [x, y] = [run.x[at], run.y[at]];
    const jumps = wraps && before && (Math.abs(x - before[0]) > JUMP || Math.abs(y - before[1]) > JUMP);
    if (before && !jumps) path.lineTo(x * across, y * down);
    else path.moveTo(x * across, y * down);
    before = [x, y];
  }
  return path;
}

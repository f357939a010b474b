// Draws a whole motion in one picture: the path of each robot in its colour, and the robots' last positions.
import { drawArena, drawBodies, fit } from "./drawing.js";
import { motionOf } from "./player.js";

// Maximum number of poses that lines join; longer motions or larger swarms skip steps.
const MOST_POSES = 60_000;
// Half the size of the world. On a torus, a longer distance between two frames is a jump to the other side.
const JUMP = 32768;

// Draws an individual's paths over its picture in `root` once its motion has arrived, if `isWanted()` is still true.
export async function layPaths(root, index, isWanted = () => root.isConnected) {
  // The player shows why a motion is missing.
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

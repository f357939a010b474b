// Draws points with the graphics card, which keeps the points in its memory. Even a hundred thousand points take almost no time,
// and the time of this script does not grow with their number.

// A point with a place from 0 to 1 is drawn at `shift + scale * place` pixels from the upper left corner.
const VERTEX = `#version 300 es
layout(location = 0) in float x;
layout(location = 1) in float y;
layout(location = 2) in vec4 look;
layout(location = 3) in float size;
uniform vec2 scale, shift, canvas;
uniform float radius;
out vec4 colour;
out float reach;
void main() {
  vec2 at = (shift + scale * vec2(x, y)) / canvas;
  gl_Position = vec4(2.0 * at.x - 1.0, 1.0 - 2.0 * at.y, 0.0, 1.0);
  reach = radius * size * 2.0;
  gl_PointSize = 2.0 * reach + 1.0;
  colour = look;
}`;
const FRAGMENT = `#version 300 es
precision mediump float;
in vec4 colour;
in float reach;
out vec4 pixel;
void main() {
  float away = distance(gl_PointCoord, vec2(0.5)) * (2.0 * reach + 1.0);
  float part = clamp(reach + 0.5 - away, 0.0, 1.0);
  if (part == 0.0) discard;
  pixel = vec4(colour.rgb, colour.a * part);
}`;

// Names of software renderers, which draw without a graphics card.
const IMITATION = /swiftshader|llvmpipe|softpipe|software|basic render/i;

// Whether the machine has a graphics card. The check uses an extra canvas, because a canvas with a WebGL context can have no
// other context.
function hasCard() {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl) return false;
  const names = gl.getExtension("WEBGL_debug_renderer_info");
  const name = String(gl.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return !IMITATION.test(name);
}

export class GlPoints {
  // Returns a renderer for a canvas, or null if there is no graphics card: without a card, a 2D canvas is faster. Calls `lost`
  // when the card has lost all data and is available again.
  static of(canvas, lost) {
    if (!hasCard()) return null;
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, depth: false });
    if (!gl) return null;
    const points = new GlPoints(gl);
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => {
      points.prepare();
      lost();
    });
    return points;
  }

  constructor(gl) {
    this.gl = gl;
    this.count = 0;
    this.prepare();
  }

  prepare() {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    gl.useProgram(program);
    this.at = Object.fromEntries(["scale", "shift", "canvas", "radius"].map((name) => [name, gl.getUniformLocation(program, name)]));
    this.buffers = Array.from({ length: 4 }, () => gl.createBuffer());
    this.order = gl.createBuffer();
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  }

  fill(place, values, parts, kind) {
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[place]);
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, parts, kind, true, 0, 0);
  }

  // Sets the places of all points: 0 to 65535 along each axis.
  place(x, y) {
    this.fill(0, x, 1, this.gl.UNSIGNED_SHORT);
    this.fill(1, y, 1, this.gl.UNSIGNED_SHORT);
  }

  // Sets the shown points, the last point on top, and the look of all points: `looks` has red, green, blue and strength of each
  // point, and `sizes` its size; 255 stands for twice the radius.
  look(order, looks, sizes) {
    const { gl } = this;
    this.fill(2, looks, 4, gl.UNSIGNED_BYTE);
    this.fill(3, sizes, 1, gl.UNSIGNED_BYTE);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.order);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, order, gl.STATIC_DRAW);
    this.count = order.length;
  }

  // Paints the points. `scale` and `shift` are in pixels of the canvas, and `paper` is the background as red, green and blue.
  paint({ scale, shift, radius, paper }) {
    const { gl, at } = this;
    const { width, height } = gl.canvas;
    gl.viewport(0, 0, width, height);
    gl.clearColor(...paper.map((part) => part / 255), 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.uniform2fv(at.scale, scale);
    gl.uniform2fv(at.shift, shift);
    gl.uniform2f(at.canvas, width, height);
    gl.uniform1f(at.radius, radius);
    gl.drawElements(gl.POINTS, this.count, gl.UNSIGNED_INT, 0);
  }
}

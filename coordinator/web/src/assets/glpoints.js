// Points drawn by the graphics card, which keeps them: a picture of a hundred thousand takes it no time to speak of, and this
// script none that grows with their number.

// A point lies at `shift + scale * place` pixels from the upper left corner, for places from 0 to 1.
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

// Programs that imitate a graphics card.
const IMITATION = /swiftshader|llvmpipe|softpipe|software|basic render/i;

// Whether there is a card: a canvas that was asked for it can be drawn on in no other way.
function hasCard() {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl) return false;
  const names = gl.getExtension("WEBGL_debug_renderer_info");
  const name = String(gl.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return !IMITATION.test(name);
}

export class GlPoints {
  // What draws on a canvas; null where the browser has no graphics card for it: without one a canvas is drawn sooner. `lost` hears when the card has forgotten everything, and is there again.
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

  // Takes the places of all points, 0 to 65535 each way.
  place(x, y) {
    this.fill(0, x, 1, this.gl.UNSIGNED_SHORT);
    this.fill(1, y, 1, this.gl.UNSIGNED_SHORT);
  }

  // Takes the points that are shown, the last one on top; of every point its red, green, blue and strength, and its size, of which
  // 255 is twice the radius.
  look(order, looks, sizes) {
    const { gl } = this;
    this.fill(2, looks, 4, gl.UNSIGNED_BYTE);
    this.fill(3, sizes, 1, gl.UNSIGNED_BYTE);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.order);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, order, gl.STATIC_DRAW);
    this.count = order.length;
  }

  // Paints them: `scale` and `shift` in pixels of the canvas, its `paper` as red, green and blue.
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

// Draws shapes and a ground with WebGL 2.

const LIGHT = unit([-0.35, -0.5, 1]);
const BODY = `#version 300 es
in vec3 place, normal;
uniform mat4 camera, pose;
out vec3 at, facing;
void main() {
  vec4 world = pose * vec4(place, 1.0);
  at = world.xyz;
  facing = mat3(pose) * normal;
  gl_Position = camera * world;
}`;
// An opacity below 1 is that of a surface seen from the front; edges are denser, as in glass.
const SKIN = `#version 300 es
precision highp float;
in vec3 at, facing;
uniform vec3 eye, light, colour;
uniform float opacity, lit;
out vec4 paint;
void main() {
  vec3 n = normalize(facing), v = normalize(eye - at);
  float key = max(dot(n, light), 0.0), sky = 0.5 + 0.5 * n.z, edge = 1.0 - abs(dot(n, v));
  float shine = 0.22 * pow(max(dot(n, normalize(light + v)), 0.0), 40.0);
  vec3 shaded = colour * (0.34 + 0.26 * sky + 0.5 * key) + shine + 0.10 * edge * edge;
  float alpha = opacity < 1.0 && lit > 0.0 ? mix(opacity, 0.92, edge * edge) : opacity;
  paint = vec4(mix(colour, shaded, lit) * alpha, alpha);
}`;
const PLANE = `#version 300 es
in vec3 place;
uniform mat4 camera;
uniform vec3 middle;
uniform float reach;
out vec2 at;
void main() {
  at = middle.xy + reach * place.xy;
  gl_Position = camera * vec4(at, middle.z, 1.0);
}`;
const GRID = `#version 300 es
precision highp float;
in vec2 at;
uniform vec3 middle, ink;
uniform float reach, cell;
out vec4 paint;
float lines(vec2 p) {
  vec2 off = abs(fract(p - 0.5) - 0.5) / fwidth(p);
  return 1.0 - min(min(off.x, off.y), 1.0);
}
void main() {
  float line = max(0.16 * lines(at / cell), 0.30 * lines(at / (5.0 * cell)));
  float alpha = (0.035 + line) * smoothstep(1.0, 0.25, distance(at, middle.xy) / reach);
  paint = vec4(ink * alpha, alpha);
}`;

class Renderer {
  constructor(canvas) {
    const gl = canvas.getContext('webgl2', {antialias: true, stencil: true});
    if (!gl) throw new Error('no WebGL 2');
    Object.assign(this, {gl, canvas, skin: this.program(gl, BODY, SKIN), ground: this.program(gl, PLANE, GRID)});
    this.plane = this.mesh(quad(...[[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([x, y]) => [x, y, 0, 0, 0, 1])));
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
  }

  program(gl, ...sources) {
    const program = gl.createProgram();
    sources.forEach((source, k) => {
      const shader = gl.createShader(k ? gl.FRAGMENT_SHADER : gl.VERTEX_SHADER);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    });
    ['place', 'normal'].forEach((name, k) => gl.bindAttribLocation(program, k, name));
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    return {program, places: {}};
  }

  /** Triangles on the graphics card. */
  mesh(corners) {
    const {gl} = this, vertices = gl.createVertexArray();
    gl.bindVertexArray(vertices);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(corners), gl.STATIC_DRAW);
    [0, 1].forEach(k => {
      gl.enableVertexAttribArray(k);
      gl.vertexAttribPointer(k, 3, gl.FLOAT, false, 24, 12 * k);
    });
    return {vertices, count: corners.length / 6};
  }

  /** Makes a program current, with these values. */
  use(of, values) {
    const {gl} = this;
    gl.useProgram(of.program);
    for (const [name, value] of Object.entries(values)) {
      const place = (of.places[name] ??= gl.getUniformLocation(of.program, name));
      if (!Array.isArray(value)) gl.uniform1f(place, value);
      else if (value.length === 3) gl.uniform3fv(place, value);
      else gl.uniformMatrix4fv(place, false, value);
    }
  }

  /** Draws a part: a mesh with its pose and its colour. */
  part({mesh, pose, colour}, values = {}) {
    const {gl} = this;
    this.use(this.skin, {pose: matrix(pose), colour, ...values});
    gl.bindVertexArray(mesh.vertices);
    gl.drawArrays(gl.TRIANGLES, 0, mesh.count);
  }

  /** Draws the ground, the solid parts with their shadows, and the translucent parts. */
  draw({camera, eye, solid, ghost, ground}) {
    const {gl, canvas} = this;
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    gl.enable(gl.BLEND);
    gl.depthMask(false);
    this.use(this.ground, {camera, ...ground});
    gl.bindVertexArray(this.plane.vertices);
    gl.drawArrays(gl.TRIANGLES, 0, this.plane.count);
    this.use(this.skin, {camera, eye, light: LIGHT, lit: 0, opacity: 0.22});
    if (eye[2] > ground.middle[2]) this.shadows(solid, shadow(LIGHT, ground.middle[2]));
    gl.depthMask(true);
    solid.forEach(part => this.part(part, {lit: 1, opacity: 1}));
    this.ghosts(ghost);
  }

  /** Shadows, each place darkened once. */
  shadows(parts, flat) {
    const {gl} = this;
    gl.disable(gl.DEPTH_TEST);
    gl.enable(gl.STENCIL_TEST);
    gl.stencilFunc(gl.EQUAL, 0, 255);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
    parts.forEach(part => this.part(part, {pose: product(flat, matrix(part.pose)), colour: [0, 0, 0]}));
    gl.disable(gl.STENCIL_TEST);
    gl.enable(gl.DEPTH_TEST);
  }

  /** Translucent parts: their foremost surfaces alone, and behind solid ones that lie in the same place. */
  ghosts(parts) {
    const {gl} = this;
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(1, 4);
    for (const visible of [false, true]) {
      gl.colorMask(visible, visible, visible, visible);
      parts.forEach(part => this.part(part, {lit: 1, opacity: 0.5}));
    }
    gl.disable(gl.POLYGON_OFFSET_FILL);
  }
}

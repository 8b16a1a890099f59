// Vectors have 3 numbers, quaternions 4 (x, y, z, w), poses 7 (a place, then a rotation), matrices 16, by columns.
// z is up, lengths are in m.

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const times = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = a => times(a, 1 / (Math.hypot(...a) || 1));
const mix = (a, b, share) => a.map((x, i) => x + share * (b[i] - x));

/** A vector, turned by a quaternion. */
function turned(q, v) {
  const twice = times(cross(q, v), 2);
  return add(add(v, times(twice, q[3])), cross(q, twice));
}

/** The rotation a after b. */
function rotations(a, b) {
  const [x, y, z] = add(add(times(b, a[3]), times(a, b[3])), cross(a, b));
  return [x, y, z, a[3] * b[3] - dot(a, b)];
}

/** The quaternion of a rotation about an axis. */
const about = (axis, angle) => [...times(axis, Math.sin(angle / 2)), Math.cos(angle / 2)];

/** A pose within another one. */
function within(outer, inner) {
  const q = outer.slice(3);
  return [...add(outer, turned(q, inner)), ...rotations(q, inner.slice(3))];
}

/** Between two poses. */
function between(a, b, share) {
  const [p, q] = [a.slice(3), b.slice(3)];
  const same = p.reduce((sum, x, i) => sum + x * q[i], 0) < 0 ? q.map(x => -x) : q;
  const turn = mix(p, same, share), length = Math.hypot(...turn) || 1;
  return [...mix(a.slice(0, 3), b.slice(0, 3), share), ...turn.map(x => x / length)];
}

/** The matrix of a pose. */
function matrix(pose) {
  const q = pose.slice(3), axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(axis => turned(q, axis));
  return [...axes[0], 0, ...axes[1], 0, ...axes[2], 0, pose[0], pose[1], pose[2], 1];
}

/** A product of matrices. */
function product(a, b) {
  const cell = (row, column) => [0, 1, 2, 3].reduce((sum, k) => sum + a[row + 4 * k] * b[k + 4 * column], 0);
  return Array.from({length: 16}, (_, i) => cell(i % 4, i >> 2));
}

/** What a camera sees, in clip coordinates. */
function projection(eye, target, fov, aspect, near, far) {
  const back = unit(add(eye, times(target, -1))), right = unit(cross([0, 0, 1], back)), up = cross(back, right);
  const view = [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0,
    -dot(right, eye), -dot(up, eye), -dot(back, eye), 1];
  const f = 1 / Math.tan(fov / 2), depth = 1 / (near - far);
  const lens = [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (near + far) * depth, -1, 0, 0, 2 * near * far * depth, 0];
  return product(lens, view);
}

/** Flattens everything onto the plane z = height, along the light. */
function shadow(light, height) {
  const [x, y] = [light[0] / light[2], light[1] / light[2]];
  return [1, 0, 0, 0, 0, 1, 0, 0, -x, -y, 0, 0, x * height, y * height, height, 1];
}

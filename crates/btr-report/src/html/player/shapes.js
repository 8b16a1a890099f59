// Surfaces as triangles: places and normals of corners, six numbers each.

const ROUND = 40; // corners around
const ARC = 10; // steps of a quarter circle

/** The triangles of a shape of the document. */
function surface({kind, size_m: [a, b, c]}) {
  if (kind === 'box') return block(a, b, c);
  if (kind === 'cylinder') return [[[0, b], [a, b]], [[a, b], [a, -b]], [[a, -b], [0, -b]]].flatMap(p => lathe(p));
  const cap = k => (Math.PI / 2) * (k / ARC), steps = Array.from({length: ARC + 1}, (_, k) => k);
  const upper = steps.map(k => [a * Math.sin(cap(k)), b + a * Math.cos(cap(k)), Math.sin(cap(k)), Math.cos(cap(k))]);
  const lower = upper.map(([r, z, nr, nz]) => [r, -z, nr, -nz]).reverse();
  return lathe([...upper, ...lower]);
}

/** A profile of radius and height, top first, turned about z. Without normals in it, it is straight. */
function lathe(profile) {
  const [[r0, z0], [r1, z1]] = [profile[0], profile[profile.length - 1]];
  const length = Math.hypot(r1 - r0, z1 - z0) || 1, straight = [(z0 - z1) / length, (r1 - r0) / length];
  const corner = ([r, z, nr = straight[0], nz = straight[1]], k) => {
    const [x, y] = [Math.cos((2 * Math.PI * k) / ROUND), Math.sin((2 * Math.PI * k) / ROUND)];
    return [r * x, r * y, z, nr * x, nr * y, nz];
  };
  const out = [];
  for (let i = 1; i < profile.length; i++)
    for (let k = 0; k < ROUND; k++) {
      const [above, below] = [profile[i - 1], profile[i]];
      out.push(...quad(corner(above, k), corner(below, k), corner(below, k + 1), corner(above, k + 1)));
    }
  return out;
}

/** A box by its half sides. */
function block(a, b, c) {
  const half = [a, b, c];
  return [0, 1, 2].flatMap(axis => [-1, 1].flatMap(side => {
    const corner = (u, v) => {
      const at = [0, 0, 0], normal = [0, 0, 0];
      at[axis] = side * half[axis];
      at[(axis + 1) % 3] = u * half[(axis + 1) % 3];
      at[(axis + 2) % 3] = side * v * half[(axis + 2) % 3];
      normal[axis] = side;
      return [...at, ...normal];
    };
    return quad(corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1));
  }));
}

const quad = (a, b, c, d) => [...a, ...b, ...c, ...a, ...c, ...d];

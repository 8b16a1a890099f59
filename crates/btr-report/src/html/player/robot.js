// The robot of the document, and its motion.

const BODY_COLOUR = [0.74, 0.77, 0.81];
const NOT_JUDGED = [0.55, 0.58, 0.63];
// Errors in noise floors and their colours; between them by the logarithm.
const SCALE = [[2, [46, 160, 90]], [4, [176, 190, 60]], [8, [242, 172, 40]], [16, [235, 110, 40]], [32, [200, 36, 44]]];

/** The colour of an error in noise floors; null is an error that is not known. */
function colourOf(error) {
  if (error === null) return NOT_JUDGED;
  const at = Math.min(Math.max(Math.log2(error) - 1, 0), SCALE.length - 1), low = Math.floor(at);
  const [[, a], [, b]] = [SCALE[low], SCALE[Math.min(low + 1, SCALE.length - 1)]];
  return mix(a, b, at - low).map(x => x / 255);
}

const css = colour => `rgb(${colour.map(x => Math.round(255 * x)).join(' ')})`;

class Robot {
  constructor({links, root}, renderer) {
    Object.assign(this, {links, root});
    this.meshes = links.map(link => link.shapes.map(shape => renderer?.mesh(surface(shape))));
  }

  /** Poses of the links for a base, or the fixed root, and positions of the joints. */
  poses(base, positions) {
    const poses = [];
    for (const {parent, origin, joint, slides, axis} of this.links) {
      if (parent === null) {
        poses.push(base ?? this.root);
        continue;
      }
      const q = joint === null ? 0 : positions[joint];
      const moved = slides ? [...times(axis, q), 0, 0, 0, 1] : [0, 0, 0, ...about(axis, q)];
      poses.push(within(poses[parent], within(origin, moved)));
    }
    return poses;
  }

  /** What is drawn for links at these poses, in the colour that `paint` gives for a link and one of its shapes. */
  parts(poses, paint) {
    return this.links.flatMap((link, l) => link.shapes.map((shape, s) => (
      {mesh: this.meshes[l][s], pose: within(poses[l], shape.pose), colour: paint(link, shape)}
    )));
  }

  /** Balls around the shapes for links at these poses: places and radii. */
  balls(poses) {
    return this.links.flatMap((link, l) => link.shapes.map(shape => {
      const [a, b, c] = shape.size_m, radius = shape.kind === 'box' ? Math.hypot(a, b, c) : a + b;
      return {at: within(poses[l], shape.pose), radius};
    }));
  }
}

/** A log at a time: the frame before it, and the share of the way to the next one. */
function frameAt({time_s}, time) {
  let [low, high] = [0, time_s.length - 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (time_s[middle] <= time) low = middle; else high = middle;
  }
  return [low, Math.min(Math.max((time - time_s[low]) / (time_s[high] - time_s[low]), 0), 1)];
}

/** Positions and bases of the measured and of the simulated robot, and the errors of its joints, at a time. */
function stateAt(log, state, time) {
  const [k, share] = frameAt(log, time), replay = log.replays[state];
  const at = values => values[k] + share * (values[k + 1] - values[k]);
  const pose = poses => poses && between(poses[k], poses[k + 1], share);
  const simulated = replay.simulated.map(at), base = pose(replay.base);
  return {
    measured: {base: pose(log.base) ?? base, positions: log.measured.map((q, j) => (q ? at(q) : simulated[j]))},
    simulated: {base, positions: simulated},
    errors: replay.errors.map(errors => errors && errors[share < 1 ? k : k + 1]),
  };
}

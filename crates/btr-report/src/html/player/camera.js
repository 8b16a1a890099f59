// What is to be seen, and a camera that turns about it, by pointer and by keyboard.

const FOV = 0.6;

/** Balls around what is drawn of the measured robot in moments of all logs, without the way of a floating base. */
const moments = (robot, {logs, floats}) => logs.flatMap(log => Array.from({length: 60}, (_, k) => {
  const [first, last] = [log.time_s[0], log.time_s[log.time_s.length - 1]];
  const {base, positions} = stateAt(log, 0, first + (last - first) * k / 59).measured;
  const [x, y] = floats && base ? base : [0, 0];
  return robot.balls(robot.poses(base, positions)).map(({at, radius}) => ({at: add(at, [-x, -y, 0]), radius}));
}).flat());

/** The middle and the radius of everything that is drawn, and its lowest height. */
function bounds(robot, motion) {
  const balls = moments(robot, motion);
  const end = (axis, sign) => balls.reduce((most, {at, radius}) => Math.max(most, sign * at[axis] + radius), -1e9);
  const middle = [0, 1, 2].map(axis => (end(axis, 1) - end(axis, -1)) / 2);
  const reach = ({at, radius}) => radius + Math.hypot(...add(at, times(middle, -1)));
  return {middle, radius: balls.reduce((most, ball) => Math.max(most, reach(ball)), 0.02), lowest: -end(2, -1)};
}

class Camera {
  /** `bounds` are the middle and the radius of what it frames; `changed` is called after every change. */
  constructor(canvas, bounds, changed) {
    Object.assign(this, {canvas, bounds, changed, pointers: new Map()});
    this.reset();
    canvas.addEventListener('pointerdown', event => {
      canvas.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    canvas.addEventListener('pointermove', event => this.drag(event));
    for (const end of ['pointerup', 'pointercancel'])
      canvas.addEventListener(end, event => this.pointers.delete(event.pointerId));
    // The wheel scrolls the page until the picture is clicked.
    canvas.addEventListener('wheel', event => {
      if (document.activeElement !== canvas && !event.ctrlKey) return;
      event.preventDefault();
      this.zoom(Math.exp(event.deltaY * 0.0012));
    }, {passive: false});
    canvas.addEventListener('dblclick', () => this.reset());
  }

  reset() {
    Object.assign(this, {turn: -0.95, lift: 0.38, far: 1});
    this.changed();
  }

  rotate(turn, lift) {
    this.turn += turn;
    this.lift = Math.min(Math.max(this.lift + lift, -0.4), 1.5);
    this.changed();
  }

  zoom(factor) {
    this.far = Math.min(Math.max(this.far * factor, 0.15), 6);
    this.changed();
  }

  /** One pointer turns, two pinch. */
  drag(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const apart = () => {
      const [a, b] = [...this.pointers.values()];
      return Math.hypot(a[0] - b[0], a[1] - b[1]) || 1;
    };
    const now = [event.clientX, event.clientY], was = this.pointers.size === 2 ? apart() : null;
    this.pointers.set(event.pointerId, now);
    if (was !== null) this.zoom(was / apart());
    else this.rotate((before[0] - now[0]) * 0.008, (now[1] - before[1]) * 0.008);
  }

  /** Whether a key was one of the camera's. */
  key(key) {
    const turns = {ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1]};
    if (turns[key]) this.rotate(...turns[key]);
    else if (key === '+' || key === '=') this.zoom(0.9);
    else if (key === '-') this.zoom(1 / 0.9);
    else if (key === '0') this.reset();
    else return false;
    return true;
  }

  /** What the renderer needs, with the middle of the picture moved by `offset`. */
  view(aspect, offset) {
    const {middle, radius} = this.bounds, target = add(middle, offset);
    const distance = this.far * radius / Math.sin(FOV / 2) / Math.min(aspect, 1);
    const level = Math.cos(this.lift);
    const away = [level * Math.sin(-this.turn), -level * Math.cos(this.turn), Math.sin(this.lift)];
    const eye = add(target, times(away, distance));
    return {eye, camera: projection(eye, target, FOV, aspect, distance * 0.02, distance + 20 * radius)};
  }
}

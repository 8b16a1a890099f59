// Plays the document of the page.

const STAND = [0.45, 0.47, 0.5];
// The ghost's colours are those of the lines in the plots: the model as it stands beside another one, on the way, and
// the latest.
const [BEFORE, BETWEEN, LATEST] = [[0.66, 0.32, 0.64], [0.06, 0.58, 0.52], [0.13, 0.48, 0.9]];

/** The largest length of 1, 2 or 5 times a power of ten that is not larger. */
function nice(length) {
  const power = 10 ** Math.floor(Math.log10(length));
  return power * [5, 2, 1].find(times => times * power <= length * 1.000001);
}

class Player {
  constructor(motion) {
    const logs = motion.logs;
    Object.assign(this, {motion, playing: false, used: false, closed: false, state: 0});
    const frame = bounds(new Robot(motion), motion);
    this.cell_m = nice(frame.radius / 2);
    this.ground_m = motion.ground ? 0 : frame.lowest;
    const cell = this.cell_m < 1 ? `${Number((100 * this.cell_m).toPrecision(2))} cm` : `${this.cell_m} m`;
    this.ui = controls(motion, cell);
    this.redraw = () => (this.waiting ||= requestAnimationFrame(now => this.draw(now)));
    this.plots = new Plots((log, time) => this.pick(log, time));
    try {
      this.renderer = new Renderer(this.ui.canvas);
    } catch {
      const sorry = 'This browser cannot draw in 3D: it has no WebGL 2. The plots and the scrubber work without.';
      this.ui.canvas.replaceWith(make('p', {className: 'sorry', textContent: sorry}));
    }
    this.robot = new Robot(motion, this.renderer);
    this.stand = this.standing(frame);
    this.camera = new Camera(this.ui.canvas, frame, this.redraw);
    this.listen();
    // The first picture is of the largest error.
    const worst = logs.map((_, k) => this.worst(k)), most = worst.reduce((a, b) => (b.error > a.error ? b : a));
    this.show(worst.indexOf(most), most.time);
  }

  /** What holds a robot that stands above the grid: a foot and a post; nothing below a hanging or a floating one. */
  standing({middle, radius}) {
    const {root, floats} = this.motion, high = root[2] - this.ground_m;
    if (floats || high < 0.02 * radius || middle[2] < root[2]) return [];
    const parts = [[0.045 * radius, high], [0.2 * radius, 0.02 * radius]];
    return parts.map(([r, h]) => ({
      mesh: this.renderer?.mesh(surface({kind: 'cylinder', size_m: [r, h / 2]})),
      pose: [root[0], root[1], this.ground_m + h / 2, 0, 0, 0, 1],
      colour: STAND,
    }));
  }

  /** The largest errors of all joints, frame by frame. */
  errors(log) {
    const {time_s, replays} = this.motion.logs[log], known = replays[this.state].errors.filter(Boolean);
    return time_s.map((_, k) => Math.max(0, ...known.map(errors => errors[k] ?? 0)));
  }

  worst(log) {
    const errors = this.errors(log), error = errors.reduce((a, b) => Math.max(a, b));
    return {error, time: this.motion.logs[log].time_s[errors.indexOf(error)]};
  }

  listen() {
    const {ui} = this;
    ui.play.addEventListener('click', () => this.run(!this.playing));
    ui.time.addEventListener('input', () => this.show(this.log, Number(ui.time.value)));
    ui.log.addEventListener('change', () => this.show(Number(ui.log.value), this.motion.logs[ui.log.value].time_s[0]));
    for (const list of [ui.state, ui.stages])
      list.addEventListener('change', event => this.choose(Number(event.target.value)));
    for (const box of [ui.measured, ui.ghost]) box.addEventListener('change', this.redraw);
    ui.close.addEventListener('click', () => {
      this.closed = true;
      this.dock();
    });
    ui.canvas.addEventListener('keydown', event => {
      const {key} = event, step = {',': -1, '.': 1}[key];
      if (key === ' ') this.run(!this.playing);
      else if (step) this.step(step);
      else if (!this.camera.key(key)) return;
      event.preventDefault();
    });
    ui.canvas.addEventListener('webglcontextlost', event => event.preventDefault());
    ui.canvas.addEventListener('webglcontextrestored', () => {
      this.renderer = new Renderer(ui.canvas);
      this.robot = new Robot(this.motion, this.renderer);
      this.stand = this.standing(this.camera.bounds);
      this.redraw();
    });
    new ResizeObserver(this.redraw).observe(ui.player);
    new IntersectionObserver(([{isIntersecting}]) => {
      this.inView = isIntersecting;
      this.closed &&= !isIntersecting;
      this.dock();
    }).observe(ui.section);
  }

  /** Shows a state of the model, in the plots as well. */
  choose(state) {
    const {ui, motion} = this;
    this.state = state;
    ui.stages.value = state;
    ui.state.querySelector(`input[value="${state}"]`).checked = true;
    this.plots.choose(state, motion.states.length - 1);
    this.show(this.log, this.time);
  }

  /** Beside the plots, the player stays in view in a corner, once it was used. */
  dock() {
    const {section, player} = this.ui, docked = !this.inView && this.used && !this.closed;
    if (docked === player.classList.contains('docked')) return;
    section.style.minHeight = docked ? `${section.offsetHeight}px` : '';
    player.classList.toggle('docked', docked);
    this.redraw();
  }

  run(playing) {
    const {time_s} = this.motion.logs[this.log];
    if (playing && this.time >= time_s[time_s.length - 1]) this.time = time_s[0];
    Object.assign(this, {playing, used: true, before: null});
    Object.assign(this.ui.play, {textContent: playing ? '❚❚' : '▶'});
    this.ui.play.setAttribute('aria-label', playing ? 'Pause' : 'Play');
    this.redraw();
  }

  /** Goes on by frames. */
  step(by) {
    const {time_s} = this.motion.logs[this.log], [k, share] = frameAt(this.motion.logs[this.log], this.time);
    const from = k + (share >= 1 ? 1 : 0);
    this.show(this.log, time_s[Math.min(Math.max(from + by, 0), time_s.length - 1)]);
  }

  /** A click in a plot. */
  pick(plotted, time) {
    const log = this.motion.logs.findIndex(({log}) => log === plotted);
    if (log < 0) return;
    Object.assign(this, {used: true, closed: false});
    this.show(log, time);
    this.dock();
  }

  /** Shows a log at a time. */
  show(log, time) {
    const {ui, motion} = this, {time_s} = motion.logs[log], [first, last] = [time_s[0], time_s[time_s.length - 1]];
    Object.assign(this, {log, time: Math.min(Math.max(time, first), last)});
    Object.assign(ui.time, {min: first, max: last});
    ui.log.value = log;
    ui.strip.style.background = `linear-gradient(to right, ${this.timeline(log).join(', ')})`;
    this.redraw();
  }

  /** The colours of the largest errors over a log. */
  timeline(log) {
    const errors = this.errors(log), stops = Math.min(120, errors.length);
    const from = k => Math.floor((k * errors.length) / stops);
    return Array.from({length: stops}, (_, k) => css(colourOf(Math.max(...errors.slice(from(k), from(k + 1))))));
  }

  advance(now) {
    if (this.before !== null) this.time += (now - this.before) / 1000 * Number(this.ui.speed.value);
    this.before = now;
    const last = Number(this.ui.time.max);
    if (this.time >= last) {
      this.time = last;
      this.run(false);
    }
  }

  draw(now) {
    this.waiting = null;
    if (this.playing) this.advance(now);
    const {ui, motion} = this, log = motion.logs[this.log], state = stateAt(log, this.state, this.time);
    ui.time.value = this.time;
    ui.clock.value = `${this.time.toFixed(2)} / ${Number(ui.time.max).toFixed(2)} s`;
    this.plots.show(log.log, this.time);
    ui.rows.forEach(({dot, value}, joint) => {
      const error = state.errors[joint] ?? null;
      dot.style.background = css(colourOf(error));
      value.textContent = error === null ? 'not judged' : error.toFixed(error < 100 ? 1 : 0);
    });
    const latest = motion.states.length - 1;
    this.colour = this.state === latest ? LATEST : this.state === 0 ? BEFORE : BETWEEN;
    ui.swatch.style.background = css(this.colour);
    if (this.renderer) this.picture(state);
    if (this.playing) this.redraw();
  }

  picture({measured, simulated, errors}) {
    const {ui, robot, camera, motion} = this, {canvas} = ui, density = Math.min(devicePixelRatio || 1, 2);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map(x => Math.max(1, Math.round(x * density)));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, {width, height});
    const base = motion.floats && measured.base, offset = base ? [base[0], base[1], 0] : [0, 0, 0];
    const {eye, camera: projected} = camera.view(width / height, offset);
    const {middle, radius} = camera.bounds, [x, y] = add(middle, offset);
    const painted = (link, shape) => (shape.shows_error ? colourOf(errors[link.joint] ?? null) : BODY_COLOUR);
    const parts = (of, paint) => robot.parts(robot.poses(of.base, of.positions), paint);
    this.renderer.draw({
      eye,
      camera: projected,
      solid: [...this.stand, ...(ui.measured.checked ? parts(measured, painted) : [])],
      ghost: ui.ghost.checked ? parts(simulated, () => this.colour) : [],
      ground: {
        middle: [x, y, this.ground_m],
        ink: getComputedStyle(canvas).color.match(/\d+/g).slice(0, 3).map(c => c / 255),
        reach: 5 * radius,
        cell: this.cell_m,
      },
    });
  }
}

// The plots stand below.
addEventListener('DOMContentLoaded', () => {
  const data = document.getElementById('motion-data'), player = new Player(JSON.parse(data.textContent));
  data.before(player.ui.section);
  document.querySelector('nav a')?.after(make('a', {href: '#motion', textContent: 'Motion'}));
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', player.redraw);
});

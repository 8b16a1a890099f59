// The elements of the player. Names of logs, joints and states come from files: they are set as text, never as markup.

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
const HELP = 'Drag to turn, pinch to zoom. After a click: the wheel, + and - zoom, arrow keys turn, 0 starts over, ' +
  'space plays, comma and full stop go by frames.';

/** An element with properties and children. */
function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties))
    if (name.includes('-') || name === 'role') element.setAttribute(name, value);
    else element[name] = value;
  element.append(...children);
  return element;
}

const option = (text, value, selected = false) => make('option', {textContent: text, value, selected});

/** A list to choose from. */
const chooser = (label, options) => make('label', {className: 'choice'},
  make('span', {textContent: label}), make('select', {}, ...options));

/** A name such as `+ effect@site`, which breaks before its site. */
const breaking = name => name.replace(/^([+-]) /, '$1\u00a0').replaceAll('@', '\u200b@');

/** Buttons for the states of the model, of which one is pressed, with their errors. */
function choice({states, errors_are}) {
  const buttons = states.map(({name, error}, k) => make('label', {},
    make('input', {type: 'radio', name: 'motion-state', value: k, checked: k === 0}),
    make('span', {}, make('span', {textContent: breaking(name)}), ...(error ? [make('b', {textContent: error})] : []))));
  const label = errors_are ? `The model: ${errors_are}` : 'The model';
  return make('fieldset', {className: 'states'}, make('legend', {textContent: label}), ...buttons);
}

/** A box to tick beside its sample of colour. */
const toggle = (name, className) => make('label', {className: 'shown'},
  make('input', {type: 'checkbox', checked: true}), make('i', {className}), make('span', {textContent: name}));

/** What the colours of joints mean. */
function scale() {
  const colours = SCALE.map(([error]) => css(colourOf(error)));
  const bar = make('div', {className: 'scale'});
  bar.style.background = `linear-gradient(to right, ${colours.join(', ')})`;
  const labels = SCALE.map(([error], k) => ['≤ ', '', '', '', '≥ '][k] + error);
  const ticks = make('div', {className: 'ticks'}, ...labels.map(text => make('span', {textContent: text})));
  return make('div', {}, make('p', {textContent: 'Error of each joint, in noise floors'}), bar, ticks);
}

/** A joint of the list: its colour, its name, which leads to its section, and its error. */
function jointRow(textContent) {
  const title = [...document.querySelectorAll('section[id] > h2')].find(h2 => h2.textContent === textContent);
  const label = title ? make('a', {href: `#${title.parentElement.id}`, textContent}) : make('span', {textContent});
  const [dot, value] = [make('i'), make('b')];
  return {row: make('li', {}, dot, label, value), dot, value};
}

/** The picture. */
function stage(cell) {
  const canvas = make('canvas', {tabIndex: 0, role: 'img', title: HELP,
    'aria-label': `The robot as measured, and the model's replay. ${HELP}`});
  const grid = make('span', {className: 'cell', textContent: `grid: ${cell}`});
  const close = make('button', {type: 'button', className: 'close', 'aria-label': 'Close', textContent: '×'});
  return {canvas, close, stage: make('div', {className: 'stage'}, canvas, grid, close)};
}

/** What is shown, and what its colours mean. */
function side(motion) {
  const {joints, logs} = motion;
  const log = chooser('Log', logs.map(({name}, k) => option(name, k)));
  log.hidden = logs.length < 2;
  const state = choice(motion), rows = joints.map(jointRow);
  const [measured, ghost] = [toggle('measured', 'solid'), toggle('model', 'ghost')];
  const legend = make('div', {className: 'legend'}, measured, ghost);
  const list = make('ul', {className: 'joints'}, ...rows.map(({row}) => row));
  return {
    state,
    rows,
    log: log.querySelector('select'),
    measured: measured.querySelector('input'),
    ghost: ghost.querySelector('input'),
    swatch: ghost.querySelector('i'),
    side: make('div', {className: 'side'}, log, state, legend, scale(), list),
  };
}

/** The time; and the states of the model once more, where the player is small. */
function bar({states}) {
  const play = make('button', {type: 'button', className: 'play', 'aria-label': 'Play', textContent: '▶'});
  const time = make('input', {type: 'range', min: 0, step: 'any', 'aria-label': 'Time'});
  const strip = make('div', {className: 'strip', title: 'The largest error of all joints over time'});
  const track = make('div', {className: 'track'}, strip, time), clock = make('output', {className: 'clock'});
  const speed = chooser('Speed', SPEEDS.map(x => option(`${x} ×`, x, x === 1)));
  const stages = make('select', {className: 'stages', 'aria-label': 'The model'},
    ...states.map(({name, error}, k) => option(error ? `${name}: ${error}` : name, k)));
  const all = make('div', {className: 'bar'}, play, track, clock, speed, ...(states.length > 1 ? [stages] : []));
  return {play, time, strip, clock, speed: speed.querySelector('select'), stages, bar: all};
}

/** All elements of the player of a document. */
function controls(motion, cell) {
  const ui = {...stage(cell), ...side(motion), ...bar(motion)};
  const player = make('div', {className: 'player'}, ui.stage, ui.side, ui.bar);
  const notes = motion.notes.map(textContent => make('p', {className: 'note', textContent}));
  const section = make('section', {id: 'motion'}, make('h2', {textContent: 'Motion'}), player, ...notes);
  return {...ui, player, section};
}

// The plots of the page that are over the time of a log: a line at the shown time, and clicks that set it.

class Plots {
  /** `pick` is called with the log and the time of a click. */
  constructor(pick) {
    this.frames = [...document.querySelectorAll('rect.frame[data-log]')].map(frame => {
      const number = name => Number(frame.getAttribute(name));
      const at = {log: number('data-log'), from: number('data-from'), to: number('data-to')};
      const [x, width] = [number('x'), number('width')];
      const cursor = document.createElementNS('http://www.w3.org/2000/svg', 'line');
      cursor.classList.add('cursor');
      for (const end of ['y1', 'y2'])
        cursor.setAttribute(end, number('y') + (end === 'y2' ? number('height') : 0));
      frame.closest('g').append(cursor);
      const plot = frame.closest('svg');
      plot.classList.add('timed');
      plot.addEventListener('click', event => {
        const here = new DOMPoint(event.clientX, event.clientY).matrixTransform(frame.getScreenCTM().inverse());
        const share = Math.min(Math.max((here.x - x) / width, 0), 1);
        pick(at.log, at.from + share * (at.to - at.from));
      });
      return {...at, x, width, cursor};
    });
  }

  /** Shows the lines of a state of the model beside those of the first one; beside the first one, those of the last. */
  choose(chosen, last) {
    for (const shown of document.querySelectorAll('[data-state]')) {
      const state = Number(shown.getAttribute('data-state'));
      shown.classList.toggle('hidden', state !== 0 && state !== (chosen || last));
      shown.classList.toggle('faded', state !== chosen);
    }
  }

  /** Shows the time of a log. */
  show(log, time) {
    for (const {cursor, x, width, ...at} of this.frames) {
      cursor.classList.toggle('off', at.log !== log);
      const here = x + width * (time - at.from) / (at.to - at.from);
      for (const end of ['x1', 'x2']) cursor.setAttribute(end, here.toFixed(1));
    }
  }
}

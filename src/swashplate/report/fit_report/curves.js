// Curves over time as SVG: samples unpacked, panels drawn, a figure that zooms and reads values.

/**
 * Samples as `runs.packed` of Python writes them.
 * @typedef {object} Packed
 * @property {number} size How many there are.
 * @property {number} zero The value that the number 0 stands for.
 * @property {number} step Difference of two values whose numbers differ by 1.
 * @property {number} order How many times the numbers were differenced.
 * @property {string} code The numbers, deflated and in base64.
 * @property {Uint8Array} [bytes] The numbers, inflated by `inflate`.
 */

/** @typedef {[start: number, end: number]} Span Two instants, in s. */
/** @typedef {[start: number, end: number, name: string]} Shade A span with the class of its colour. */
/** @typedef {[name: string, values: Float64Array]} Line A line with the class of its colour. */
/** @typedef {"input" | "overlay" | "residual"} Kind */

/**
 * Lines over one clock, drawn in one frame.
 * @typedef {object} Panel
 * @property {Kind} kind
 * @property {string} label Of its axis: a name and, in brackets, a unit.
 * @property {Float64Array} time Stamps, in s.
 * @property {Set<number>} breaks Rows after which a line is broken.
 * @property {boolean} [held] Whether the values are held between two stamps.
 * @property {readonly Span[]} [ignored] Where samples do not count.
 * @property {readonly Shade[]} [shades] Where limits act.
 * @property {readonly Line[]} lines
 */

const LEFT = 78;
const RIGHT = 8;
const GAP = 12;
const BELOW = 34;
/** @type {Readonly<Record<Kind, number>>} */
const HEIGHTS = { input: 84, overlay: 150, residual: 92 };
const SVG = "http://www.w3.org/2000/svg";

// --- samples ---

/**
 * Bytes of a text in base64.
 * @param {string} code
 */
function decoded(code) {
  return Uint8Array.from(atob(code), (letter) => letter.charCodeAt(0));
}

/**
 * Bytes that were deflated and put into base64.
 * @param {string} code
 */
async function inflated(code) {
  const stream = new Blob([decoded(code)]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/**
 * Make samples ready for `unpacked`.
 * @param {readonly Packed[]} samples
 */
async function inflate(samples) {
  await Promise.all(
    samples.map(async (packed) => {
      packed.bytes = await inflated(packed.code);
    }),
  );
}

/**
 * Values of samples that `inflate` made ready.
 * @param {Packed} packed
 * @returns {Float64Array}
 */
function unpacked({ size, zero, step, order, bytes }) {
  if (!bytes) throw new Error("These samples were not inflated.");
  const values = new Float64Array(size);
  for (let row = 0; row < size; row++) {
    let number = 0;
    for (let plane = 3; plane >= 0; plane--) number = 256 * number + bytes[plane * size + row];
    values[row] = number % 2 ? -(number + 1) / 2 : number / 2;
  }
  for (let sum = 0; sum < order; sum++) {
    for (let row = 1; row < size; row++) values[row] += values[row - 1];
  }
  return values.map((number) => zero + step * number);
}

// --- drawing ---

/**
 * Append an element of SVG, perhaps with a text.
 * @param {Element} parent
 * @param {string} name
 * @param {Readonly<Record<string, string | number>>} attributes
 * @param {string} [words]
 */
function put(parent, name, attributes, words) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, String(value));
  if (words !== undefined) element.textContent = words;
  parent.append(element);
  return element;
}

/**
 * First row whose stamp is not below an instant.
 * @param {Float64Array} time
 * @param {number} instant
 */
function rowAt(time, instant) {
  let low = 0;
  let high = time.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (time[middle] < instant) low = middle + 1;
    else high = middle;
  }
  return low;
}

/**
 * Round numbers along an axis, with their texts.
 * @param {number} low
 * @param {number} high
 * @param {number} most How many at most, but three at least.
 * @returns {{ value: number, words: string }[]}
 */
function ticks(low, high, most) {
  const rough = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5].map((n) => n * power).find((n) => n >= rough * (1 - 1e-9)) ?? 10 * power;
  const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) {
    const value = k * step;
    const digits = value.toFixed(Math.min(decimals, 12)).replace(/^-(?=0\.?0*$)/, "");
    found.push({ value, words: digits.replace("-", "−") });
  }
  return found.length < 3 && most < 10 ? ticks(low, high, 2 * most) : found;
}

/**
 * Points of a line: of many rows in one column of dots the first, lowest, highest and last.
 * @param {Panel} panel
 * @param {Float64Array} values
 * @param {{ first: number, after: number }} rows
 * @param {(instant: number) => number} x
 * @param {(value: number) => number} y
 * @param {(instant: number) => number} columnEnd Instant at which the column of dots of an instant ends.
 */
function path(panel, values, rows, x, y, columnEnd) {
  const { time, breaks, held } = panel;
  const { after } = rows;
  let row = rows.first;
  let points = "";
  let pen = "M";
  /** @param {number} at */
  const go = (at) => {
    const across = x(time[at]).toFixed(1);
    if (held && pen === "L") points += `H${across}`;
    points += `${pen}${across} ${y(values[at]).toFixed(1)}`;
    pen = "L";
  };
  while (row < after) {
    // the instant at which the column ends: a comparison a row is all that many rows cost
    const end = columnEnd(time[row]);
    let last = row;
    let lowest = row;
    let highest = row;
    let low = values[row];
    let high = values[row];
    while (last + 1 < after && time[last + 1] < end && !(breaks.size && breaks.has(last))) {
      last++;
      const value = values[last];
      if (value < low) {
        low = value;
        lowest = last;
      } else if (value > high) {
        high = value;
        highest = last;
      }
    }
    const one = Math.min(lowest, highest);
    const two = Math.max(lowest, highest);
    const alone = pen === "M" && last === row;
    go(row);
    if (one > row) go(one);
    if (two > one && two < last) go(two);
    if (last > Math.max(row, one)) go(last);
    if (breaks.has(last)) {
      if (alone) points += "h.01";
      pen = "M";
    }
    row = last + 1;
  }
  return points;
}

/**
 * Points of lines as they were drawn last: a slider leaves most of them where they were.
 * @type {WeakMap<Float64Array, { frame: string, points: string }>}
 */
const drawn = new WeakMap();

/**
 * Lowest and highest value of a panel within some rows, with room about them.
 * @param {Panel} panel
 * @param {{ first: number, after: number }} rows
 */
function extremes(panel, { first, after }) {
  let low = panel.kind === "overlay" ? Infinity : 0;
  let high = panel.kind === "overlay" ? -Infinity : 0;
  for (const [, values] of panel.lines) {
    for (let row = first; row < after; row++) {
      if (values[row] < low) low = values[row];
      if (values[row] > high) high = values[row];
    }
  }
  if (!(low <= high)) {
    low = 0;
    high = 0;
  }
  const room = 0.07 * (high - low) || Math.abs(high) || 1;
  return { low: low - room, high: high + room };
}

/**
 * Draw a panel into a figure.
 * @param {Element} svg
 * @param {Panel} panel
 * @param {number} top
 * @param {number} width
 * @param {Span} view
 */
function drawPanel(svg, panel, top, width, [start, end]) {
  const height = HEIGHTS[panel.kind];
  const inner = width - LEFT - RIGHT;
  const scale = inner / (end - start);
  const rows = {
    first: Math.max(rowAt(panel.time, start) - 1, 0),
    after: Math.min(rowAt(panel.time, end) + 1, panel.time.length),
  };
  const { low, high } = extremes(panel, rows);
  /** @param {number} time */
  const x = (time) => (time - start) * scale;
  /** @param {number} value */
  const y = (value) => ((high - value) / (high - low)) * height;
  /** @param {number} time */
  const columnEnd = (time) => start + (Math.floor((time - start) * scale) + 1) / scale;
  const axis = put(svg, "g", { transform: `translate(${LEFT} ${top})` });
  const box = put(axis, "svg", { width: inner, height });
  /** @type {Shade[]} */
  const ignored = (panel.ignored ?? []).map(([from, to]) => [from, to, "ignored"]);
  for (const [from, to, name] of [...ignored, ...(panel.shades ?? [])]) {
    if (to <= start || from >= end) continue;
    const shaded = Math.max(x(to) - x(from), 1);
    put(box, "rect", { class: name, x: x(from), y: 0, width: shaded, height });
  }
  for (const { value, words } of ticks(low, high, height < 100 ? 4 : 5)) {
    const look = value === 0 ? "zero" : "grid";
    put(box, "line", { class: look, x1: 0, x2: inner, y1: y(value), y2: y(value) });
    put(axis, "text", { x: -7, y: y(value) + 4, "text-anchor": "end" }, words);
  }
  for (const { value } of ticks(start, end, inner / 75)) {
    put(box, "line", { class: "grid", x1: x(value), x2: x(value), y1: 0, y2: height });
  }
  const frame = [width, height, start, end, low, high].join();
  for (const [name, values] of panel.lines) {
    const before = drawn.get(values);
    const points =
      before?.frame === frame ? before.points : path(panel, values, rows, x, y, columnEnd);
    drawn.set(values, { frame, points });
    put(box, "path", { class: name, d: points });
  }
  panel.label.split("\n").forEach((words, line) => {
    const transform = `translate(${-LEFT + 11 + 13 * line} ${height / 2}) rotate(-90)`;
    put(axis, "text", { class: "label", transform, "text-anchor": "middle" }, words);
  });
}

/**
 * A stack of panels over one time axis.
 *
 * A kind of figure has `load`, which gives its first and last instant, and `panels`.
 */
class Figure {
  /** @param {HTMLElement} element Where it is drawn. */
  constructor(element) {
    this.element = element;
    this.readout = document.createElement("p");
    this.readout.className = "readout";
    /**
     * Width that it was drawn with, 0 before.
     * @type {number}
     */
    this.width = 0;
    /**
     * What is shown, null before it is drawn.
     * @type {Span | null}
     */
    this.view = null;
    /**
     * What is shown without a zoom.
     * @type {Span}
     */
    this.all = [0, 1];
    /**
     * The frame of a selection, or the line below the pointer.
     * @type {Element | null}
     */
    this.mark = null;
  }

  /** Whether it zooms and reads values. */
  get zooms() {
    return true;
  }

  /**
   * First and last instant.
   * @returns {Span}
   */
  load() {
    throw new Error("A kind of figure says what it loads.");
  }

  /**
   * What is drawn, from above.
   * @returns {Panel[]}
   */
  panels() {
    throw new Error("A kind of figure says what it draws.");
  }

  /**
   * What is to be shown, loaded if it is drawn for the first time.
   * @returns {Span}
   */
  begin() {
    if (this.view) return this.view;
    this.all = this.load();
    this.view = this.all;
    if (this.zooms) this.listen();
    return this.view;
  }

  /** Draw it; without a width it is not on the page. */
  draw(width = this.element.clientWidth) {
    if (!width) return;
    const [start, end] = this.begin();
    const panels = this.panels();
    const height = panels.reduce((sum, { kind }) => sum + HEIGHTS[kind] + GAP, BELOW);
    const svg = document.createElementNS(SVG, "svg");
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    svg.setAttribute("role", "img");
    const name = this.element.dataset.name;
    svg.setAttribute("aria-label", `${name}: measured and simulated over time`);
    let top = 6;
    for (const panel of panels) {
      drawPanel(svg, panel, top, width, [start, end]);
      top += HEIGHTS[panel.kind] + GAP;
    }
    const inner = width - LEFT - RIGHT;
    for (const { value, words } of ticks(start, end, inner / 75)) {
      const x = LEFT + ((value - start) / (end - start)) * inner;
      put(svg, "text", { x, y: top + 4, "text-anchor": "middle" }, words);
    }
    const middle = { class: "label", x: LEFT + inner / 2, y: top + 22, "text-anchor": "middle" };
    put(svg, "text", middle, "time (s)");
    this.width = width;
    const marked = top - 6 - GAP;
    this.mark = put(svg, "rect", { class: "selected", x: 0, y: 6, width: 0, height: marked });
    this.element.replaceChildren(svg, this.readout);
    this.element.dataset.drawn = "yes";
  }

  /**
   * Show another span, as far as there is one.
   * @param {Span} view
   */
  look(view) {
    const [start, end] = this.all;
    const least = 1e-4 * (end - start);
    const from = Math.max(start, view[0]);
    this.view = [from, Math.max(Math.min(end, view[1]), from + least)];
    this.draw();
  }

  /**
   * Instant at a place of the pointer, and the place within the figure.
   * @param {MouseEvent} event
   */
  at(event) {
    const { left, width } = (
      this.element.firstElementChild ?? this.element
    ).getBoundingClientRect();
    const place = ((event.clientX - left) * this.width) / width;
    const across = Math.min(Math.max(place, LEFT), this.width - RIGHT);
    const [start, end] = this.begin();
    const instant = start + ((across - LEFT) / (this.width - LEFT - RIGHT)) * (end - start);
    return { instant, across };
  }

  /** Zoom by dragging and by the wheel, and read values below the pointer. */
  listen() {
    const { element } = this;
    /** @type {{ instant: number, across: number } | null} */
    let pressed = null;
    element.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || event.pointerType === "touch") return;
      pressed = this.at(event);
      element.setPointerCapture(event.pointerId);
      event.preventDefault();
    });
    element.addEventListener("pointermove", (event) => {
      const { instant, across } = this.at(event);
      const from = pressed ? Math.min(pressed.across, across) : across;
      const width = pressed ? Math.abs(pressed.across - across) : 0.8;
      this.mark?.setAttribute("x", String(from));
      this.mark?.setAttribute("width", String(width));
      this.read(instant);
    });
    element.addEventListener("pointerup", (event) => {
      if (!pressed) return;
      const first = pressed;
      const last = this.at(event);
      pressed = null;
      if (Math.abs(last.across - first.across) <= 5) return;
      const [from, to] = [first.instant, last.instant].sort((one, other) => one - other);
      this.look([from, to]);
    });
    element.addEventListener("dblclick", () => this.look(this.all));
    element.addEventListener(
      "wheel",
      (event) => {
        if (!event.ctrlKey) return;
        event.preventDefault();
        const { instant } = this.at(event);
        const factor = 1.002 ** event.deltaY;
        const [start, end] = this.begin();
        this.look([instant + factor * (start - instant), instant + factor * (end - instant)]);
      },
      { passive: false },
    );
  }

  /**
   * Write the values at an instant below the figure.
   * @param {number} instant
   */
  read(instant) {
    const words = [`${instant.toFixed(3)} s`];
    for (const { time, lines, label } of this.panels()) {
      const row = Math.min(rowAt(time, instant), time.length - 1);
      const quantity = label.replaceAll("\n", " ").replace(/ \([^()]*\)$/, "");
      const unit = /\(([^()]*)\)$/.exec(label)?.[1] ?? "";
      for (const [name, values] of lines) {
        const alone = name === "input" || name === "residual";
        const digits = values[row].toPrecision(4).replace("-", "−");
        words.push(`${alone ? name : `${name} ${quantity}`} ${digits} ${unit}`);
      }
    }
    this.readout.textContent = words.join(" · ");
  }
}

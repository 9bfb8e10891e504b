// Curves over time as SVG: samples unpacked, panels drawn, a figure that zooms and reads values.

const LEFT = 78;
const RIGHT = 8;
const GAP = 12;
const BELOW = 34;
const HEIGHTS = { input: 84, overlay: 150, residual: 92 };
const PRINTED = 450;
const SVG = "http://www.w3.org/2000/svg";

// --- samples, as `runs.packed` writes them ---

async function inflated(code) {
  const bytes = Uint8Array.from(atob(code), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function unpacked({ size, zero, step, order, bytes }) {
  const values = new Float64Array(size);
  for (let row = 0; row < size; row++) {
    let number = 0;
    for (let plane = 3; plane >= 0; plane--) number = 256 * number + bytes[plane * size + row];
    values[row] = number % 2 ? -(number + 1) / 2 : number / 2;
  }
  for (; order > 0; order--) for (let row = 1; row < size; row++) values[row] += values[row - 1];
  return values.map((number) => zero + step * number);
}

// --- drawing ---

function put(parent, name, attributes, words) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (words !== undefined) made.textContent = words;
  parent.append(made);
  return made;
}

/** First row whose stamp is not below an instant. */
function rowAt(time, instant) {
  let [low, high] = [0, time.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (time[middle] < instant) low = middle + 1;
    else high = middle;
  }
  return low;
}

function ticks(low, high, most) {
  const rough = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((each) => each * power).find((each) => each >= rough * (1 - 1e-9));
  const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const made = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) {
    made.push([
      k * step,
      (k * step)
        .toFixed(Math.min(decimals, 12))
        .replace(/^-(?=0\.?0*$)/, "")
        .replace("-", "−"),
    ]);
  }
  return made.length < 3 && most < 10 ? ticks(low, high, 2 * most) : made;
}

/** Points of a line: of many rows in one column of dots the first, lowest, highest and last. */
function path(panel, values, first, after, [start, scale], y) {
  const { time, breaks, held } = panel;
  let [made, pen, row] = ["", "M", first];
  const go = (at) => {
    const across = ((time[at] - start) * scale).toFixed(1);
    if (held && pen === "L") made += `H${across}`;
    made += `${pen}${across} ${y(values[at]).toFixed(1)}`;
    pen = "L";
  };
  while (row < after) {
    // the instant at which the column ends: a comparison a row is all that many rows cost
    const end = start + (Math.floor((time[row] - start) * scale) + 1) / scale;
    let [last, lowest, highest] = [row, row, row];
    let [low, high] = [values[row], values[row]];
    while (last + 1 < after && time[last + 1] < end && !(breaks.size && breaks.has(last))) {
      const value = values[++last];
      if (value < low) [low, lowest] = [value, last];
      else if (value > high) [high, highest] = [value, last];
    }
    const [one, two] = lowest < highest ? [lowest, highest] : [highest, lowest];
    const alone = pen === "M" && last === row;
    go(row);
    if (one > row) go(one);
    if (two > one && two < last) go(two);
    if (last > Math.max(row, one)) go(last);
    if (breaks.has(last)) {
      if (alone) made += "h.01";
      pen = "M";
    }
    row = last + 1;
  }
  return made;
}

/** Points of lines as they were drawn last: a slider leaves most of them where they were. */
const drawn = new WeakMap();

function drawPanel(svg, panel, kind, label, top, height, width, [start, end]) {
  const inner = width - LEFT - RIGHT;
  const scale = inner / (end - start);
  const x = (time) => (time - start) * scale;
  const first = Math.max(rowAt(panel.time, start) - 1, 0);
  const after = Math.min(rowAt(panel.time, end) + 1, panel.time.length);
  let [low, high] = kind === "overlay" ? [Infinity, -Infinity] : [0, 0];
  for (const [, values] of panel.lines) {
    for (let row = first; row < after; row++) {
      if (values[row] < low) low = values[row];
      if (values[row] > high) high = values[row];
    }
  }
  if (!(low <= high)) [low, high] = [0, 0];
  const room = 0.07 * (high - low) || Math.abs(high) || 1;
  [low, high] = [low - room, high + room];
  const y = (value) => ((high - value) / (high - low)) * height;
  const axis = put(svg, "g", { transform: `translate(${LEFT} ${top})` });
  const box = put(axis, "svg", { width: inner, height });
  for (const [from, to, name = "ignored"] of [...(panel.ignored ?? []), ...(panel.shades ?? [])]) {
    if (to > start && from < end)
      put(box, "rect", {
        class: name,
        x: x(from),
        y: 0,
        width: Math.max(x(to) - x(from), 1),
        height,
      });
  }
  for (const [value, words] of ticks(low, high, height < 100 ? 4 : 5)) {
    put(box, "line", {
      class: value === 0 ? "zero" : "grid",
      x1: 0,
      x2: inner,
      y1: y(value),
      y2: y(value),
    });
    put(axis, "text", { x: -7, y: y(value) + 4, "text-anchor": "end" }, words);
  }
  for (const [value] of ticks(start, end, inner / 75))
    put(box, "line", { class: "grid", x1: x(value), x2: x(value), y1: 0, y2: height });
  const place = [width, height, start, end, low, high].join();
  for (const [name, values] of panel.lines) {
    const known = drawn.get(values);
    const d =
      known?.place === place ? known.d : path(panel, values, first, after, [start, scale], y);
    drawn.set(values, { place, d });
    put(box, "path", { class: name, d });
  }
  const lines = label.split("\n");
  lines.forEach((words, k) => {
    const across = -LEFT + 11 + 13 * k;
    put(
      axis,
      "text",
      {
        class: "label",
        transform: `translate(${across} ${height / 2}) rotate(-90)`,
        "text-anchor": "middle",
      },
      words,
    );
  });
}

/** A stack of panels over one time axis. A kind of figure has `load`, which gives its first and last instant,
 * and `panels`: of each what `drawPanel` draws, its kind and its label. */
class Figure {
  constructor(element) {
    this.element = element;
    this.readout = document.createElement("p");
    this.readout.className = "readout";
  }

  get zooms() {
    return true;
  }

  begin() {
    if (this.view) return;
    this.all = this.view = this.load();
    if (this.zooms) this.listen();
  }

  draw(width = this.element.clientWidth) {
    if (!width) return;
    this.begin();
    const panels = this.panels();
    const height = panels.reduce((sum, [, kind]) => sum + HEIGHTS[kind] + GAP, BELOW);
    const svg = document.createElementNS(SVG, "svg");
    for (const [key, value] of [
      ["viewBox", `0 0 ${width} ${height}`],
      ["role", "img"],
    ])
      svg.setAttribute(key, value);
    svg.setAttribute(
      "aria-label",
      `${this.element.dataset.name}: measured and simulated over time`,
    );
    let top = 6;
    for (const [panel, kind, label] of panels) {
      drawPanel(svg, panel, kind, label, top, HEIGHTS[kind], width, this.view);
      top += HEIGHTS[kind] + GAP;
    }
    const inner = width - LEFT - RIGHT;
    const [start, end] = this.view;
    for (const [value, words] of ticks(start, end, inner / 75)) {
      put(
        svg,
        "text",
        {
          x: LEFT + ((value - start) / (end - start)) * inner,
          y: top + 4,
          "text-anchor": "middle",
        },
        words,
      );
    }
    put(
      svg,
      "text",
      { class: "label", x: LEFT + inner / 2, y: top + 22, "text-anchor": "middle" },
      "time (s)",
    );
    this.width = width;
    this.mark = put(svg, "rect", {
      class: "selected",
      x: 0,
      y: 6,
      width: 0,
      height: top - 6 - GAP,
    });
    this.element.replaceChildren(svg, this.readout);
    this.element.dataset.drawn = "yes";
  }

  look(view) {
    const [start, end] = this.all;
    const least = 1e-4 * (end - start);
    const from = Math.max(start, view[0]);
    this.view = [from, Math.max(Math.min(end, view[1]), from + least)];
    this.draw();
  }

  /** Instant at a place of the pointer, and the place within the figure. */
  at(event) {
    const { left, width } = this.element.firstChild.getBoundingClientRect();
    const place = Math.min(
      Math.max(((event.clientX - left) * this.width) / width, LEFT),
      this.width - RIGHT,
    );
    const [start, end] = this.view;
    return [start + ((place - LEFT) / (this.width - LEFT - RIGHT)) * (end - start), place];
  }

  listen() {
    const { element } = this;
    let held = null;
    element.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || event.pointerType === "touch") return;
      held = this.at(event);
      element.setPointerCapture(event.pointerId);
      event.preventDefault();
    });
    element.addEventListener("pointermove", (event) => {
      const [instant, place] = this.at(event);
      const from = held ? Math.min(held[1], place) : place;
      this.mark.setAttribute("x", from);
      this.mark.setAttribute("width", held ? Math.abs(held[1] - place) : 0.8);
      this.read(instant);
    });
    element.addEventListener("pointerup", (event) => {
      if (!held) return;
      const [instant, place] = this.at(event);
      const [first, from] = held;
      held = null;
      if (Math.abs(place - from) > 5)
        this.look([Math.min(first, instant), Math.max(first, instant)]);
    });
    element.addEventListener("dblclick", () => this.look(this.all));
    element.addEventListener(
      "wheel",
      (event) => {
        if (!event.ctrlKey) return;
        event.preventDefault();
        const [instant] = this.at(event);
        const factor = 1.002 ** event.deltaY;
        this.look(this.view.map((each) => instant + factor * (each - instant)));
      },
      { passive: false },
    );
  }

  /** Write the values at an instant below the figure. */
  read(instant) {
    const words = [`${instant.toFixed(3)} s`];
    for (const [panel, , label] of this.panels()) {
      const row = Math.min(rowAt(panel.time, instant), panel.time.length - 1);
      for (const [name, values] of panel.lines) {
        const what =
          name === "input" || name === "residual"
            ? name
            : `${name} ${label.replaceAll("\n", " ").replace(/ \([^()]*\)$/, "")}`;
        const unit = /\(([^()]*)\)$/.exec(label)?.[1] ?? "";
        words.push(`${what} ${values[row].toPrecision(4).replace("-", "−")} ${unit}`);
      }
    }
    this.readout.textContent = words.join(" · ");
  }
}

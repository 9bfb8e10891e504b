"use strict";
(() => {
  const LEFT = 78, RIGHT = 8, GAP = 12, BELOW = 34;
  const HEIGHTS = { input: 84, overlay: 150, residual: 92 };
  const PRINTED = 450;
  const SVG = "http://www.w3.org/2000/svg";

  // --- samples, as `runs.packed` writes them ---

  async function inflated(code) {
    const bytes = Uint8Array.from(atob(code), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  }

  const runs = [...document.querySelectorAll("script[id^=samples]")].map((each) => JSON.parse(each.textContent));
  const packed = runs.flatMap((run) => [run.input, ...run.channels]).flatMap((each) => [each.time, ...each.signals]);
  const ready = Promise.all(packed.map(async (each) => (each.bytes = await inflated(each.code))));

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

  /** Signals of a run: the input, then of each channel what was simulated and measured, and the residual. */
  function samples(number) {
    const run = runs[number];
    const clock = (each) => ({ time: unpacked(each.time), breaks: new Set(each.breaks) });
    const input = { ...clock(run.input), held: run.held, lines: [["input", unpacked(run.input.signals[0])]] };
    const channels = run.channels.map((each) => {
      const own = { ...clock(each), ignored: each.ignored };
      const [simulated, residual] = each.signals.map(unpacked);
      const measured = simulated.map((value, row) => value - each.ratio * residual[row]);
      return {
        overlay: { ...own, lines: [["measured", measured], ["simulated", simulated]] },
        residual: { ...own, lines: [["residual", residual]] },
      };
    });
    const ends = [input, ...channels.map((each) => each.overlay)].filter((each) => each.time.length);
    const start = Math.min(...ends.map((each) => each.time[0]));
    const end = Math.max(...ends.map((each) => each.time.at(-1)));
    return { input, channels, all: [start, end > start ? end : start + 1] };
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
      made.push([k * step, (k * step).toFixed(Math.min(decimals, 12)).replace(/^-(?=0\.?0*$)/, "").replace("-", "−")]);
    }
    return made;
  }

  /** Points of a line: of many rows in one column of dots the first, lowest, highest and last. */
  function path(panel, values, first, after, x, y) {
    const { time, breaks, held } = panel;
    const parts = [];
    let [pen, row] = ["M", first];
    const go = (at) => {
      if (held && pen === "L") parts.push(`H${x(time[at]).toFixed(1)}`);
      parts.push(`${pen}${x(time[at]).toFixed(1)} ${y(values[at]).toFixed(1)}`);
      pen = "L";
    };
    while (row < after) {
      const column = Math.floor(x(time[row]));
      let [last, lowest, highest] = [row, row, row];
      while (!breaks.has(last) && last + 1 < after && Math.floor(x(time[last + 1])) === column) {
        last++;
        if (values[last] < values[lowest]) lowest = last;
        if (values[last] > values[highest]) highest = last;
      }
      for (const at of [...new Set([row, lowest, highest, last])].sort((a, b) => a - b)) go(at);
      if (breaks.has(last)) {
        if (parts.at(-1)[0] === "M") parts.push("h.01");
        pen = "M";
      }
      row = last + 1;
    }
    return parts.join("");
  }

  function drawPanel(svg, panel, kind, label, top, height, width, [start, end]) {
    const inner = width - LEFT - RIGHT;
    const x = (time) => ((time - start) / (end - start)) * inner;
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
    for (const [from, to] of panel.ignored ?? []) {
      const left = x(from);
      if (to > start && from < end) put(box, "rect", { class: "ignored", x: left, y: 0, width: Math.max(x(to) - left, 1), height });
    }
    for (const [value, words] of ticks(low, high, height < 100 ? 4 : 5)) {
      put(box, "line", { class: value === 0 ? "zero" : "grid", x1: 0, x2: inner, y1: y(value), y2: y(value) });
      put(axis, "text", { x: -7, y: y(value) + 4, "text-anchor": "end" }, words);
    }
    for (const [value] of ticks(start, end, inner / 75)) put(box, "line", { class: "grid", x1: x(value), x2: x(value), y1: 0, y2: height });
    for (const [name, values] of panel.lines) put(box, "path", { class: name, d: path(panel, values, first, after, x, y) });
    const lines = label.split("\n");
    lines.forEach((words, k) => {
      const across = -LEFT + 11 + 13 * k;
      put(axis, "text", { class: "label", transform: `translate(${across} ${height / 2}) rotate(-90)`, "text-anchor": "middle" }, words);
    });
  }

  class Figure {
    constructor(element) {
      this.element = element;
      this.labels = JSON.parse(element.dataset.labels);
      this.brief = element.dataset.channel === undefined ? null : Number(element.dataset.channel);
      this.readout = document.createElement("p");
      this.readout.className = "readout";
    }

    begin() {
      if (this.run) return;
      this.run = samples(this.element.dataset.run);
      this.view = this.run.all;
      if (this.brief === null) this.listen();
    }

    panels() {
      const [input, ...channels] = this.labels;
      const made = this.brief === null ? [[this.run.input, "input", input]] : [];
      this.run.channels.forEach((each, k) => {
        if (this.brief !== null && this.brief !== k) return;
        made.push([each.overlay, "overlay", channels[k][0]]);
        if (this.brief === null) made.push([each.residual, "residual", channels[k][1]]);
      });
      return made;
    }

    draw(width = this.element.clientWidth) {
      if (!width) return;
      this.begin();
      const panels = this.panels();
      const height = panels.reduce((sum, [, kind]) => sum + HEIGHTS[kind] + GAP, BELOW);
      const svg = document.createElementNS(SVG, "svg");
      for (const [key, value] of [["viewBox", `0 0 ${width} ${height}`], ["role", "img"]]) svg.setAttribute(key, value);
      svg.setAttribute("aria-label", `${this.element.dataset.name}: measured and simulated over time`);
      let top = 6;
      for (const [panel, kind, label] of panels) {
        drawPanel(svg, panel, kind, label, top, HEIGHTS[kind], width, this.view);
        top += HEIGHTS[kind] + GAP;
      }
      const inner = width - LEFT - RIGHT;
      const [start, end] = this.view;
      for (const [value, words] of ticks(start, end, inner / 75)) {
        put(svg, "text", { x: LEFT + ((value - start) / (end - start)) * inner, y: top + 4, "text-anchor": "middle" }, words);
      }
      put(svg, "text", { class: "label", x: LEFT + inner / 2, y: top + 22, "text-anchor": "middle" }, "time (s)");
      this.width = width;
      this.mark = put(svg, "rect", { class: "selected", x: 0, y: 6, width: 0, height: top - 6 - GAP });
      this.element.replaceChildren(svg, this.readout);
      this.element.dataset.drawn = "yes";
    }

    look(view) {
      const [start, end] = this.run.all;
      const least = 1e-4 * (end - start);
      const from = Math.max(start, view[0]);
      this.view = [from, Math.max(Math.min(end, view[1]), from + least)];
      this.draw();
    }

    /** Instant at a place of the pointer, and the place within the figure. */
    at(event) {
      const { left, width } = this.element.firstChild.getBoundingClientRect();
      const place = Math.min(Math.max(((event.clientX - left) * this.width) / width, LEFT), this.width - RIGHT);
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
        if (Math.abs(place - from) > 5) this.look([Math.min(first, instant), Math.max(first, instant)]);
      });
      element.addEventListener("dblclick", () => this.look(this.run.all));
      element.addEventListener("wheel", (event) => {
        if (!event.ctrlKey) return;
        event.preventDefault();
        const [instant] = this.at(event);
        const factor = 1.002 ** event.deltaY;
        this.look(this.view.map((each) => instant + factor * (each - instant)));
      }, { passive: false });
    }

    /** Write the values at an instant below the figure. */
    read(instant) {
      const words = [`${instant.toFixed(3)} s`];
      for (const [panel, , label] of this.panels()) {
        const row = Math.min(rowAt(panel.time, instant), panel.time.length - 1);
        for (const [name, values] of panel.lines) {
          const what = name === "input" || name === "residual" ? name : `${name} ${label.replaceAll("\n", " ").replace(/ \([^()]*\)$/, "")}`;
          const unit = /\(([^()]*)\)$/.exec(label)?.[1] ?? "";
          words.push(`${what} ${values[row].toPrecision(4).replace("-", "−")} ${unit}`);
        }
      }
      this.readout.textContent = words.join(" · ");
    }
  }

  // What the reader comes near is drawn; all of it for paper, where nobody scrolls.
  const figures = new Map([...document.querySelectorAll(".stack")].map((each) => [each, new Figure(each)]));
  const near = new IntersectionObserver((seen) => {
    for (const each of seen) {
      if (!each.isIntersecting || each.target.dataset.drawn) continue;
      figures.get(each.target).draw();
    }
  }, { rootMargin: "600px" });
  // in a frame of its own: drawing changes the height, which is observed, too
  const sized = new ResizeObserver((seen) => requestAnimationFrame(() => {
    for (const { target } of seen) {
      const figure = figures.get(target);
      if (figure.width && figure.width !== target.clientWidth && !matchMedia("print").matches) figure.draw();
    }
  }));
  const showAll = (width) => figures.forEach((each) => each.draw(width));
  function start() {
    for (const [each, figure] of figures) {
      if (each.getBoundingClientRect().top < innerHeight) figure.draw();
      near.observe(each);
      sized.observe(each);
    }
    addEventListener("beforeprint", () => showAll(PRINTED));
    addEventListener("afterprint", () => showAll());
    if (location.hash === "#all") showAll();
  }
  // A browser without a window prints at the load event, which a document still open holds up.
  const hold = document.createElement("iframe");
  hold.hidden = true;
  document.body.append(hold);
  hold.contentDocument.open();
  ready.then(start).finally(() => {
    hold.contentDocument.close();
    hold.remove();
  });

  // A link into folded details opens them, and paper shows them.
  const opened = () => {
    const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
    for (let each = target?.closest("details"); each; each = each.parentElement.closest("details")) each.open = true;
    target?.scrollIntoView();
  };
  addEventListener("hashchange", opened);
  if (location.hash) opened();
  const folded = [...document.querySelectorAll("details:not([open])")];
  addEventListener("beforeprint", () => folded.forEach((each) => (each.open = true)));

  // The contents mark where the reader is.
  const links = new Map([...document.querySelectorAll("nav a")].map((a) => [a.hash.slice(1), a]));
  const here = new IntersectionObserver((seen) => {
    for (const each of seen) links.get(each.target.id)?.classList.toggle("here", each.isIntersecting);
  }, { rootMargin: "-10% 0px -70%" });
  for (const id of links.keys()) here.observe(document.getElementById(id));
})();

"use strict";
(() => {
  // A view of more samples than 4 * COLUMNS shows the extremes of each of COLUMNS stretches.
  const COLUMNS = 1000;
  // While the view moves the samples at hand are drawn; others come when it has rested so long (ms).
  const REST = 60;

  const parsed = (id) => JSON.parse(document.getElementById(id).textContent);

  function unpacked({ type, data }) {
    const bytes = Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0));
    return type === "float64" ? new Float64Array(bytes.buffer) : new Float32Array(bytes.buffer);
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

  /** Rows between two instants, and one on either side, that show what all of them would. */
  function rowsWithin(time, signals, start, end) {
    const first = Math.max(rowAt(time, start) - 1, 0);
    const after = Math.min(rowAt(time, end) + 1, time.length);
    const rows = [];
    if (after - first <= 4 * COLUMNS) {
      for (let row = first; row < after; row++) rows.push(row);
      return rows;
    }
    const stretch = (after - first) / COLUMNS;
    for (let column = 0; column < COLUMNS; column++) {
      const from = first + Math.floor(column * stretch);
      const to = first + Math.floor((column + 1) * stretch);
      const kept = new Set(column === 0 ? [from] : []);
      for (const values of signals) {
        let [lowest, highest, gap] = [-1, -1, -1];
        for (let row = from; row < to; row++) {
          if (Number.isNaN(values[row])) gap = row;
          else {
            if (lowest < 0 || values[row] < values[lowest]) lowest = row;
            if (highest < 0 || values[row] > values[highest]) highest = row;
          }
        }
        for (const row of [lowest, highest, gap]) if (row >= 0) kept.add(row);
      }
      rows.push(...[...kept].sort((a, b) => a - b));
    }
    rows.push(after - 1);
    return rows;
  }

  /** Columns of a source; a held signal as a staircase. */
  function picked(time, signals, rows, held) {
    const data = { time: Float64Array.from(rows, (row) => time[row]) };
    for (const [name, values] of Object.entries(signals)) {
      data[name] = Float64Array.from(rows, (row) => values[row]);
    }
    if (!held) return data;
    const stairs = { time: [], values: [] };
    rows.forEach((_, k) => {
      if (k > 0) {
        stairs.time.push(data.time[k]);
        stairs.values.push(data.values[k - 1]);
      }
      stairs.time.push(data.time[k]);
      stairs.values.push(data.values[k]);
    });
    return stairs;
  }

  let copies = 0;

  /** An item of the page with identifiers of its own, so that it can be drawn many times. */
  function copied(element) {
    const text = document.getElementById(`item-${element.dataset.item}`).textContent;
    const copy = copies++;
    return JSON.parse(text.replaceAll(/"(id|root_id)":"p(\d+)"/g, `"$1":"c${copy}-$2"`));
  }

  /** Attributes of an item's models that have a name, by it. */
  function named(node, found = new Map()) {
    if (node === null || typeof node !== "object") return found;
    if (node.type === "object" && node.attributes?.name) found.set(node.attributes.name, node.attributes);
    for (const each of Object.values(node)) named(each, found);
    return found;
  }

  async function drawn(element, item = copied(element)) {
    element.id = `figure-${copies++}`;
    const manager = await Bokeh.embed.embed_item(item, element.id);
    return [...manager][0].model.document;
  }

  async function showRun(element) {
    const run = parsed(`samples-${element.dataset.run}`);
    const clocks = run.clocks.map(unpacked);
    const lines = [{ name: "input", time: clocks[run.input.clock], held: run.held,
      signals: { values: unpacked(run.input.values) } }];
    run.channels.forEach((channel, k) => {
      const time = clocks[channel.clock];
      lines.push({ name: `overlay ${k}`, time, signals: {
        measured: unpacked(channel.measured), simulated: unpacked(channel.simulated) } });
      lines.push({ name: `residual ${k}`, time, signals: { residual: unpacked(channel.residual) } });
    });
    const within = ({ time, signals, held }, from, to) =>
      picked(time, signals, rowsWithin(time, Object.values(signals), from, to), held);
    const start = Math.min(...clocks.map((time) => time[0]));
    const end = Math.max(...clocks.map((time) => time[time.length - 1]));

    // The first samples are there before anything is drawn.
    const item = copied(element);
    const attributes = named(item);
    Object.assign(attributes.get("time"), { start, end, reset_start: start, reset_end: end, bounds: [start, end] });
    const put = (name, data) => {
      attributes.get(name).data.entries = Object.entries(data).map(([key, each]) => [key, Array.from(each)]);
    };
    for (const each of lines) put(each.name, within(each, start, end));
    run.channels.forEach((channel, k) => put(`ignored ${k}`, {
      first: channel.ignored.map((each) => each[0]), last: channel.ignored.map((each) => each[1]) }));
    const figures = await drawn(element, item);

    const range = figures.get_model_by_name("time");
    let waiting = 0;
    range.change.connect(() => {
      clearTimeout(waiting);
      waiting = setTimeout(() => {
        for (const each of lines) {
          figures.get_model_by_name(each.name).data = within(each, range.start, range.end);
        }
      }, REST);
    });
    element.addEventListener("dblclick", () => range.setv({ start, end }));
  }

  // One after another: what the reader looks at is drawn when it comes near.
  let queue = Promise.resolve();
  function show(element) {
    if (element.dataset.drawn) return;
    element.dataset.drawn = "waiting";
    queue = queue.then(async () => {
      await (element.dataset.run === undefined ? drawn(element) : showRun(element));
      element.dataset.drawn = "yes";
    });
  }

  const figures = document.querySelectorAll(".figure");
  const near = new IntersectionObserver((seen) => {
    for (const each of seen) if (each.isIntersecting) { near.unobserve(each.target); show(each.target); }
  }, { rootMargin: "600px" });
  for (const each of figures) near.observe(each);
  const showAll = () => figures.forEach(show);
  addEventListener("beforeprint", showAll);
  if (location.hash === "#all") showAll();

  // The contents mark where the reader is.
  const links = new Map([...document.querySelectorAll("nav a")].map((a) => [a.hash.slice(1), a]));
  const here = new IntersectionObserver((seen) => {
    for (const each of seen) links.get(each.target.id)?.classList.toggle("here", each.isIntersecting);
  }, { rootMargin: "-10% 0px -70%" });
  for (const id of links.keys()) here.observe(document.getElementById(id));
})();

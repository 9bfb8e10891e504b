// The live page: the drive as WebAssembly, sliders for its parameters, measured and simulated curves over each run.

/**
 * A parameter's value, as `live._parameters` of Python writes it.
 * @typedef {object} ParameterData
 * @property {number} number Its place in the drive's C.
 * @property {string} symbol
 * @property {string} column
 * @property {string} block
 * @property {string} words
 * @property {string} si Unit of the value.
 * @property {string} unit Unit of people.
 * @property {number} factor From the value to that unit.
 * @property {number} value
 * @property {[low: number, high: number] | null} range Ends of its slider.
 * @property {boolean} main Whether it was fitted.
 */

/**
 * A factor on several parameters.
 * @typedef {object} DesignVariableData
 * @property {string} name
 * @property {string} words
 * @property {[number: number, power: number][]} moves
 * @property {[low: number, high: number]} range
 */

/**
 * How a signal is shown, as `live._shown` of Python writes it.
 * @typedef {object} ShownData
 * @property {string} signal
 * @property {string} name
 * @property {string} unit
 * @property {number} factor From SI to that unit.
 * @property {string} label
 * @property {string} residual Label of the residual.
 * @property {string[]} shaded Limits that are shaded.
 */

/**
 * What a channel has besides, as `live._channel` of Python writes it.
 * @typedef {object} MeasuredData
 * @property {string} also A signal that is added, or nothing.
 * @property {boolean} speed Whether the signal is a position, and its speed is compared.
 * @property {Packed} time
 * @property {Packed} measured In the unit that is shown.
 * @property {number[]} breaks
 * @property {Span[]} ignored
 */

/**
 * An input of a run, as `live._input` of Python writes it.
 * @typedef {object} InputData
 * @property {string} label
 * @property {number} factor From SI to the unit that is shown.
 * @property {boolean} shown Whether it has a panel.
 * @property {string} values Of four bytes each, the lowest bytes first; deflated and in base64.
 */

/**
 * A run, as `live.run_of` of Python writes it.
 * @typedef {object} RunData
 * @property {string} name
 * @property {string} role
 * @property {number} start In s.
 * @property {number} step In s.
 * @property {InputData[]} inputs In the order in which the machine's C takes them.
 * @property {boolean} [steady] Whether it begins in the steady state.
 * @property {(ShownData & MeasuredData)[]} channels
 */

/**
 * All that `live.live_page` of Python hands over.
 * @typedef {object} LiveData
 * @property {string} wasm
 * @property {string} values Of the machine: doubles in base64.
 * @property {ParameterData[]} parameters
 * @property {DesignVariableData[]} design_variables
 * @property {{ name: string, number: number }[]} outputs
 * @property {[bit: number, name: string][]} limits
 * @property {string} before What the values at first are called.
 * @property {boolean} as_options Whether changed values are options of a command, not lines of a file.
 * @property {{ low: number, high: number }} filter Angular frequencies of the filters of a speed.
 * @property {ShownData[]} unmeasured What is shown of a run without channels.
 * @property {RunData[]} runs
 */

/**
 * What the compiled machine exports: statuses, of which 0 is well, and addresses in its memory.
 * @typedef {object} MachineExports
 * @property {WebAssembly.Memory} memory
 * @property {(count: number) => number} swp_page_values
 * @property {(count: number) => number} swp_page_init
 * @property {(number: number) => number} swp_page_get
 * @property {(number: number, value: number) => number} swp_page_set
 * @property {() => number} swp_page_update
 * @property {(status: number) => number} swp_page_sentence
 * @property {(count: number, step: number, outputs: number) => number} swp_page_begin
 * @property {(row: number, output: number) => void} swp_page_select
 * @property {(number: number) => number} swp_page_input
 * @property {(steady: number) => number} swp_page_run
 * @property {(row: number) => number} swp_page_row
 * @property {() => number} swp_page_limits
 */

/** @typedef {Record<string, Float64Array>} Signals Simulated signals by name, SI. */
/** @typedef {{ rmse: number, fit: number }} Errors Of a channel: RMSE in SI, fit in per cent. */
/** @typedef {{ wrong: string }} Refusal The sentence that says why there is no simulation. */

/**
 * A simulated run; of each that is shown its values, and the errors of a channel.
 * @typedef {object} Simulated
 * @property {Signals} signals
 * @property {Uint8Array} limits A byte a sample, in which a limit that acts has its bit.
 * @property {Float64Array[]} seen
 * @property {(Errors | null)[]} errors
 * @property {Float64Array[]} lines What is drawn of `seen`, filled where it is drawn.
 */

/**
 * The element of a name.
 * @template {HTMLElement} E
 * @param {string} name
 * @param {new () => E} kind
 * @returns {E}
 */
function element(name, kind) {
  const found = document.getElementById(name);
  if (!(found instanceof kind)) throw new Error(`The page has no ${kind.name} '${name}'.`);
  return found;
}

/**
 * A new element with properties, set in their order.
 * @template {keyof HTMLElementTagNameMap} T
 * @param {T} tag
 * @param {Partial<HTMLElementTagNameMap[T]>} properties
 * @returns {HTMLElementTagNameMap[T]}
 */
function created(tag, properties) {
  return Object.assign(document.createElement(tag), properties);
}

/** @type {LiveData} */
const data = JSON.parse(element("live", HTMLScriptElement).text);

/**
 * A number in a few digits.
 * @param {number} value
 */
function digits(value, count = 4) {
  const [head, power] = value.toPrecision(count).replace("-", "−").split("e");
  return power ? `${head}·10^${Number(power)}`.replace("-", "−") : head;
}

// --- the drive ---

/** A machine of the compiled source: parameters by number, and runs over inputs on an even grid. */
class Machine {
  /** @param {MachineExports} exports */
  constructor(exports) {
    this.c = exports;
    const values = new Float64Array(decoded(data.values).buffer);
    this.doubles(this.c.swp_page_values(values.length), values.length).set(values);
    const wrong = this.sentence(this.c.swp_page_init(values.length));
    if (wrong) throw new Error(wrong);
  }

  /**
   * Doubles in the drive's memory, until it grows.
   * @param {number} address
   * @param {number} count
   */
  doubles(address, count) {
    return new Float64Array(this.c.memory.buffer, address, count);
  }

  /**
   * A parameter's value.
   * @param {number} number
   */
  get(number) {
    return this.c.swp_page_get(number);
  }

  /**
   * Set values by number; empty, or the sentence that says what is wrong.
   * @param {Map<number, number>} values
   * @returns {string}
   */
  set(values) {
    for (const [number, value] of values) {
      const wrong = this.c.swp_page_set(number, value);
      if (wrong) return this.sentence(wrong);
    }
    return this.sentence(this.c.swp_page_update());
  }

  /**
   * What a status says; empty if all is well.
   * @param {number} status
   */
  sentence(status) {
    if (!status) return "";
    const memory = new Uint8Array(this.c.memory.buffer, this.c.swp_page_sentence(status));
    return new TextDecoder().decode(memory.subarray(0, memory.indexOf(0)));
  }

  /**
   * Signals over a run, and its limits.
   * @param {Run} run
   * @returns {{ signals: Signals, limits: Uint8Array } | Refusal}
   */
  simulate({ inputs, step, steady, shown }) {
    // what the run's channels are compared with
    /** @type {Set<string>} */
    const names = new Set();
    for (const { signal, measured } of shown) {
      names.add(signal);
      if (measured) names.add(measured.also);
    }
    const outputs = data.outputs.filter(({ name }) => names.has(name));
    const count = inputs[0].values.length;
    const wrong = this.c.swp_page_begin(count, step, outputs.length);
    if (wrong) return { wrong: this.sentence(wrong) };
    outputs.forEach(({ number }, row) => {
      this.c.swp_page_select(row, number);
    });
    inputs.forEach(({ values }, which) => {
      this.doubles(this.c.swp_page_input(which), count).set(values);
    });
    const status = this.c.swp_page_run(steady ? 1 : 0);
    if (status) return { wrong: this.sentence(status) };
    /** @type {Signals} */
    const signals = {};
    outputs.forEach(({ name }, row) => {
      signals[name] = this.doubles(this.c.swp_page_row(row), count).slice();
    });
    const limits = new Uint8Array(this.c.memory.buffer, this.c.swp_page_limits(), count).slice();
    return { signals, limits };
  }
}

// --- runs ---

/**
 * Values at instants of a signal on an even grid, linear in between.
 * @param {Float64Array} values
 * @param {number} start
 * @param {number} step
 * @param {Float64Array} time
 */
function interpolated(values, start, step, time) {
  const last = values.length - 1;
  return time.map((instant) => {
    const at = Math.min(Math.max((instant - start) / step, 0), last);
    const row = Math.min(Math.floor(at), last - 1);
    return values[row] + (at - row) * (values[row + 1] - values[row]);
  });
}

/**
 * Speed of simulated positions through the filters that the measured positions went through.
 * @param {Float64Array} positions
 * @param {Float64Array} time
 */
function speedOf(positions, time) {
  const { low, high } = data.filter;
  const speed = new Float64Array(positions.length);
  let state = 0;
  for (let row = 1; row < positions.length; row++) {
    const interval = time[row] - time[row - 1];
    const first = Math.exp(-low * interval);
    const second = Math.exp(-high * interval);
    const passed = (high / (high - low)) * (first - second);
    const drive = (positions[row] - positions[row - 1]) / interval;
    speed[row] = second * speed[row - 1] + passed * state + (1 - second - passed) * drive;
    state = first * state + (1 - first) * drive;
  }
  return speed;
}

/** The samples of a channel, and how simulated signals are compared with them. */
class Measured {
  /** @param {ShownData & MeasuredData} channel */
  constructor(channel) {
    this.signal = channel.signal;
    this.also = channel.also;
    this.speed = channel.speed;
    this.ignored = channel.ignored;
    this.breaks = new Set(channel.breaks);
    this.stamps = unpacked(channel.time);
    /** As it is drawn. */
    this.line = unpacked(channel.measured);
    /** In SI. */
    this.values = this.line.map((value) => value / channel.factor);
    /** Whether a sample counts. */
    this.counts = Array.from(
      this.stamps,
      (instant) => !this.ignored.some(([from, to]) => instant >= from && instant <= to),
    );
  }

  /**
   * What the channel would have measured of simulated signals, SI.
   * @param {Signals} signals
   * @param {number} start
   * @param {number} step
   */
  seen(signals, start, step) {
    const values = interpolated(signals[this.signal], start, step, this.stamps);
    if (this.speed) return speedOf(values, this.stamps);
    if (!this.also) return values;
    const more = interpolated(signals[this.also], start, step, this.stamps);
    return values.map((value, row) => value + more[row]);
  }

  /**
   * Root of the mean squared error of the samples that count, and fit per cent.
   * @param {Float64Array} simulated
   * @returns {Errors}
   */
  error(simulated) {
    let count = 0;
    let squares = 0;
    let sum = 0;
    for (let row = 0; row < simulated.length; row++) {
      if (!this.counts[row]) continue;
      count++;
      squares += (simulated[row] - this.values[row]) ** 2;
      sum += this.values[row];
    }
    const mean = sum / count;
    let spread = 0;
    for (let row = 0; row < simulated.length; row++) {
      if (this.counts[row]) spread += (this.values[row] - mean) ** 2;
    }
    return { rmse: Math.sqrt(squares / count), fit: 100 * (1 - Math.sqrt(squares / spread)) };
  }
}

/** @typedef {ShownData & { measured: Measured | null }} Shown A signal that is shown. */

/** A run with its command and what is shown of it. */
class Run {
  /**
   * @param {RunData} run
   * @param {Float64Array[]} values Of its inputs, SI.
   */
  constructor(run, values) {
    this.name = run.name;
    this.role = run.role;
    this.start = run.start;
    this.step = run.step;
    this.steady = run.steady ?? false;
    this.inputs = run.inputs.map((input, which) => ({ ...input, values: values[which] }));
    this.grid = Float64Array.from(values[0], (_, row) => run.start + row * run.step);
    this.isMeasured = run.channels.length > 0;
    /** @type {Shown[]} */
    this.shown = this.isMeasured
      ? run.channels.map((channel) => ({ ...channel, measured: new Measured(channel) }))
      : data.unmeasured.map((signal) => ({ ...signal, measured: null }));
  }
}

// --- the page ---

/** A run as measured, as simulated at first and as simulated now. */
class LiveFigure extends Figure {
  /** @param {HTMLElement} stack */
  constructor(stack) {
    super(stack);
    /** @type {{ run: Run, now: Simulated, before: Simulated | null } | null} */
    this.showing = null;
    this.listens = false;
  }

  /**
   * Draw a run; all of it if it is another one.
   * @param {Run} run
   * @param {Simulated} now
   * @param {Simulated | null} before
   */
  show(run, now, before) {
    if (this.showing?.run !== run) this.view = null;
    this.showing = { run, now, before };
    this.draw();
  }

  begin() {
    this.all = this.load();
    this.view ??= this.all;
    if (!this.listens) this.listen();
    this.listens = true;
    return this.view;
  }

  /** @returns {Span} */
  load() {
    if (!this.showing) return [0, 1];
    const { grid } = this.showing.run;
    return [grid[0], grid[grid.length - 1]];
  }

  /**
   * Where limits act.
   * @param {Run} run
   * @param {Uint8Array} limits
   * @param {readonly string[]} shaded
   */
  spans({ grid, step }, limits, shaded) {
    const drawn = data.limits.filter(([, name]) => shaded.includes(name));
    /** @type {Map<string, number>} */
    const began = new Map();
    /** @type {Shade[]} */
    const spans = [];
    for (let row = 0; row <= grid.length; row++) {
      const acting = row < grid.length ? limits[row] : 0;
      if (row < grid.length && acting === (row ? limits[row - 1] : 0)) continue;
      for (const [bit, name] of drawn) {
        const from = began.get(name);
        if (acting & bit && from === undefined) began.set(name, grid[row] - 0.5 * step);
        else if (!(acting & bit) && from !== undefined) {
          spans.push([from, grid[row - 1] + 0.5 * step, name]);
          began.delete(name);
        }
      }
    }
    return spans;
  }

  /** @returns {Panel[]} */
  panels() {
    if (!this.showing) return [];
    const { run, now, before } = this.showing;
    /** @type {Set<number>} */
    const none = new Set();
    /** @type {Panel[]} */
    const panels = [];
    for (const { label, factor, shown, values } of run.inputs) {
      if (!shown) continue;
      const line = factor === 1 ? values : values.map((value) => value * factor);
      panels.push({
        kind: "input",
        label,
        time: run.grid,
        breaks: none,
        lines: [["input", line]],
      });
    }
    run.shown.forEach(({ measured, factor, label, residual, shaded }, number) => {
      // in the units that are shown, once for what stays: the run before, and all where the pointer reads
      /** @param {Simulated} simulated */
      const line = ({ lines, seen }) => {
        lines[number] ??= seen[number].map((value) => value * factor);
        return lines[number];
      };
      /** @type {Line[]} */
      const lines = [["simulated", line(now)]];
      if (before) lines.unshift(["before", line(before)]);
      const own = {
        time: measured?.stamps ?? run.grid,
        breaks: measured?.breaks ?? none,
        ignored: measured?.ignored,
      };
      const shades = this.spans(run, now.limits, shaded);
      if (measured) lines.unshift(["measured", measured.line]);
      panels.push({ ...own, kind: "overlay", label, shades, lines });
      if (!measured) return;
      const difference = line(now).map((value, row) => value - measured.line[row]);
      panels.push({ ...own, kind: "residual", label: residual, lines: [["residual", difference]] });
    });
    return panels;
  }
}

/** Sliders, the run that is chosen, and what all runs show. */
class Page {
  /**
   * @param {Machine} machine
   * @param {Run[]} runs
   */
  constructor(machine, runs) {
    this.machine = machine;
    this.runs = runs;
    this.choice = element("run", HTMLSelectElement);
    this.wrong = element("wrong", HTMLElement);
    this.toml = element("toml", HTMLElement);
    /** Values of the sliders by number. */
    this.values = new Map(data.parameters.map(({ number, value }) => [number, value]));
    /** Factors of the design variables by name. */
    this.factors = new Map(data.design_variables.map(({ name }) => [name, 1]));
    this.figure = new LiveFigure(element("figure", HTMLElement));
    this.figure.element.dataset.name = "run";
    /**
     * What puts the sliders where the values are.
     * @type {(() => void)[]}
     */
    this.placements = [];
    /** @type {Simulated | null} */
    this.latest = null;
    /** @type {number | undefined} */
    this.later = undefined;
    this.sliders();
    runs.forEach(({ name, role }, number) => {
      const words = `${name}${role === "validate" ? " (held out)" : ""}`;
      this.choice.append(new Option(words, String(number)));
    });
    this.listen();
    const first = runs.map((_, number) => this.found(number));
    /** The runs with the values at first, null for one that cannot be simulated. */
    this.before = first.map((run) => ("wrong" in run ? null : run));
    this.errors();
    this.update();
  }

  /** Follow buttons, keys and the size of the window. */
  listen() {
    this.choice.addEventListener("change", () => this.update());
    element("previous", HTMLButtonElement).addEventListener("click", () => this.turn(-1));
    element("next", HTMLButtonElement).addEventListener("click", () => this.turn(1));
    element("reset", HTMLButtonElement).addEventListener("click", () => this.reset());
    element("copy", HTMLButtonElement).addEventListener("click", () => {
      navigator.clipboard?.writeText(this.toml.textContent ?? "");
    });
    addEventListener("keydown", (event) => {
      const { target } = event;
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (target instanceof Element && target.matches("input[type=number], select")) return;
      if (event.key === "n") this.turn(1);
      if (event.key === "p") this.turn(-1);
      if (event.key === "r") this.reset();
    });
    addEventListener("resize", () => this.figure.draw());
  }

  /**
   * Choose another run.
   * @param {number} by How many runs farther.
   */
  turn(by) {
    const count = this.runs.length;
    this.choice.value = String((Number(this.choice.value) + by + count) % count);
    this.update();
  }

  /** Set all values as they were at first. */
  reset() {
    for (const { number, value } of data.parameters) this.values.set(number, value);
    for (const { name } of data.design_variables) this.factors.set(name, 1);
    this.place();
    this.update(true);
  }

  /** Every parameter as the sliders have it: its own value times the factors of design variables. */
  now() {
    const values = new Map(this.values);
    for (const { name, moves } of data.design_variables) {
      const factor = this.factors.get(name) ?? 1;
      for (const [number, power] of moves) {
        values.set(number, (values.get(number) ?? 0) * factor ** power);
      }
    }
    return values;
  }

  /** One slider for each design variable and parameter. */
  sliders() {
    const variables = element("design-variables", HTMLElement);
    for (const { name, words, range } of data.design_variables) {
      this.slider(variables, words, "×", range, {
        read: () => this.factors.get(name) ?? 1,
        write: (value) => this.factors.set(name, value),
      });
    }
    for (const { range, main, factor, number, words, unit } of data.parameters) {
      if (!range) continue;
      const parent = element(main ? "fitted" : "others", HTMLElement);
      this.slider(parent, words, unit, [range[0] * factor, range[1] * factor], {
        read: () => (this.values.get(number) ?? 0) * factor,
        write: (value) => this.values.set(number, value / factor),
      });
    }
    this.place();
  }

  /**
   * Add a slider, on a logarithmic scale if both ends are positive.
   * @param {HTMLElement} parent
   * @param {string} words
   * @param {string} unit
   * @param {[low: number, high: number]} ends
   * @param {{ read: () => number, write: (value: number) => void }} value
   */
  slider(parent, words, unit, [low, high], { read, write }) {
    const logarithmic = low > 0;
    /** @param {number} value */
    const place = (value) =>
      logarithmic ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);
    /** @param {number} part */
    const valueAt = (part) =>
      logarithmic ? low * (high / low) ** part : low + part * (high - low);
    const rounded = () => String(Number(read().toPrecision(4)));
    const row = created("label", { className: "slider" });
    const name = created("span", { textContent: words });
    const range = created("input", { type: "range", min: "0", max: "1", step: "0.001" });
    const number = created("input", { type: "number", step: "any" });
    range.setAttribute("aria-label", words);
    number.setAttribute("aria-label", `${words}, value`);
    row.append(name, number, created("span", { textContent: unit, className: "unit" }), range);
    range.addEventListener("input", () => {
      write(valueAt(Number(range.value)));
      number.value = rounded();
      this.update(true);
    });
    number.addEventListener("change", () => {
      if (number.value === "" || !Number.isFinite(Number(number.value))) {
        this.place();
        return;
      }
      write(Number(number.value));
      range.value = String(place(read()));
      this.update(true);
    });
    this.placements.push(() => {
      range.value = String(place(read()));
      number.value = rounded();
    });
    parent.append(row);
  }

  /** Put all sliders where their values are. */
  place() {
    for (const place of this.placements) place();
  }

  /**
   * A run with the present values, seen by its channels; without channels, the signals themselves.
   * @param {number} number
   * @returns {Simulated | Refusal}
   */
  found(number) {
    const run = this.runs[number];
    const simulated = this.machine.simulate(run);
    if ("wrong" in simulated) return simulated;
    const { signals, limits } = simulated;
    const seen = run.shown.map(
      ({ measured, signal }) => measured?.seen(signals, run.start, run.step) ?? signals[signal],
    );
    const errors = run.shown.map(({ measured }, index) => measured?.error(seen[index]) ?? null);
    return { signals, limits, seen, errors, lines: [] };
  }

  /** Simulate and show the run that is chosen, perhaps with other values. */
  update(values = false) {
    const began = performance.now();
    const number = Number(this.choice.value || 0);
    const wrong = values ? this.machine.set(this.now()) : "";
    const now = wrong ? { wrong } : this.found(number);
    const sentence = "wrong" in now ? now.wrong : "";
    this.wrong.textContent = sentence;
    this.wrong.hidden = !sentence;
    if ("wrong" in now) return;
    this.latest = now;
    this.figure.show(this.runs[number], now, this.before[number]);
    this.measures(number, now);
    this.changes();
    const taken = performance.now() - began;
    document.body.dataset.milliseconds = taken.toFixed(2);
    clearTimeout(this.later);
    this.later = setTimeout(() => this.errors(), 150);
  }

  /**
   * The errors of a run, now and before.
   * @param {number} number
   * @param {Simulated} now
   */
  measures(number, now) {
    /** @type {HTMLElement[]} */
    const rows = [];
    this.runs[number].shown.forEach(({ name, unit, factor }, index) => {
      /** @param {Errors} errors */
      const words = ({ rmse, fit }) =>
        `RMSE ${digits(rmse * factor, 3)} ${unit}, fit ${fit.toFixed(2)} %`;
      const errors = now.errors[index];
      const before = this.before[number]?.errors[index];
      if (!errors) return;
      const row = document.createElement("p");
      row.append(created("b", { textContent: name }), ` ${words(errors)}`);
      if (before) {
        row.append(created("span", { textContent: ` · ${data.before}: ${words(before)}` }));
      }
      rows.push(row);
    });
    element("measures", HTMLElement).replaceChildren(...rows);
  }

  /** The lines of the drive's file that other values have. */
  changes() {
    const values = this.now();
    const changed = data.parameters.filter(({ number, value }) => values.get(number) !== value);
    element("copied", HTMLElement).hidden = !changed.length;
    if (data.as_options) {
      const options = changed.map(({ column, number }) => `--set ${column}=${values.get(number)}`);
      this.toml.textContent = options.join(" ");
      return;
    }
    /** @type {Map<string, Set<string>>} */
    const blocks = new Map();
    for (const { block, symbol } of changed) {
      blocks.set(block, (blocks.get(block) ?? new Set()).add(symbol));
    }
    const lines = [];
    for (const [block, symbols] of blocks) {
      lines.push(`[${block}]`);
      for (const symbol of symbols) {
        const own = data.parameters.filter((parameter) => parameter.symbol === symbol);
        const numbers = own.map(({ number }) => values.get(number)).join(", ");
        const value = own.length > 1 ? `[${numbers}]` : numbers;
        lines.push(`${symbol} = { value = ${value}, unit = "${own[0].si}", status = "user" }`);
      }
      lines.push("");
    }
    this.toml.textContent = lines.join("\n").trim();
  }

  /** The table of all runs, now and before. */
  errors() {
    if (!this.runs.some((run) => run.isMeasured)) return;
    const rows = this.runs.map((run, number) => {
      const last = run.shown.length - 1;
      const now = this.found(number);
      const before = this.before[number]?.errors[last];
      const row = document.createElement("tr");
      row.append(created("th", { textContent: run.name, scope: "row" }));
      const errors = "wrong" in now ? null : now.errors[last];
      if (before && errors) {
        const fits = { before: `${before.fit.toFixed(2)} %`, now: `${errors.fit.toFixed(2)} %` };
        row.append(created("td", { textContent: fits.before, className: "n" }));
        row.append(created("td", { textContent: fits.now, className: comparison(errors, before) }));
      } else {
        row.append(created("td", { textContent: "wrong" in now ? now.wrong : "", className: "" }));
      }
      row.addEventListener("click", () => {
        this.choice.value = String(number);
        this.update();
      });
      return row;
    });
    element("runs", HTMLElement).replaceChildren(...rows);
  }
}

/**
 * The class of a cell that says whether errors have become smaller.
 * @param {Errors} now
 * @param {Errors} before
 */
function comparison(now, before) {
  const change = now.rmse - before.rmse;
  if (Math.abs(change) < 1e-9 * before.rmse) return "n";
  return change < 0 ? "n better" : "n worse";
}

/** Compile the drive, unpack the runs, and make the page. */
async function begin() {
  const machine = await WebAssembly.instantiate(decoded(data.wasm), {});
  const channels = data.runs.flatMap((run) => run.channels);
  await inflate(channels.flatMap(({ time, measured }) => [time, measured]));
  const runs = await Promise.all(
    data.runs.map(async (run) => {
      const packed = await Promise.all(run.inputs.map(({ values }) => inflated(values)));
      return new Run(run, packed.map(samples));
    }),
  );
  const exports = /** @type {MachineExports} */ (/** @type {unknown} */ (machine.instance.exports));
  // for whoever looks into the page by the browser's console
  Object.assign(globalThis, { live: new Page(new Machine(exports), runs) });
  document.body.dataset.ready = "yes";
}

/**
 * Numbers of four bytes each, of which all lowest bytes came first.
 * @param {Uint8Array} planes
 */
function samples(planes) {
  const count = planes.length / 4;
  const bytes = new Uint8Array(planes.length);
  for (let plane = 0; plane < 4; plane++) {
    for (let row = 0; row < count; row++) bytes[4 * row + plane] = planes[plane * count + row];
  }
  return Float64Array.from(new Float32Array(bytes.buffer));
}

begin().catch((error) => {
  const wrong = element("wrong", HTMLElement);
  wrong.hidden = false;
  wrong.textContent = `The drive cannot run in this browser: ${error.message}`;
  throw error;
});

// The live page: the drive as WebAssembly, sliders for its parameters, measured and simulated curves over each run.

const data = JSON.parse(document.getElementById("live").textContent);
const bytes = (words) => Uint8Array.from(atob(words), (letter) => letter.charCodeAt(0));
const $ = (name) => document.getElementById(name);
const digits = (value, count = 4) => {
  const [head, power] = Number(value).toPrecision(count).replace("-", "−").split("e");
  return power ? `${head}·10^${Number(power)}`.replace("-", "−") : head;
};

// --- the drive ---

/** A drive of the compiled source: parameters by number, and runs over a voltage on an even grid. */
class Machine {
  constructor(exports) {
    this.c = exports;
    const values = new Float64Array(bytes(data.values).buffer);
    new Float64Array(
      this.c.memory.buffer,
      this.c.swp_page_values(values.length),
      values.length,
    ).set(values);
    const wrong = this.sentence(this.c.swp_page_init(values.length));
    if (wrong) throw new Error(wrong);
  }

  get(number) {
    return this.c.swp_page_get(number);
  }

  /** Set values, [[number, value], ...]; empty, or the sentence that says what is wrong. */
  set(values) {
    for (const [number, value] of values) {
      const wrong = this.c.swp_page_set(number, value);
      if (wrong) return this.sentence(wrong);
    }
    return this.sentence(this.c.swp_page_update());
  }

  sentence(status) {
    if (!status) return "";
    const memory = new Uint8Array(this.c.memory.buffer, this.c.swp_page_sentence(status));
    return new TextDecoder().decode(memory.subarray(0, memory.indexOf(0)));
  }

  /** Signals (by name) over a run, and its limits, a byte a sample; or what is wrong. */
  simulate(run) {
    const { voltage, step, steady } = run;
    // what the run's channels are compared with, and the speed
    const names = new Set([
      "shaft_speed",
      ...run.shown.flatMap((each) => [each.signal, each.also]),
    ]);
    const wanted = data.outputs.filter(({ name }) => names.has(name));
    const wrong = this.c.swp_page_begin(voltage.length, step, wanted.length);
    if (wrong) return { wrong: this.sentence(wrong) };
    wanted.forEach(({ number }, k) => this.c.swp_page_select(k, number));
    new Float64Array(this.c.memory.buffer, this.c.swp_page_input(0), voltage.length).set(voltage);
    const status = this.c.swp_page_run(steady ? 1 : 0);
    if (status) return { wrong: this.sentence(status) };
    const of = (k) =>
      new Float64Array(this.c.memory.buffer, this.c.swp_page_row(k), voltage.length);
    const signals = Object.fromEntries(wanted.map(({ name }, k) => [name, of(k).slice()]));
    const limits = new Uint8Array(
      this.c.memory.buffer,
      this.c.swp_page_limits(),
      voltage.length,
    ).slice();
    return { signals, limits };
  }
}

// --- runs ---

/** Values at instants of a signal on an even grid, linear in between. */
function interpolated(values, start, step, time) {
  const last = values.length - 1;
  return time.map((instant) => {
    const at = Math.min(Math.max((instant - start) / step, 0), last);
    const row = Math.min(Math.floor(at), last - 1);
    return values[row] + (at - row) * (values[row + 1] - values[row]);
  });
}

/** Speed of simulated positions through the filters that the measured positions went through. */
function speedOf(positions, time) {
  const { low, high } = data.filter;
  const made = new Float64Array(positions.length);
  let state = 0;
  for (let row = 1; row < positions.length; row++) {
    const interval = time[row] - time[row - 1];
    const [first, second] = [Math.exp(-low * interval), Math.exp(-high * interval)];
    const passed = (high / (high - low)) * (first - second);
    const drive = (positions[row] - positions[row - 1]) / interval;
    made[row] = second * made[row - 1] + passed * state + (1 - second - passed) * drive;
    state = first * state + (1 - first) * drive;
  }
  return made;
}

class Run {
  constructor(given) {
    Object.assign(this, given);
    this.voltage = Float64Array.from(new Float32Array(given.volts.buffer));
    this.grid = Float64Array.from(this.voltage, (_, row) => this.start + row * this.step);
    for (const each of this.channels) {
      each.stamps = unpacked(each.time);
      each.breaks = new Set(each.breaks);
      each.values = unpacked(each.measured).map((value) => value / each.factor);
      each.counts = each.stamps.map((t) =>
        each.ignored.some(([from, to]) => t >= from && t <= to) ? 0 : 1,
      );
    }
  }

  /** What a channel would have measured of simulated signals, SI. */
  seen(channel, signals) {
    const of = (name) => interpolated(signals[name], this.start, this.step, channel.stamps);
    if (channel.speed) return speedOf(of(channel.signal), channel.stamps);
    const values = of(channel.signal);
    if (!channel.also) return values;
    const more = of(channel.also);
    return values.map((value, row) => value + more[row]);
  }

  /** Root of the mean squared error of the samples that count, and fit per cent. */
  error(channel, simulated) {
    let [n, sum, mean, square] = [0, 0, 0, 0];
    for (let row = 0; row < simulated.length; row++)
      if (channel.counts[row]) {
        n++;
        sum += (simulated[row] - channel.values[row]) ** 2;
        mean += channel.values[row];
      }
    mean /= n;
    for (let row = 0; row < simulated.length; row++)
      if (channel.counts[row]) square += (channel.values[row] - mean) ** 2;
    return { rmse: Math.sqrt(sum / n), fit: 100 * (1 - Math.sqrt(sum / square)) };
  }
}

// --- the page ---

class LiveFigure extends Figure {
  show(run, now, before) {
    if (this.showing !== run) [this.showing, this.view] = [run, null];
    Object.assign(this, { now, before });
    this.draw();
  }

  begin() {
    if (!this.view) this.view = this.load();
    this.all = this.load();
    if (!this.listens) this.listen();
    this.listens = true;
  }

  load() {
    const { grid } = this.showing;
    return [grid[0], grid.at(-1)];
  }

  spans(shaded) {
    const { grid, step } = this.showing;
    const { limits } = this.now;
    const wanted = data.limits.filter(([, name]) => shaded.includes(name));
    const from = new Map();
    const made = [];
    for (let row = 0; row <= grid.length; row++) {
      const acting = row < grid.length ? limits[row] : 0;
      if (row < grid.length && acting === (row ? limits[row - 1] : 0)) continue;
      for (const [bit, name] of wanted) {
        if (acting & bit && !from.has(name)) from.set(name, grid[row] - 0.5 * step);
        else if (!(acting & bit) && from.has(name)) {
          made.push([from.get(name), grid[row - 1] + 0.5 * step, name]);
          from.delete(name);
        }
      }
    }
    return made;
  }

  panels() {
    const { showing: run, now, before } = this;
    const none = new Set();
    const made = [
      [{ time: run.grid, breaks: none, lines: [["input", run.voltage]] }, "input", "command\n(V)"],
    ];
    // in the units that are shown, once for what stays: the run before, and all where the pointer reads
    const line = (each, found) =>
      ((found.lines ??= [])[each] ??= found.seen[each].map(
        (value) => value * run.shown[each].factor,
      ));
    run.shown.forEach((each, k) => {
      const lines = [
        ["before", line(k, before)],
        ["simulated", line(k, now)],
      ];
      const own = {
        time: each.stamps ?? run.grid,
        breaks: each.breaks ?? none,
        ignored: each.ignored,
        shades: this.spans(each.shaded),
      };
      if (each.values) {
        const measured = (each.line ??= each.values.map((value) => value * each.factor));
        made.push([{ ...own, lines: [["measured", measured], ...lines] }, "overlay", each.label]);
        const residual = lines[1][1].map((value, row) => value - measured[row]);
        made.push([
          { ...own, shades: [], lines: [["residual", residual]] },
          "residual",
          each.residual,
        ]);
      } else made.push([{ ...own, lines }, "overlay", each.label]);
    });
    return made;
  }
}

class Page {
  constructor(machine) {
    this.machine = machine;
    this.values = new Map(data.parameters.map((each) => [each.number, each.value]));
    this.factors = new Map(data.levers.map((each) => [each.name, 1]));
    this.figure = new LiveFigure($("figure"));
    this.figure.element.dataset.name = "run";
    this.sliders();
    const names = data.runs.map((each) => each.name);
    $("run").append(
      ...names.map(
        (name, k) =>
          new Option(`${name}${data.runs[k].role === "validate" ? " (held out)" : ""}`, k),
      ),
    );
    $("run").addEventListener("change", () => this.update());
    for (const [id, turn] of [
      ["previous", -1],
      ["next", 1],
    ])
      $(id).addEventListener("click", () => this.turn(turn));
    $("reset").addEventListener("click", () => this.reset());
    $("copy").addEventListener("click", () =>
      navigator.clipboard?.writeText($("toml").textContent),
    );
    addEventListener("keydown", (event) => {
      if (
        event.target.matches("input[type=number], select") ||
        event.ctrlKey ||
        event.metaKey ||
        event.altKey
      )
        return;
      const acts = { n: () => this.turn(1), p: () => this.turn(-1), r: () => this.reset() }[
        event.key
      ];
      if (acts) acts();
    });
    addEventListener("resize", () => this.figure.draw());
    this.before = data.runs.map(() => null);
    data.runs.forEach((_, k) => (this.before[k] = this.found(k)));
    this.errors();
    this.update();
  }

  turn(by) {
    const count = data.runs.length;
    $("run").value = (Number($("run").value) + by + count) % count;
    this.update();
  }

  reset() {
    for (const each of data.parameters) this.values.set(each.number, each.value);
    for (const each of data.levers) this.factors.set(each.name, 1);
    this.place();
    this.update(true);
  }

  /** Every parameter as the sliders have it: its own value, times the levers that move it. */
  now() {
    const made = new Map(this.values);
    for (const lever of data.levers) {
      for (const [number, power] of lever.moves)
        made.set(number, made.get(number) * this.factors.get(lever.name) ** power);
    }
    return made;
  }

  changed() {
    const now = this.now();
    return data.parameters
      .filter(({ number, value }) => now.get(number) !== value)
      .map((each) => [each, now.get(each.number)]);
  }

  /** One slider for each lever and parameter, on a logarithmic scale where both ends are positive. */
  sliders() {
    this.inputs = [];
    const add = (parent, words, unit, [low, high], read, write) => {
      const log = low > 0;
      const place = (value) =>
        log ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);
      const value = (part) => (log ? low * (high / low) ** part : low + part * (high - low));
      const row = document.createElement("label");
      row.className = "slider";
      const name = Object.assign(document.createElement("span"), { textContent: words });
      const range = Object.assign(document.createElement("input"), {
        type: "range",
        min: 0,
        max: 1,
        step: 0.001,
      });
      const number = Object.assign(document.createElement("input"), {
        type: "number",
        step: "any",
      });
      range.setAttribute("aria-label", words);
      number.setAttribute("aria-label", `${words}, value`);
      const of = Object.assign(document.createElement("span"), {
        textContent: unit,
        className: "unit",
      });
      row.append(name, number, of, range);
      range.addEventListener("input", () => {
        write(value(Number(range.value)));
        number.value = Number(read().toPrecision(4));
        this.update(true);
      });
      number.addEventListener("change", () => {
        if (number.value === "" || !Number.isFinite(Number(number.value))) return this.place();
        write(Number(number.value));
        range.value = place(read());
        this.update(true);
      });
      this.inputs.push(() => {
        range.value = place(read());
        number.value = Number(read().toPrecision(4));
      });
      parent.append(row);
    };
    for (const lever of data.levers) {
      const { name, words, range } = lever;
      add(
        $("levers"),
        words,
        "×",
        range,
        () => this.factors.get(name),
        (value) => this.factors.set(name, value),
      );
    }
    for (const each of data.parameters) {
      if (!each.range) continue;
      const scale = each.factor;
      const parent = $(each.main ? "fitted" : "others");
      add(
        parent,
        each.words,
        each.unit,
        each.range.map((end) => end * scale),
        () => this.values.get(each.number) * scale,
        (value) => this.values.set(each.number, value / scale),
      );
    }
    this.place();
  }

  place() {
    for (const each of this.inputs) each();
  }

  /** A run with the present values, seen by its channels; without channels, the speed itself. */
  found(number) {
    const run = data.runs[number];
    const made = this.machine.simulate(run);
    if (made.wrong) return made;
    const seen = run.shown.map((each) =>
      each.values ? run.seen(each, made.signals) : made.signals[each.signal],
    );
    const errors = run.shown.map((each, k) => (each.values ? run.error(each, seen[k]) : null));
    return { ...made, seen, errors };
  }

  update(values = false) {
    const began = performance.now();
    const number = Number($("run").value || 0);
    let wrong = "";
    if (values) wrong = this.machine.set(this.now());
    const now = wrong ? { wrong } : this.found(number);
    $("wrong").textContent = now.wrong ?? "";
    $("wrong").hidden = !now.wrong;
    if (now.wrong) return;
    this.latest = now;
    this.figure.show(data.runs[number], now, this.before[number]);
    this.words(number, now);
    const taken = performance.now() - began;
    document.body.dataset.milliseconds = taken.toFixed(2);
    clearTimeout(this.later);
    this.later = setTimeout(() => this.errors(), 150);
  }

  words(number, now) {
    const run = data.runs[number];
    $("measures").replaceChildren(
      ...run.shown.flatMap((each, k) => {
        if (!each.values) return [];
        const words = ({ rmse, fit }) =>
          `RMSE ${digits(rmse * each.factor, 3)} ${each.unit}, fit ${fit.toFixed(2)} %`;
        const row = document.createElement("p");
        row.append(
          Object.assign(document.createElement("b"), { textContent: each.name }),
          ` ${words(now.errors[k])}`,
        );
        row.append(
          Object.assign(document.createElement("span"), {
            textContent: ` · ${data.before}: ${words(this.before[number].errors[k])}`,
          }),
        );
        return [row];
      }),
    );
    const changed = this.changed();
    const blocks = new Map();
    for (const [each] of changed)
      blocks.set(each.block, [...(blocks.get(each.block) ?? []), each.symbol]);
    const values = this.now();
    const lines = [...blocks].flatMap(([block, symbols]) => [
      `[${block}]`,
      ...[...new Set(symbols)].map((symbol) => {
        const own = data.parameters.filter((each) => each.symbol === symbol);
        const numbers = own.map((each) => values.get(each.number));
        return `${symbol} = { value = ${own.length > 1 ? `[${numbers.join(", ")}]` : numbers[0]}, unit = "${own[0].si}", status = "user" }`;
      }),
      "",
    ]);
    $("toml").textContent = lines.join("\n").trim();
    $("copied").hidden = !changed.length;
  }

  /** The table of all runs, now and before. */
  errors() {
    if (!data.runs.some((run) => run.channels.length)) return;
    const rows = data.runs.map((run, k) => {
      const last = run.shown.length - 1;
      const now = this.found(k);
      const row = document.createElement("tr");
      const before = this.before[k].errors?.[last];
      const cell = (words, look = "n") =>
        Object.assign(document.createElement("td"), { textContent: words, className: look });
      const head = Object.assign(document.createElement("th"), {
        textContent: run.name,
        scope: "row",
      });
      if (!before || now.wrong) row.append(head, cell(now.wrong ?? "", ""));
      else {
        const better = now.errors[last].rmse - before.rmse;
        const look =
          Math.abs(better) < 1e-9 * before.rmse ? "n" : better < 0 ? "n better" : "n worse";
        row.append(
          head,
          cell(`${before.fit.toFixed(2)} %`),
          cell(`${now.errors[last].fit.toFixed(2)} %`, look),
        );
      }
      row.addEventListener("click", () => {
        $("run").value = k;
        this.update();
      });
      return row;
    });
    $("runs").replaceChildren(...rows);
  }
}

async function begin() {
  const machine = await WebAssembly.instantiate(bytes(data.wasm), {});
  const packs = data.runs.flatMap((run) =>
    run.channels.flatMap((each) => [each.time, each.measured]),
  );
  await Promise.all(packs.map(async (each) => (each.bytes = await inflated(each.code))));
  await Promise.all(
    data.runs.map(async (each) => (each.volts = planes(await inflated(each.voltage)))),
  );
  data.runs = data.runs.map((each) => new Run(each));
  for (const run of data.runs) run.shown = run.channels.length ? run.channels : data.unmeasured;
  globalThis.live = new Page(new Machine(machine.instance.exports));
  document.body.dataset.ready = "yes";
}

/** Four-byte numbers whose lowest bytes came first. */
function planes(bytes) {
  const count = bytes.length / 4;
  const made = new Uint8Array(bytes.length);
  for (let plane = 0; plane < 4; plane++)
    for (let row = 0; row < count; row++) made[4 * row + plane] = bytes[plane * count + row];
  return made;
}

begin().catch((error) => {
  $("wrong").hidden = false;
  $("wrong").textContent = `The drive cannot run in this browser: ${error.message}`;
  throw error;
});

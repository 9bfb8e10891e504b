// The page of a report: its runs drawn as the reader comes near, folded details opened, contents marked.

/**
 * Signals of one clock, as `runs.run_data` of Python writes them.
 * @typedef {object} PackedSignals
 * @property {Packed} time
 * @property {number[]} breaks Rows after which a line is broken.
 * @property {Packed[]} signals Of the input itself; of a channel what was simulated, and the residual.
 */

/**
 * A channel with what was simulated of it.
 * @typedef {PackedSignals & { ratio: number, ignored: Span[] }} PackedChannel
 */

/**
 * A run, as `runs.run_data` of Python writes it.
 * @typedef {object} PackedRun
 * @property {boolean} held Whether the input is held between two stamps.
 * @property {PackedSignals} input
 * @property {PackedChannel[]} channels
 */

/** @typedef {Omit<Panel, "kind" | "label">} Curves What a panel draws, before its words are known. */

/** Width of a figure on paper. */
const PRINTED = 450;

/** @type {PackedRun[]} */
const runs = [...document.querySelectorAll("script[id^=samples]")].map((element) =>
  JSON.parse(element.textContent ?? ""),
);
const packedSignals = runs.flatMap((run) => [run.input, ...run.channels]);
const ready = inflate(packedSignals.flatMap(({ time, signals }) => [time, ...signals]));

/**
 * Curves of a run: the input, and of each channel what was measured and simulated, and the residual.
 * @param {number} number
 */
function samples(number) {
  const run = runs[number];
  /** @param {PackedSignals} signals */
  const clock = ({ time, breaks }) => ({ time: unpacked(time), breaks: new Set(breaks) });
  /** @type {Curves} */
  const input = {
    ...clock(run.input),
    held: run.held,
    lines: [["input", unpacked(run.input.signals[0])]],
  };
  const channels = run.channels.map((channel) => {
    const own = { ...clock(channel), ignored: channel.ignored };
    const [simulated, residual] = channel.signals.map(unpacked);
    const measured = simulated.map((value, row) => value - channel.ratio * residual[row]);
    /** @type {Curves} */
    const overlay = {
      ...own,
      lines: [
        ["measured", measured],
        ["simulated", simulated],
      ],
    };
    /** @type {Curves} */
    const difference = { ...own, lines: [["residual", residual]] };
    return { overlay, residual: difference };
  });
  const clocks = [input, ...channels.map(({ overlay }) => overlay)]
    .map(({ time }) => time)
    .filter((time) => time.length);
  const start = Math.min(...clocks.map((time) => time[0]));
  const end = Math.max(...clocks.map((time) => time[time.length - 1]));
  /** @type {Span} */
  const all = [start, end > start ? end : start + 1];
  return { input, channels, all };
}

/** All panels of a run, or one channel alone, as the element's data say. */
class RunFigure extends Figure {
  /** @param {HTMLElement} element */
  constructor(element) {
    super(element);
    const { labels, channel, run } = element.dataset;
    /** @type {[input: string, ...channels: [signal: string, residual: string][]]} */
    const [input, ...channels] = JSON.parse(labels ?? "[]");
    this.inputLabel = input;
    this.channelLabels = channels;
    this.number = Number(run);
    /**
     * The channel that is shown alone, null for all.
     * @type {number | null}
     */
    this.channel = channel === undefined ? null : Number(channel);
    /** @type {ReturnType<typeof samples> | null} */
    this.run = null;
  }

  get zooms() {
    return this.channel === null;
  }

  load() {
    this.run = samples(this.number);
    return this.run.all;
  }

  panels() {
    if (!this.run) return [];
    const { input, channels } = this.run;
    const alone = this.channel;
    /** @type {Panel[]} */
    const panels = [];
    if (alone === null) panels.push({ ...input, kind: "input", label: this.inputLabel });
    channels.forEach(({ overlay, residual }, number) => {
      if (alone !== null && alone !== number) return;
      const [signal, difference] = this.channelLabels[number];
      panels.push({ ...overlay, kind: "overlay", label: signal });
      if (alone === null) panels.push({ ...residual, kind: "residual", label: difference });
    });
    return panels;
  }
}

// What the reader comes near is drawn; all of it for paper, where nobody scrolls.

/** @type {NodeListOf<HTMLElement>} */
const stacks = document.querySelectorAll(".stack");
/** @type {Map<Element, RunFigure>} */
const figures = new Map([...stacks].map((stack) => [stack, new RunFigure(stack)]));
const near = new IntersectionObserver(
  (entries) => {
    for (const { isIntersecting, target } of entries) {
      const figure = figures.get(target);
      if (isIntersecting && figure && !figure.width) figure.draw();
    }
  },
  { rootMargin: "600px" },
);
// in a frame of its own: drawing changes the height, which is observed, too
const sized = new ResizeObserver((entries) =>
  requestAnimationFrame(() => {
    if (matchMedia("print").matches) return;
    for (const { target } of entries) {
      const figure = figures.get(target);
      if (figure?.width && figure.width !== target.clientWidth) figure.draw();
    }
  }),
);

/**
 * Draw all runs.
 * @param {number} [width]
 */
function drawAll(width) {
  for (const figure of figures.values()) figure.draw(width);
}

/** Draw what the reader sees, and watch for the rest. */
function start() {
  for (const [stack, figure] of figures) {
    if (stack.getBoundingClientRect().top < innerHeight) figure.draw();
    near.observe(stack);
    sized.observe(stack);
  }
  addEventListener("beforeprint", () => drawAll(PRINTED));
  addEventListener("afterprint", () => drawAll());
  if (location.hash === "#all") drawAll();
}

// A browser without a window prints at the load event, which a document still open holds up.
const hold = document.createElement("iframe");
hold.hidden = true;
document.body.append(hold);
hold.contentDocument?.open();
ready.then(start).finally(() => {
  hold.contentDocument?.close();
  hold.remove();
});

/** Open the folded details that a link leads into. */
function unfold() {
  const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  let details = target?.closest("details");
  while (details) {
    details.open = true;
    details = details.parentElement?.closest("details");
  }
  target?.scrollIntoView();
}
addEventListener("hashchange", unfold);
if (location.hash) unfold();
// paper shows them all
/** @type {NodeListOf<HTMLDetailsElement>} */
const folded = document.querySelectorAll("details:not([open])");
addEventListener("beforeprint", () => {
  for (const details of folded) details.open = true;
});

// The contents mark where the reader is.
/** @type {NodeListOf<HTMLAnchorElement>} */
const anchors = document.querySelectorAll("nav a");
const links = new Map([...anchors].map((anchor) => [anchor.hash.slice(1), anchor]));
const here = new IntersectionObserver(
  (entries) => {
    for (const { target, isIntersecting } of entries) {
      links.get(target.id)?.classList.toggle("here", isIntersecting);
    }
  },
  { rootMargin: "-10% 0px -70%" },
);
for (const id of links.keys()) {
  const section = document.getElementById(id);
  if (section) here.observe(section);
}

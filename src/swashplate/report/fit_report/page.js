// The page of a report: its runs drawn as the reader comes near, folded details opened, contents marked.

const runs = [...document.querySelectorAll("script[id^=samples]")].map((each) =>
  JSON.parse(each.textContent),
);
const packed = runs
  .flatMap((run) => [run.input, ...run.channels])
  .flatMap((each) => [each.time, ...each.signals]);
const ready = Promise.all(packed.map(async (each) => (each.bytes = await inflated(each.code))));

/** Signals of a run: the input, then of each channel what was simulated and measured, and the residual. */
function samples(number) {
  const run = runs[number];
  const clock = (each) => ({ time: unpacked(each.time), breaks: new Set(each.breaks) });
  const input = {
    ...clock(run.input),
    held: run.held,
    lines: [["input", unpacked(run.input.signals[0])]],
  };
  const channels = run.channels.map((each) => {
    const own = { ...clock(each), ignored: each.ignored };
    const [simulated, residual] = each.signals.map(unpacked);
    const measured = simulated.map((value, row) => value - each.ratio * residual[row]);
    return {
      overlay: {
        ...own,
        lines: [
          ["measured", measured],
          ["simulated", simulated],
        ],
      },
      residual: { ...own, lines: [["residual", residual]] },
    };
  });
  const ends = [input, ...channels.map((each) => each.overlay)].filter((each) => each.time.length);
  const start = Math.min(...ends.map((each) => each.time[0]));
  const end = Math.max(...ends.map((each) => each.time.at(-1)));
  return { input, channels, all: [start, end > start ? end : start + 1] };
}

class RunFigure extends Figure {
  constructor(element) {
    super(element);
    this.labels = JSON.parse(element.dataset.labels);
    this.brief = element.dataset.channel === undefined ? null : Number(element.dataset.channel);
  }

  get zooms() {
    return this.brief === null;
  }

  load() {
    this.run = samples(this.element.dataset.run);
    return this.run.all;
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
}

// What the reader comes near is drawn; all of it for paper, where nobody scrolls.
const figures = new Map(
  [...document.querySelectorAll(".stack")].map((each) => [each, new RunFigure(each)]),
);
const near = new IntersectionObserver(
  (seen) => {
    for (const each of seen) {
      if (!each.isIntersecting || each.target.dataset.drawn) continue;
      figures.get(each.target).draw();
    }
  },
  { rootMargin: "600px" },
);
// in a frame of its own: drawing changes the height, which is observed, too
const sized = new ResizeObserver((seen) =>
  requestAnimationFrame(() => {
    for (const { target } of seen) {
      const figure = figures.get(target);
      if (figure.width && figure.width !== target.clientWidth && !matchMedia("print").matches)
        figure.draw();
    }
  }),
);
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
  for (let each = target?.closest("details"); each; each = each.parentElement.closest("details"))
    each.open = true;
  target?.scrollIntoView();
};
addEventListener("hashchange", opened);
if (location.hash) opened();
const folded = [...document.querySelectorAll("details:not([open])")];
addEventListener("beforeprint", () => folded.forEach((each) => (each.open = true)));

// The contents mark where the reader is.
const links = new Map([...document.querySelectorAll("nav a")].map((a) => [a.hash.slice(1), a]));
const here = new IntersectionObserver(
  (seen) => {
    for (const each of seen)
      links.get(each.target.id)?.classList.toggle("here", each.isIntersecting);
  },
  { rootMargin: "-10% 0px -70%" },
);
for (const id of links.keys()) here.observe(document.getElementById(id));

// The scene of a crane: ship, boom and load as they move, and the swing of all runs over time.

/**
 * A run, as `pages._pictures` of Python writes it.
 * @typedef {object} PicturedRun
 * @property {string} name
 * @property {boolean} ideal Whether its drives have no limits.
 * @property {string} code Rows of pictures, numbers of four bytes in base64.
 */

/**
 * All that `pages.write_scene` of Python hands over. Lengths are in m, angles in rad.
 * @typedef {object} SceneData
 * @property {number} step Time between two pictures, in s.
 * @property {number} slew Angle of the boom over the ship where the shaft of the slew is at 0.
 * @property {[number, number, number]} axis Where the crane's axis meets the pivot's height.
 * @property {number} foot Reach of the boom's foot.
 * @property {[ahead: number, above: number]} sheave Place of the sheave about the foot.
 * @property {number} columns Numbers of a picture.
 * @property {PicturedRun[]} runs
 */

/** @typedef {readonly [x: number, y: number, z: number]} Point In m. */

/**
 * Columns of a picture, as `pages.COLUMNS` of Python has them; the ship's six motions come last.
 * @readonly
 */
const COLUMN = {
  tip: 0,
  load: 3,
  slew: 6,
  pull: 7,
  rope: 8,
  hoist: 9,
  slewing: 10,
  luff: 11,
  ship: 12,
};
const COLORS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7"];
const DEGREES = 180 / Math.PI;
const HULL = { ahead: 92, astern: -102, half: 11.6, deck: 7, keel: -3 };
/** Seconds for which the load leaves a trail. */
const TRAIL = 12;
/** @type {readonly [name: string, column: number][]} */
const LIMITS = [
  ["luff", COLUMN.luff],
  ["slew", COLUMN.slewing],
  ["hoist", COLUMN.hoist],
];
/** Bits of a limit: the orifice, and the stop of the swash plate. */
const ORIFICE = 2;
const STOP = 8;
/** Room at the left of the chart, for its words. */
const MARGIN = 34;

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

/** @type {SceneData} */
const data = JSON.parse(element("data", HTMLScriptElement).text);
const scene = element("scene", HTMLCanvasElement);
const chart = element("chart", HTMLCanvasElement);
const slider = element("time", HTMLInputElement);
const play = element("play", HTMLButtonElement);
/** @type {HTMLButtonElement[]} */
const names = [...document.querySelectorAll("button")].filter((button) => "run" in button.dataset);

/** The pictures of a run. */
class Pictures {
  /** @param {PicturedRun} run */
  constructor({ code, ideal }) {
    this.ideal = ideal;
    const bytes = Uint8Array.from(atob(code), (letter) => letter.charCodeAt(0));
    const view = new DataView(bytes.buffer);
    const size = bytes.length / 4;
    this.numbers = Float32Array.from({ length: size }, (_, n) => view.getFloat32(4 * n, true));
    this.count = size / data.columns;
    /** Angle of the rope from the vertical, in degrees. */
    this.swing = Float32Array.from({ length: this.count }, (_, row) => this.swingAt(row));
  }

  /**
   * The numbers of a picture.
   * @param {number} row
   */
  at(row) {
    return this.numbers.subarray(row * data.columns, (row + 1) * data.columns);
  }

  /**
   * A point of a picture.
   * @param {number} row
   * @param {number} column Of the first of its three numbers.
   * @returns {Point}
   */
  point(row, column) {
    const [x, y, z] = this.at(row).subarray(column, column + 3);
    return [x, y, z];
  }

  /** @param {number} row */
  swingAt(row) {
    const tip = this.point(row, COLUMN.tip);
    const load = this.point(row, COLUMN.load);
    return DEGREES * Math.atan2(Math.hypot(load[0] - tip[0], load[1] - tip[1]), tip[2] - load[2]);
  }
}

const runs = data.runs.map((run) => new Pictures(run));
const count = runs[0].count;
const largestSwing = Math.max(1, ...runs.map((run) => Math.max(...run.swing)));
/** Where the eye is: angles about the crane and above the horizon, and the distance. */
const view = { turn: -0.9, lift: 0.22, far: 108 };
let shown = 0;
let row = 0;
let playing = false;
let last = 0;
slider.max = String(count - 1);

/**
 * From the ship's frame to the inertial one: R = Rz(yaw) Ry(pitch) Rx(roll).
 * @param {Float32Array} picture
 * @returns {(point: Point) => Point}
 */
function carried(picture) {
  const [x0, y0, z0, roll, pitch, yaw] = picture.subarray(COLUMN.ship, COLUMN.ship + 6);
  const cf = Math.cos(roll);
  const sf = Math.sin(roll);
  const ct = Math.cos(pitch);
  const st = Math.sin(pitch);
  const cy = Math.cos(yaw);
  const sy = Math.sin(yaw);
  return ([a, b, c]) => [
    x0 + cy * ct * a + (cy * st * sf - sy * cf) * b + (cy * st * cf + sy * sf) * c,
    y0 + sy * ct * a + (sy * st * sf + cy * cf) * b + (sy * st * cf - cy * sf) * c,
    z0 - st * a + ct * sf * b + ct * cf * c,
  ];
}

/**
 * A canvas as large as it is shown, and its pen.
 * @param {HTMLCanvasElement} canvas
 */
function fitted(canvas) {
  const scale = window.devicePixelRatio || 1;
  const { width, height } = canvas.getBoundingClientRect();
  canvas.width = width * scale;
  canvas.height = height * scale;
  const pen = canvas.getContext("2d");
  if (!pen) throw new Error("This browser cannot draw on a canvas.");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  return { pen, width, height };
}

/**
 * Draw lines on a canvas.
 * @param {CanvasRenderingContext2D} pen
 * @param {Iterable<readonly [x: number, y: number]>} points
 */
function trace(pen, points) {
  pen.beginPath();
  let first = true;
  for (const [x, y] of points) {
    if (first) pen.moveTo(x, y);
    else pen.lineTo(x, y);
    first = false;
  }
}

/** What draws points of the inertial frame as the eye sees them. */
class Painter {
  /** @param {Point} aim What the eye looks at. */
  constructor(aim) {
    const { pen, width, height } = fitted(scene);
    this.aim = aim;
    this.pen = pen;
    this.width = width;
    this.height = height;
    this.zoom = 1.05 * Math.min(width, 1.25 * height);
    pen.lineJoin = "round";
    pen.lineCap = "round";
  }

  /**
   * Place of a point on the canvas.
   * @param {Point} point
   * @returns {[x: number, y: number]}
   */
  seen([x, y, z]) {
    const c = Math.cos(view.turn);
    const s = Math.sin(view.turn);
    const cl = Math.cos(view.lift);
    const sl = Math.sin(view.lift);
    const dx = x - this.aim[0];
    const dy = y - this.aim[1];
    const dz = z - this.aim[2];
    const u = c * dx + s * dy;
    const v = -s * dx + c * dy;
    const depth = Math.max(view.far + cl * v - sl * dz, 4);
    const across = this.width / 2 + (this.zoom * u) / depth;
    return [across, this.height / 2 - (this.zoom * (sl * v + cl * dz)) / depth];
  }

  /**
   * Draw lines, or an area with its border.
   * @param {readonly Point[]} points
   * @param {string} color
   * @param {number} wide
   * @param {string} [fill]
   */
  path(points, color, wide, fill) {
    const { pen } = this;
    trace(
      pen,
      points.map((point) => this.seen(point)),
    );
    if (fill) {
      pen.closePath();
      pen.fillStyle = fill;
      pen.fill();
    }
    pen.strokeStyle = color;
    pen.lineWidth = wide;
    pen.stroke();
  }

  /**
   * Draw a convex body; of its sides, counted anticlockwise from above, only those towards the eye.
   * @param {readonly Point[]} above
   * @param {readonly Point[]} below
   * @param {{ line: string, side: string, cover: string }} colors
   */
  solid(above, below, { line, side, cover }) {
    above.forEach((corner, n) => {
      const next = (n + 1) % above.length;
      const corners = [corner, above[next], below[next], below[n]];
      const [[ux, uy], [vx, vy], [wx, wy]] = corners.map((point) => this.seen(point));
      if ((vx - ux) * (wy - uy) > (vy - uy) * (wx - ux)) this.path(corners, line, 0.8, side);
    });
    this.path(above, line, 1, cover);
  }
}

/** Draw crane, ship and load as they are at the instant that is shown. */
function drawScene() {
  const run = runs[shown];
  const picture = run.at(row);
  const to = carried(picture);
  const slew = data.slew + picture[COLUMN.slew];
  const ahead = [Math.cos(slew), -Math.sin(slew)];
  const [ax, ay, az] = data.axis;
  const painter = new Painter([ax + 12 * ahead[0], ay + 12 * ahead[1], 20]);
  const { pen } = painter;
  /**
   * @param {number} reach
   * @param {number} z
   */
  const slewed = (reach, z) => to([ax + reach * ahead[0], ay + reach * ahead[1], z]);

  // the sea at rest, 20 m between lines
  for (let n = -6; n <= 6; n++) {
    const x = 20 * n + 40;
    const y = 20 * n;
    drawLine(painter, [x, -120, 0], [x, 120, 0], "#c3d6e3", 1);
    drawLine(painter, [-80, y, 0], [160, y, 0], "#c3d6e3", 1);
  }
  // hull: sides, then deck
  const plan = [
    [HULL.astern, -HULL.half],
    [HULL.ahead - 30, -HULL.half],
    [HULL.ahead, 0],
    [HULL.ahead - 30, HULL.half],
    [HULL.astern, HULL.half],
  ];
  const deck = plan.map(([x, y]) => to([x, y, HULL.deck]));
  const keel = plan.map(([x, y]) => to([x, y, HULL.keel]));
  painter.solid(deck, keel, { line: "#7f8a93", side: "#aab4bc", cover: "#d5dade" });
  // pedestal and tower, boom as two chords, ropes
  const tip = run.point(row, COLUMN.tip);
  const load = run.point(row, COLUMN.load);
  const foot = slewed(data.foot, az);
  const sheave = slewed(data.foot + data.sheave[0], az + data.sheave[1]);
  const pivot = slewed(0, az);
  drawLine(painter, to([ax, ay, HULL.deck]), pivot, "#5b6770", 9);
  drawLine(painter, pivot, sheave, "#5b6770", 5);
  drawLine(painter, pivot, foot, "#5b6770", 5);
  drawBoom(painter, foot, tip, ahead);
  drawLine(painter, sheave, tip, "#444", 1);
  // trail and plumb line, load on its rope, red where it is slack
  /** @type {Point[]} */
  const trail = [];
  for (let n = Math.max(0, row - Math.round(TRAIL / data.step)); n <= row; n += 2) {
    trail.push(run.point(n, COLUMN.load));
  }
  painter.path(trail, COLORS[shown], 1.5);
  pen.setLineDash([4, 4]);
  drawLine(painter, tip, [tip[0], tip[1], tip[2] - picture[COLUMN.rope]], "#888", 1);
  pen.setLineDash([]);
  drawLine(painter, tip, load, picture[COLUMN.pull] > 0 ? "#111" : "#c00", 1.6);
  const corners = [
    [-3, -1.2],
    [3, -1.2],
    [3, 1.2],
    [-3, 1.2],
  ];
  /**
   * @param {number} z
   * @returns {Point[]}
   */
  const level = (z) => corners.map(([x, y]) => [load[0] + x, load[1] + y, load[2] + z]);
  const color = COLORS[shown];
  painter.solid(level(-0.3), level(-2.7), { line: "#333", side: color, cover: color });
}

/**
 * Draw a straight line.
 * @param {Painter} painter
 * @param {Point} from
 * @param {Point} to
 * @param {string} color
 * @param {number} wide
 */
function drawLine(painter, from, to, color, wide) {
  painter.path([from, to], color, wide);
}

/**
 * Draw the boom: two chords that meet at the tip, and the braces between them.
 * @param {Painter} painter
 * @param {Point} foot
 * @param {Point} tip
 * @param {readonly number[]} ahead
 */
function drawBoom(painter, foot, tip, ahead) {
  /**
   * A point aside of another, in m.
   * @param {Point} point
   * @param {number} by
   * @returns {Point}
   */
  const beside = (point, by) => [point[0] - by * ahead[1], point[1] + by * ahead[0], point[2]];
  /**
   * A point of a chord, after so many twelfths of its length.
   * @param {number} twelfths
   * @param {number} side
   */
  const chord = (twelfths, side) => {
    /** @param {0 | 1 | 2} i */
    const along = (i) => foot[i] + (twelfths / 12) * (tip[i] - foot[i]);
    return beside([along(0), along(1), along(2)], side * (1 - twelfths / 12));
  };
  for (const side of [-1, 1]) drawLine(painter, beside(foot, side), tip, "#c98f00", 2.5);
  for (let n = 1; n < 12; n++) {
    const side = n % 2 ? 1 : -1;
    drawLine(painter, chord(n - 1, -side), chord(n, side), "#c98f00", 1);
  }
}

/** Draw the swing of all runs over time, and below it where drives are at a limit. */
function drawChart() {
  const { pen, width, height } = fitted(chart);
  const run = runs[shown];
  const low = height - 20 - (run.ideal ? 0 : 48);
  /** @param {number} n */
  const x = (n) => MARGIN + ((width - MARGIN - 4) * n) / (count - 1);
  /** @param {number} swing */
  const y = (swing) => low - ((low - 8) * swing) / (1.05 * largestSwing);
  pen.font = "11px sans-serif";
  pen.fillStyle = "#666";
  pen.strokeStyle = "#e4e4e4";
  pen.lineWidth = 1;
  const step = [0.5, 1, 2, 5, 10, 20].find((degrees) => largestSwing / degrees <= 5) || 50;
  for (let degrees = 0; degrees <= 1.05 * largestSwing; degrees += step) {
    pen.beginPath();
    pen.moveTo(MARGIN, y(degrees));
    pen.lineTo(width, y(degrees));
    pen.stroke();
    pen.fillText(`${degrees}°`, 4, y(degrees) + 4);
  }
  const length = count * data.step;
  const seconds = [5, 10, 20, 30, 60, 120].find((interval) => length / interval <= 6) || 300;
  for (let time = 0; time <= (count - 1) * data.step; time += seconds) {
    pen.fillText(`${time} s`, x(time / data.step) - 6, height - 5);
  }
  runs.forEach(({ swing }, number) => {
    trace(
      pen,
      Array.from(swing, (degrees, n) => [x(n), y(degrees)]),
    );
    pen.strokeStyle = COLORS[number];
    pen.globalAlpha = number === shown ? 1 : 0.35;
    pen.lineWidth = number === shown ? 1.6 : 1;
    pen.stroke();
  });
  pen.globalAlpha = 1;
  if (!run.ideal) {
    LIMITS.forEach(([name, column], number) => {
      const at = low + 8 + 14 * number;
      pen.fillStyle = "#666";
      pen.fillText(name, 2, at + 9);
      for (let n = 0; n < count; n++) {
        const color = limitColor(run.at(n)[column]);
        if (!color) continue;
        pen.fillStyle = color;
        pen.fillRect(x(n), at, x(1) - x(0) + 0.6, 10);
      }
    });
  }
  pen.strokeStyle = "#222";
  pen.beginPath();
  pen.moveTo(x(row), 4);
  pen.lineTo(x(row), height - 16);
  pen.stroke();
}

/**
 * The colour of the limit at which a drive is, empty for none.
 * @param {number} bits
 */
function limitColor(bits) {
  if (bits & STOP) return "#cc79a7";
  return bits & ORIFICE ? "#e69f00" : "";
}

/** What the picture that is shown says in words. */
function readout() {
  const run = runs[shown];
  const picture = run.at(row);
  const time = (row * data.step).toFixed(1);
  const swing = run.swing[row].toFixed(1);
  const rope = picture[COLUMN.rope].toFixed(1);
  const slack = picture[COLUMN.pull] > 0 ? "" : ", slack";
  const drives = run.ideal ? [] : LIMITS.filter(([, column]) => limitColor(picture[column]));
  const acting = drives.map(([name]) => name).join(", ");
  const limits = acting ? `at a limit: ${acting}` : "no drive at a limit";
  return `${time} s\nswing ${swing}°, rope ${rope} m${slack}\n${limits}`;
}

/** Draw the instant that is shown. */
function draw() {
  drawScene();
  drawChart();
  slider.value = String(row);
  element("readout", HTMLElement).textContent = readout();
  names.forEach((name, number) => {
    name.classList.toggle("here", number === shown);
    name.style.color = COLORS[number];
  });
  play.textContent = playing ? "Pause" : "Play";
  document.documentElement.dataset.drawn = String(row);
}

/**
 * Show another instant.
 * @param {number} to The picture's number; the nearest that there is.
 */
function go(to) {
  row = Math.max(0, Math.min(count - 1, Math.round(to)));
  draw();
}

/**
 * Go on while it plays.
 * @param {number} now In ms.
 */
function tick(now) {
  if (!playing) return;
  const passed = Math.floor((now - last) / (1000 * data.step));
  if (passed > 0) {
    last += passed * 1000 * data.step;
    go(row + passed);
  }
  if (row === count - 1) {
    playing = false;
    draw();
  } else requestAnimationFrame(tick);
}

play.onclick = () => {
  playing = !playing;
  last = performance.now();
  if (playing && row === count - 1) row = 0;
  draw();
  requestAnimationFrame(tick);
};
slider.oninput = () => go(Number(slider.value));
for (const name of names) {
  name.onclick = () => {
    shown = Number(name.dataset.run);
    draw();
  };
}

/**
 * Show the instant below a pressed pointer.
 * @param {PointerEvent} event
 */
function seek(event) {
  if (event.buttons)
    go(((event.offsetX - MARGIN) / (chart.clientWidth - MARGIN - 4)) * (count - 1));
}
chart.onpointerdown = seek;
chart.onpointermove = seek;

/**
 * Pointers that are down: one turns the scene, two come nearer or go farther.
 * @type {Map<number, PointerEvent>}
 */
const fingers = new Map();

/**
 * Change the distance of the eye.
 * @param {number} factor
 */
function near(factor) {
  view.far = Math.min(400, Math.max(40, view.far * factor));
  drawScene();
}

scene.onpointerdown = (event) => {
  fingers.set(event.pointerId, event);
  scene.setPointerCapture(event.pointerId);
};
scene.onpointerup = (event) => {
  fingers.delete(event.pointerId);
};
scene.onpointercancel = (event) => {
  fingers.delete(event.pointerId);
};
scene.onpointermove = (event) => {
  const before = fingers.get(event.pointerId);
  if (!before) return;
  const other = [...fingers.values()].find((finger) => finger.pointerId !== event.pointerId);
  if (other) {
    /** @param {PointerEvent} finger */
    const distance = ({ clientX, clientY }) =>
      Math.hypot(clientX - other.clientX, clientY - other.clientY);
    near(distance(before) / Math.max(distance(event), 1));
  } else {
    view.turn -= (event.clientX - before.clientX) / 200;
    view.lift = Math.min(1.5, Math.max(0.02, view.lift + (event.clientY - before.clientY) / 250));
  }
  fingers.set(event.pointerId, event);
  drawScene();
};
scene.onwheel = (event) => {
  event.preventDefault();
  near(Math.exp(event.deltaY / 900));
};
window.onresize = draw;
go(Number(location.hash.slice(1)) / data.step || 0);

const data = JSON.parse(document.getElementById("data").textContent);
const COLORS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7"];
const DEG = 180 / Math.PI;
const HULL = { ahead: 92, astern: -102, half: 11.6, deck: 7, keel: -3 };
const TRAIL = 12;
const LIMITS = [
  ["luff", 11],
  ["slew", 10],
  ["hoist", 9],
];
const $ = (id) => document.getElementById(id);
const scene = $("scene");
const chart = $("chart");
const slider = $("time");

for (const run of data.runs) {
  const bytes = Uint8Array.from(atob(run.code), (letter) => letter.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  const all = bytes.length / 4;
  const numbers = Float32Array.from({ length: all }, (_, n) => view.getFloat32(4 * n, true));
  run.at = (row) => numbers.subarray(row * data.columns, (row + 1) * data.columns);
  run.count = all / data.columns;
  run.swing = Float32Array.from({ length: run.count }, (_, n) => swing(run.at(n)));
}
const count = data.runs[0].count;
const top = Math.max(1, ...data.runs.map((run) => Math.max(...run.swing)));
const view = { turn: -0.9, lift: 0.22, far: 108 };
let shown = 0;
let row = 0;
let playing = false;
let last = 0;
slider.max = count - 1;

function swing(r) {
  return DEG * Math.atan2(Math.hypot(r[3] - r[0], r[4] - r[1]), r[2] - r[5]);
}

// --- ship's frame to the inertial one: R = Rz(yaw) Ry(pitch) Rx(roll) ---
function carried(r) {
  const [x0, y0, z0, f, t, y] = r.subarray(12, 18);
  const [cf, sf, ct, st, cy, sy] = [
    Math.cos(f),
    Math.sin(f),
    Math.cos(t),
    Math.sin(t),
    Math.cos(y),
    Math.sin(y),
  ];
  return ([a, b, c]) => [
    x0 + cy * ct * a + (cy * st * sf - sy * cf) * b + (cy * st * cf + sy * sf) * c,
    y0 + sy * ct * a + (sy * st * sf + cy * cf) * b + (sy * st * cf - cy * sf) * c,
    z0 - st * a + ct * sf * b + ct * cf * c,
  ];
}

function fitted(canvas) {
  const scale = window.devicePixelRatio || 1;
  const { width, height } = canvas.getBoundingClientRect();
  canvas.width = width * scale;
  canvas.height = height * scale;
  const pen = canvas.getContext("2d");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  return [pen, width, height];
}

function drawScene() {
  const [pen, width, height] = fitted(scene);
  const run = data.runs[shown];
  const r = run.at(row);
  const to = carried(r);
  const slew = data.slew + r[6];
  const out = [Math.cos(slew), -Math.sin(slew)];
  const [ax, ay, az] = data.axis;
  const aim = [ax + 12 * out[0], ay + 12 * out[1], 20];
  const [c, s, cl, sl] = [
    Math.cos(view.turn),
    Math.sin(view.turn),
    Math.cos(view.lift),
    Math.sin(view.lift),
  ];
  const zoom = 1.05 * Math.min(width, 1.25 * height);
  const seen = ([x, y, z]) => {
    const [dx, dy, dz] = [x - aim[0], y - aim[1], z - aim[2]];
    const u = c * dx + s * dy;
    const v = -s * dx + c * dy;
    const depth = Math.max(view.far + cl * v - sl * dz, 4);
    return [width / 2 + (zoom * u) / depth, height / 2 - (zoom * (sl * v + cl * dz)) / depth];
  };
  const path = (points, color, wide, fill) => {
    pen.beginPath();
    points.forEach((p, n) => pen[n ? "lineTo" : "moveTo"](...seen(p)));
    if (fill) {
      pen.closePath();
      pen.fillStyle = fill;
      pen.fill();
    }
    pen.strokeStyle = color;
    pen.lineWidth = wide;
    pen.stroke();
  };
  // of a convex body only the sides towards the eye, counted anticlockwise from above
  const solid = (top, low, line, color, cover) => {
    top.forEach((_, n) => {
      const m = (n + 1) % top.length;
      const side = [top[n], top[m], low[m], low[n]];
      const [[ux, uy], [vx, vy], [wx, wy]] = side.map(seen);
      if ((vx - ux) * (wy - uy) > (vy - uy) * (wx - ux)) path(side, line, 0.8, color);
    });
    path(top, line, 1, cover);
  };
  const slewed = (reach, z) => to([ax + reach * out[0], ay + reach * out[1], z]);
  pen.lineJoin = pen.lineCap = "round";
  // the sea at rest, 20 m between lines
  for (let n = -6; n <= 6; n++) {
    const [x, y] = [20 * n + 40, 20 * n];
    path(
      [
        [x, -120, 0],
        [x, 120, 0],
      ],
      "#c3d6e3",
      1,
    );
    path(
      [
        [-80, y, 0],
        [160, y, 0],
      ],
      "#c3d6e3",
      1,
    );
  }
  // hull: sides, then deck
  const plan = [
    [HULL.astern, -HULL.half],
    [HULL.ahead - 30, -HULL.half],
    [HULL.ahead, 0],
    [HULL.ahead - 30, HULL.half],
    [HULL.astern, HULL.half],
  ];
  const [deck, keel] = [HULL.deck, HULL.keel].map((z) => plan.map(([x, y]) => to([x, y, z])));
  solid(deck, keel, "#7f8a93", "#aab4bc", "#d5dade");
  // pedestal and tower, boom as two chords, ropes
  const tip = [r[0], r[1], r[2]];
  const load = [r[3], r[4], r[5]];
  const foot = slewed(data.foot, az);
  const sheave = slewed(data.foot + data.sheave[0], az + data.sheave[1]);
  path([to([ax, ay, HULL.deck]), slewed(0, az)], "#5b6770", 9);
  path([slewed(0, az), sheave], "#5b6770", 5);
  path([slewed(0, az), foot], "#5b6770", 5);
  const across = [-out[1], out[0]];
  const side = (p, w) => [p[0] + w * across[0], p[1] + w * across[1], p[2]];
  for (const w of [-1, 1]) path([side(foot, w), tip], "#c98f00", 2.5);
  for (let n = 1; n < 12; n++) {
    const at = (k, w) =>
      side(
        foot.map((each, i) => each + (k / 12) * (tip[i] - each)),
        w * (1 - k / 12),
      );
    path([at(n - 1, n % 2 ? -1 : 1), at(n, n % 2 ? 1 : -1)], "#c98f00", 1);
  }
  path([sheave, tip], "#444", 1);
  // trail and plumb line, load on its rope, red where it is slack
  const trail = [];
  for (let n = Math.max(0, row - Math.round(TRAIL / data.step)); n <= row; n += 2)
    trail.push([...run.at(n).subarray(3, 6)]);
  path(trail, COLORS[shown], 1.5);
  pen.setLineDash([4, 4]);
  path([tip, [tip[0], tip[1], tip[2] - r[8]]], "#888", 1);
  pen.setLineDash([]);
  path([tip, load], r[7] > 0 ? "#111" : "#c00", 1.6);
  const [roof, floor] = [-0.3, -2.7].map((z) =>
    [
      [-3, -1.2],
      [3, -1.2],
      [3, 1.2],
      [-3, 1.2],
    ].map(([x, y]) => [load[0] + x, load[1] + y, load[2] + z]),
  );
  solid(roof, floor, "#333", COLORS[shown], COLORS[shown]);
}

function drawChart() {
  const [pen, width, height] = fitted(chart);
  const run = data.runs[shown];
  const left = 34;
  const low = height - 20 - (run.ideal ? 0 : 48);
  const x = (n) => left + ((width - left - 4) * n) / (count - 1);
  const y = (v) => low - ((low - 8) * v) / (1.05 * top);
  pen.font = "11px sans-serif";
  pen.fillStyle = "#666";
  pen.strokeStyle = "#e4e4e4";
  pen.lineWidth = 1;
  const step = [0.5, 1, 2, 5, 10, 20].find((each) => top / each <= 5) || 50;
  for (let v = 0; v <= 1.05 * top; v += step) {
    pen.beginPath();
    pen.moveTo(left, y(v));
    pen.lineTo(width, y(v));
    pen.stroke();
    pen.fillText(`${v}°`, 4, y(v) + 4);
  }
  const seconds = [5, 10, 20, 30, 60, 120].find((each) => (count * data.step) / each <= 6) || 300;
  for (let t = 0; t <= (count - 1) * data.step; t += seconds)
    pen.fillText(`${t} s`, x(t / data.step) - 6, height - 5);
  data.runs.forEach((each, n) => {
    pen.beginPath();
    each.swing.forEach((v, k) => pen[k ? "lineTo" : "moveTo"](x(k), y(v)));
    pen.strokeStyle = COLORS[n];
    pen.globalAlpha = n === shown ? 1 : 0.35;
    pen.lineWidth = n === shown ? 1.6 : 1;
    pen.stroke();
  });
  pen.globalAlpha = 1;
  if (!run.ideal)
    LIMITS.forEach(([name, column], k) => {
      const at = low + 8 + 14 * k;
      pen.fillStyle = "#666";
      pen.fillText(name, 2, at + 9);
      for (let n = 0; n < count; n++) {
        const bits = run.at(n)[column];
        const color = bits & 8 ? "#cc79a7" : bits & 2 ? "#e69f00" : "";
        if (color) {
          pen.fillStyle = color;
          pen.fillRect(x(n), at, x(1) - x(0) + 0.6, 10);
        }
      }
    });
  pen.strokeStyle = "#222";
  pen.beginPath();
  pen.moveTo(x(row), 4);
  pen.lineTo(x(row), height - 16);
  pen.stroke();
}

function draw() {
  const run = data.runs[shown];
  const r = run.at(row);
  const acting = run.ideal
    ? []
    : LIMITS.filter(([, column]) => r[column] & 10).map(([name]) => name);
  drawScene();
  drawChart();
  slider.value = row;
  $("readout").textContent =
    `${(row * data.step).toFixed(1)} s\nswing ${run.swing[row].toFixed(1)}°, rope ${r[8].toFixed(1)} m${r[7] > 0 ? "" : ", slack"}\n${acting.length ? `at a limit: ${acting.join(", ")}` : "no drive at a limit"}`;
  document.querySelectorAll("[data-run]").forEach((each, n) => {
    each.classList.toggle("here", n === shown);
    each.style.color = COLORS[n];
  });
  $("play").textContent = playing ? "Pause" : "Play";
  document.documentElement.dataset.drawn = row;
}
const go = (to) => {
  row = Math.max(0, Math.min(count - 1, Math.round(to)));
  draw();
};
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
$("play").onclick = () => {
  playing = !playing;
  last = performance.now();
  if (playing && row === count - 1) row = 0;
  draw();
  requestAnimationFrame(tick);
};
slider.oninput = () => go(Number(slider.value));
document.querySelectorAll("[data-run]").forEach((each) => {
  each.onclick = () => {
    shown = Number(each.dataset.run);
    draw();
  };
});
chart.onpointerdown = chart.onpointermove = (event) => {
  if (event.buttons) go(((event.offsetX - 34) / (chart.clientWidth - 38)) * (count - 1));
};
const fingers = new Map();
scene.onpointerdown = (event) => {
  fingers.set(event.pointerId, event);
  scene.setPointerCapture(event.pointerId);
};
scene.onpointerup = scene.onpointercancel = (event) => fingers.delete(event.pointerId);
scene.onpointermove = (event) => {
  const before = fingers.get(event.pointerId);
  if (!before) return;
  const other = [...fingers.values()].find((each) => each.pointerId !== event.pointerId);
  const apart = (each) => Math.hypot(each.clientX - other.clientX, each.clientY - other.clientY);
  if (other) near(apart(before) / Math.max(apart(event), 1));
  else {
    view.turn -= (event.clientX - before.clientX) / 200;
    view.lift = Math.min(1.5, Math.max(0.02, view.lift + (event.clientY - before.clientY) / 250));
  }
  fingers.set(event.pointerId, event);
  drawScene();
};
const near = (factor) => {
  view.far = Math.min(400, Math.max(40, view.far * factor));
  drawScene();
};
scene.onwheel = (event) => {
  event.preventDefault();
  near(Math.exp(event.deltaY / 900));
};
window.onresize = draw;
go(Number(location.hash.slice(1)) / data.step || 0);

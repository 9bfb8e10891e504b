"""Rows of the table on exported drives: native and WebAssembly steps, writing, a page's slider.

    python benchmarks/exports.py

prints these rows alone: the least of 60 runs each, since others' work on the machine only adds.
A slider needs Chromium, WebAssembly Node; without them there is no row.
"""

import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Timer

from table import Row, show

from swashplate import Drive, export, maneuvers
from swashplate.report.fit_report import write_live_page

SAMPLES, ROUNDS = 15_360, 60
NATIVE = """
#include "swashplate_drive.h"
#include "hoist_values.h"
#include <stdio.h>
#include <math.h>
#include <time.h>

static swp_drive drive;

int main(void)
{
    volatile double kept = 0.0;
    swp_init(&drive, hoist_values, sizeof hoist_values / sizeof hoist_values[0]);
    for (int round = 0; round < ROUNDS; round++) {
        struct timespec begin, end;
        swp_reset(&drive);
        clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &begin);
        for (int n = 0; n < SAMPLES; n++) {
            swp_step(&drive, 6.5 * sin(0.00122718463 * n));
            for (int i = 0; i < 10; i++) {
                kept = swp_output(&drive, i);
            }
        }
        clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &end);
        const double seconds = (double)(end.tv_sec - begin.tv_sec);
        printf("%.9g\\n", seconds + 1e-9 * (double)(end.tv_nsec - begin.tv_nsec));
    }
    return kept != kept;
}
"""
SCRIPT = """
const fs = require("fs");
const file = fs.readFileSync(process.argv[2]);
WebAssembly.compile(file).then((module) => {
  const [values] = WebAssembly.Module.customSections(module, "swashplate.values");
  const c = new WebAssembly.Instance(module, {}).exports;
  const count = values.byteLength / 8;
  new Float64Array(c.memory.buffer, c.swp_page_values(count), count).set(new Float64Array(values));
  c.swp_page_init(count);
  c.swp_page_begin(SAMPLES, 1 / 512, 10);
  for (let k = 0; k < 10; k++) c.swp_page_select(k, k);
  const voltage = new Float64Array(c.memory.buffer, c.swp_page_input(0), SAMPLES);
  for (let n = 0; n < SAMPLES; n++) voltage[n] = 6.5 * Math.sin(0.00122718463 * n);
  for (let round = 0; round < ROUNDS; round++) {
    const begin = process.cpuUsage();
    c.swp_page_run(0);
    const { user, system } = process.cpuUsage(begin);
    console.log((user + system) * 1e-6);
  }
});
"""
SLIDER = """<script>
const wait = setInterval(() => {
  if (document.body.dataset.ready !== "yes") return;
  clearInterval(wait);
  const range = document.querySelector('input[type=range][aria-label="Orifice"]');
  const times = [];
  for (let k = 0; k < ROUNDS; k++) {
    range.value = 0.4 + 0.005 * k;
    const begin = performance.now();
    range.dispatchEvent(new Event("input"));
    times.push((performance.now() - begin) / 1e3);
  }
  console.log(`took ${times.join(" ")} s`);
}, 20);
</script></body>"""


def filled(text: str) -> str:
    """A text with its two numbers."""
    return text.replace("SAMPLES", str(SAMPLES)).replace("ROUNDS", str(ROUNDS))


def native_step(drive: Drive, folder: Path) -> list[float]:
    """Times of a run in C, its command's sine included. [s]"""
    export.c(drive, folder / "c")
    (folder / "c" / "main.c").write_text(filled(NATIVE), "utf-8")
    words = ["cc", "-O3", "-ffp-contract=off", "main.c", "swashplate_drive.c", "-lm", "-o", "timed"]
    subprocess.run(words, cwd=folder / "c", check=True)
    return numbers([str(folder / "c" / "timed")])


def wasm_step(drive: Drive, folder: Path) -> list[float]:
    """Times of a run of the packaged WebAssembly in Node. [s]"""
    export.wasm(drive, folder / "drive.wasm")
    (folder / "run.cjs").write_text(filled(SCRIPT), "utf-8")
    return numbers(["node", str(folder / "run.cjs"), str(folder / "drive.wasm")])


def slider(drive: Drive, folder: Path, browser: str) -> list[float]:
    """Times of a slider's moves on a live page with a run of 30 s, its drawing included. [s]"""
    page = folder / "live.html"
    write_live_page(drive, page, command=maneuvers.parse("sine:6.5,0.1,length=30"))
    # the page lets no other script run than its own
    policy = re.compile('<meta http-equiv="Content-Security-Policy"[^>]*>')
    text = policy.sub("", page.read_text("utf-8")).replace("</body>", filled(SLIDER))
    page.write_text(text, "utf-8")
    options = ("--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr")
    more = ("--remote-debugging-port=0", f"--user-data-dir={folder / 'profile'}")  # it stays open
    words = [browser, *options, *more, page.as_uri()]
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True) as running:
        assert running.stderr is not None
        stop = Timer(180.0, running.terminate)
        stop.start()
        lines = (re.search(r"took ([\d. e-]+) s", line) for line in running.stderr)
        found = next((each for each in lines if each), None)
        stop.cancel()
        running.terminate()
    assert found is not None, "the page was not ready in time"
    return [float(each) for each in found[1].split()]


def numbers(words: list[str]) -> list[float]:
    """What a program prints."""
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    return [float(line) for line in done.stdout.split()]


def export_rows() -> Iterator[Row]:
    """Steps, writing, slider."""
    drive = Drive.preset("hoist")
    with TemporaryDirectory(ignore_cleanup_errors=True) as place:  # a browser ends by and by
        folder = Path(place)
        a_step = 1e9 / SAMPLES
        found = a_step * min(native_step(drive, folder))
        yield row("exported C, a step with ten outputs, least of 60 runs", found, "ns", 100)
        if shutil.which("node"):
            found = a_step * min(wasm_step(drive, folder))
            yield row("WebAssembly in Node, likewise", found, "ns", 150)
        browser = shutil.which("chromium") or shutil.which("chromium-browser")
        if browser is not None:
            found = 1e3 * min(slider(drive, folder, browser))
            yield row("live page, a slider's move over 30 s, drawn, likewise", found, "ms", 5)


def row(what: str, found: float, unit: str, most: int) -> Row:
    """A line of the table."""
    shown = f"{found:.1f}" if found < 50.0 else f"{found:.0f}"
    return Row(what, f"{shown} {unit}", "", f"≤ {most} {unit}", found <= most)


if __name__ == "__main__":
    show(list(export_rows()))

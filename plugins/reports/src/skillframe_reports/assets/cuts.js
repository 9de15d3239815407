"use strict";
/* Boundaries that a person drags, and the line that repeats the cut (see reports/cuts.py). */
(function () {
  const STEP = 0.01, LEAP = 0.1, NEAR_PX = 22, SLACK = 1e-6;
  const data = JSON.parse(document.getElementById("cuts").textContent);
  const line = document.getElementById("line"), told = document.getElementById("told");
  const onGrid = (time) => Number((Math.round(time / STEP) * STEP).toFixed(2));
  const written = (time) => String(Number(time.toFixed(6)));

  function element(name, text) {
    const made = document.createElement(name);
    made.className = "word";
    made.textContent = text;
    return made;
  }

  class Recording {
    constructor(element, row, number) {
      Object.assign(this, row, { number, at: row.shown.slice(), touched: row.set.slice() });
      this.lanes = element.querySelector(".lanes");
      this.bands = Array.from(element.querySelectorAll(".band"));
      this.handles = Array.from(element.querySelectorAll(".handle"));
      this.ghosts = Array.from(element.querySelectorAll(".ghost"));
      this.figures = Array.from(element.querySelectorAll(".boundaries li"));
      if (!this.movable) return;
      this.lanes.addEventListener("pointerdown", (e) => this.grab(e));
      this.handles.forEach((handle, k) => handle.addEventListener("keydown", (e) => this.key(e, k)));
      this.figures.forEach((figure, k) => {
        const entry = figure.querySelector("input");
        entry.addEventListener("change", () => this.put(k, entry.value === "" ? this.at[k] : Number(entry.value)));
        figure.querySelector(".back").addEventListener("click", () => { this.put(k, this.rest[k]); this.handles[k].focus(); });
      });
    }

    edges() { return [this.start, ...this.at, this.end]; }

    /* Where boundary k may be: from, to. A phase keeps its least length on both sides. */
    limits(k) {
      const edges = this.edges();
      return [Math.ceil((edges[k] + data.min) / STEP - 1e-4) * STEP, Math.floor((edges[k + 2] - data.min) / STEP + 1e-4) * STEP];
    }

    fits(k, time) {
      const edges = this.edges();
      return time - edges[k] >= data.min - SLACK && edges[k + 2] - time >= data.min - SLACK;
    }

    /* Whether both neighbours stand where boundary k has them when nothing is moved. */
    alone(k) { return [k - 1, k + 1].every((i) => this.at[i] === undefined || this.at[i] === this.rest[i]); }

    put(k, time) {
      const [low, high] = this.limits(k), rest = this.rest[k];
      if (Math.abs(time - rest) < 0.5 * STEP + SLACK && (this.fits(k, rest) || this.alone(k))) this.at[k] = rest;
      else if (low <= high + SLACK && Number.isFinite(time)) this.at[k] = onGrid(Math.min(Math.max(time, low), high));
      this.touched[k] = this.at[k] !== rest;
      show();
    }

    putAllBack() { this.at = this.rest.slice(); this.touched = this.at.map(() => false); }

    /* What stands in the line: what was moved, and all that this leaves where it would not be without. */
    moves() {
      if (!this.touched.some(Boolean)) return [];
      return this.at.flatMap((time, k) => this.touched[k] || time !== this.found[k] ? [`${this.number}:${k + 1}=${written(time)}`] : []);
    }

    grab(event) {
      if (event.button !== 0 || this.held !== undefined) return;
      const box = this.lanes.getBoundingClientRect(), px = (time) => (time - this.first) / (this.last - this.first) * box.width;
      const away = this.at.map((time) => px(time) - (event.clientX - box.left));
      const k = away.reduce((best, gap, i) => Math.abs(gap) < Math.abs(away[best]) ? i : best, 0);
      if (!this.at.length || Math.abs(away[k]) > NEAR_PX) return;
      event.preventDefault();
      const handle = this.handles[k], was = this.at[k], id = event.pointerId;
      this.held = k;
      handle.focus({ preventScroll: true });
      handle.classList.add("dragging");
      this.lanes.setPointerCapture(id);
      const move = (e) => {
        if (e.pointerId === id) this.put(k, this.first + (e.clientX - box.left + away[k]) / box.width * (this.last - this.first));
      };
      const end = (e) => {
        if (e.pointerId !== id) return;
        if (e.type === "pointercancel") this.put(k, was);
        handle.classList.remove("dragging");
        this.held = undefined;
        this.lanes.removeEventListener("pointermove", move);
        for (const name of ["pointerup", "pointercancel"]) this.lanes.removeEventListener(name, end);
      };
      this.lanes.addEventListener("pointermove", move);
      for (const name of ["pointerup", "pointercancel"]) this.lanes.addEventListener(name, end);
    }

    key(event, k) {
      const by = event.shiftKey ? LEAP : STEP, [low, high] = this.limits(k);
      const to = {
        ArrowLeft: this.at[k] - by, ArrowDown: this.at[k] - by, ArrowRight: this.at[k] + by, ArrowUp: this.at[k] + by,
        PageDown: this.at[k] - LEAP, PageUp: this.at[k] + LEAP, Home: low, End: high, Escape: this.rest[k],
      }[event.key];
      if (to === undefined || event.ctrlKey || event.altKey || event.metaKey) return;
      event.preventDefault();
      this.put(k, event.key.startsWith("Arrow") || event.key.startsWith("Page") ? onGrid(to) : to);
    }

    show() {
      const share = (time) => (time - this.first) / (this.last - this.first), edges = [this.first, ...this.at, this.last];
      this.bands.forEach((band, i) => {
        band.style.left = `${100 * share(edges[i])}%`;
        band.style.width = `${100 * (share(edges[i + 1]) - share(edges[i]))}%`;
      });
      this.handles.forEach((handle, k) => {
        const text = `${this.at[k].toFixed(2)} s`, [low, high] = this.movable ? this.limits(k) : [this.first, this.last];
        handle.style.left = `${100 * share(this.at[k])}%`;
        handle.style.setProperty("--share", share(this.at[k]));
        handle.querySelector("i").textContent = text;
        if (!this.movable) return;
        for (const each of [handle, this.ghosts[k]]) each.classList.toggle("moved", this.touched[k]);
        this.ghosts[k].style.left = `${100 * share(this.rest[k])}%`;
        for (const [name, value] of [["now", this.at[k].toFixed(2)], ["text", text], ["min", low.toFixed(2)], ["max", high.toFixed(2)]]) handle.setAttribute(`aria-value${name}`, value);
        const figure = this.figures[k], entry = figure.querySelector("input");
        figure.classList.toggle("moved", this.touched[k]);
        figure.querySelector(".was").textContent = `found at ${this.rest[k].toFixed(2)} s`;
        entry.value = this.at[k].toFixed(2);
        entry.min = low.toFixed(2);
        entry.max = high.toFixed(2);
      });
    }
  }

  const recordings = data.recordings.map((row, i) => new Recording(document.getElementById(`d${i + 1}`), row, i + 1));

  function show() {
    recordings.forEach((each) => each.show());
    const moves = recordings.flatMap((each) => each.moves()), all = recordings.reduce((sum, each) => sum + each.at.length, 0);
    line.replaceChildren(...data.line.split(" ").flatMap((word, i) => [i ? " " : "", element("span", word)]));
    for (const move of moves) line.append(" ", element("mark", `--set-boundary ${move}`));
    told.textContent = (moves.length ? `${moves.length} of ${all} boundaries moved.` : "Nothing is moved: the line repeats the cut as it was found.")
      + " Run it where segment was run.";
  }

  document.getElementById("reset")?.addEventListener("click", () => { recordings.forEach((each) => each.putAllBack()); show(); });
  document.getElementById("copy").addEventListener("click", async () => {
    const selected = () => {
      getSelection().selectAllChildren(line);
      return document.execCommand("copy");
    };
    let copied = false;
    try { await navigator.clipboard.writeText(line.textContent); copied = true; } catch { copied = selected(); }
    told.textContent = copied ? "Copied." : "The line is selected: copy it with Ctrl+C.";
  });
  show();
})();

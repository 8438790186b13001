// The player: fields over time on the bodies, with everything that chooses what is shown.

const FRAME_MS = 160;
const SCALES = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];

class Player {
  constructor(host, data, clock) {
    this.data = data;
    this.clock = clock;
    this.times = data.numbers(data.meta.frames.t);
    this.fields = data.meta.fields;
    this.tables = new Map();
    this.frame = -1;
    this.timer = null;
    this.canvas = element("canvas", { class: "bodies", tabindex: 0, role: "img" });
    this.picture = new Picture(this.canvas, data);
    this.tip = element("div", { class: "tip", hidden: true });
    this.stage = element("div", { class: "stage" }, this.canvas, this.tip);
    this.buildControls();
    host.replaceChildren(this.timeRow, this.stage, this.colours, this.choices, this.said);
    this.listen();
    this.chooseField();
    new ResizeObserver(() => this.fit()).observe(this.stage);
    this.fit();
    clock.listen((now) => this.follow(now.t));
  }

  buildControls() {
    const button = (text, title, onclick) => element("button", { type: "button", text, title, "aria-label": title, onclick });
    const kept = this.clock.state;
    this.play = button("▶", "Play or pause (space)", () => this.toggle());
    this.slider = element("input", { type: "range", min: 0, max: this.times.length - 1, step: 1, value: 0,
      "aria-label": "Time of the picture", oninput: () => { this.pause(); this.go(Number(this.slider.value)); } });
    this.time = element("output", { class: "time" });
    this.timeRow = element("div", { class: "row" }, this.play, button("‹", "Frame before (left arrow)", () => this.step(-1)),
      button("›", "Next frame (right arrow)", () => this.step(1)), this.slider, this.time);
    this.field = element("select", { "aria-label": "Field that is shown", onchange: () => this.chooseField() });
    for (const half of [...new Set(this.fields.map((f) => f.half))]) {
      const group = element("optgroup", { label: `${half} half` });
      this.fields.forEach((f, k) => {
        if (f.half === half) group.append(element("option", { value: k, text: f.title, selected: kept.field === f.name }));
      });
      this.field.append(group);
    }
    this.arrows = element("select", { "aria-label": "Arrows", onchange: () => this.show() },
      element("option", { value: -1, text: "none" }));
    this.fields.forEach((f, k) => {
      if (f.parts) this.arrows.append(element("option", { value: k, text: f.title, selected: kept.arrows === f.name }));
    });
    this.scale = element("select", { "aria-label": "Magnification of the deformation",
      onchange: () => (this.whole ? this.look("whole") : this.show()) });
    for (const s of SCALES) this.scale.append(element("option", { value: s, text: `×${s}`, selected: kept.scale === String(s) }));
    const box = (checked) => element("input", { type: "checkbox", checked, onchange: () => this.show() });
    this.lines = box(kept.lines === "1");
    this.names = box(kept.names !== "0");
    this.own = box(kept.own === "1");
    const named = (text, input, title) => element("label", { title }, input, ` ${text}`);
    const before = (text, input, title) => element("label", { title }, `${text} `, input);
    const views = [button("Whole", "Show all bodies (0)", () => this.look("whole"))];
    if (this.picture.pairNodes.length) views.push(button("Contact", "Zoom to the contact (c)", () => this.look("contact")));
    views.push(button("+", "Zoom in (+)", () => this.zoom(0.75)), button("−", "Zoom out (−)", () => this.zoom(1.333)));
    this.choices = element("div", { class: "row choices" }, before("Field", this.field, "What the colours mean"),
      before("Arrows", this.arrows, "As long as they are large; the longest is the largest of this time"),
      before("Deformation", this.scale, "Displacements beyond the mean of their body are magnified"),
      named("mesh", this.lines, "Edges of the cells (m)"), named("names", this.names, "Names of the bodies"),
      named("colours of this time", this.own, "Colours from the least to the largest value of this time, not of all times"),
      element("span", { class: "views" }, ...views));
    this.bar = element("div", { class: "bar" });
    this.barWords = [element("span"), element("span"), element("span")];
    this.colours = element("div", { class: "colours" }, this.bar, element("div", { class: "barwords" }, ...this.barWords));
    this.said = element("p", { class: "said", "aria-live": "polite" });
  }

  listen() {
    let last = null;
    const place = (event) => {
      const box = this.canvas.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    this.canvas.addEventListener("pointerdown", (event) => {
      last = place(event);
      this.canvas.setPointerCapture(event.pointerId);
    });
    this.canvas.addEventListener("pointermove", (event) => {
      const at = place(event);
      if (last) {
        this.whole = false;
        this.picture.moveBy((at[0] - last[0]) * this.picture.ratio, (at[1] - last[1]) * this.picture.ratio);
        last = at;
        this.show();
      }
      this.pointed(at);
    });
    for (const end of ["pointerup", "pointercancel"]) this.canvas.addEventListener(end, () => { last = null; });
    this.canvas.addEventListener("pointerleave", () => { this.tip.hidden = true; });
    this.canvas.addEventListener("wheel", (event) => {
      // A page that scrolls is not held up: the wheel zooms a picture that was clicked, or with the control key.
      if (!event.ctrlKey && document.activeElement !== this.canvas) return;
      event.preventDefault();
      this.whole = false;
      const [px, py] = place(event);
      this.picture.zoomBy(Math.exp(event.deltaY * 0.002), px * this.picture.ratio, py * this.picture.ratio);
      this.show();
    }, { passive: false });
    this.canvas.addEventListener("dblclick", () => this.look("whole"));
    this.canvas.addEventListener("keydown", (event) => {
      const act = { " ": () => this.toggle(), ArrowLeft: () => this.step(-1), ArrowRight: () => this.step(1),
        Home: () => this.go(0), End: () => this.go(this.times.length - 1), "+": () => this.zoom(0.75),
        "-": () => this.zoom(1.333), 0: () => this.look("whole"), c: () => this.look("contact"),
        m: () => { this.lines.checked = !this.lines.checked; this.show(); } }[event.key];
      if (!act) return;
      event.preventDefault();
      act();
    });
  }

  toggle() {
    if (this.timer) { this.pause(); return; }
    if (this.frame === this.times.length - 1) this.go(0);
    this.play.textContent = "❚❚";
    this.timer = setInterval(() => {
      if (this.frame === this.times.length - 1) this.pause(); else this.go(this.frame + 1);
    }, FRAME_MS);
  }

  pause() {
    clearInterval(this.timer);
    this.timer = null;
    this.play.textContent = "▶";
  }

  step(by) {
    this.pause();
    this.go(Math.min(Math.max(this.frame + by, 0), this.times.length - 1));
  }

  go(frame) {
    this.clock.setTime(this.times[frame]);
  }

  follow(t) {
    const frame = nearest(this.times, t);
    if (frame === this.frame) return;
    this.frame = frame;
    this.slider.value = frame;
    this.show();
  }

  table(k) {
    if (!this.tables.has(k)) {
      const { values, parts } = this.fields[k];
      this.tables.set(k, { values: tableOf(values, this.data.numbers),
        parts: parts && parts.map((part) => tableOf(part, this.data.numbers)) });
    }
    return this.tables.get(k);
  }

  chooseField() {
    const field = this.fields[Number(this.field.value)];
    this.bar.style.background = `linear-gradient(to right, ${this.data.meta.maps[field.map].join(",")})`;
    if (this.onField) this.onField(field);
    this.show();
  }

  look(what) {
    const scale = Number(this.scale.value);
    this.whole = what === "whole";
    this.picture.lookAt(what === "contact" && this.picture.pairNodes.length
      ? this.picture.contactBox(this.frame, scale, this.pressed ? this.pressed(this.clock.t) : [])
      : this.picture.wholeBox(scale));
    this.show();
  }

  zoom(factor) {
    this.whole = false;
    this.picture.zoomBy(factor, this.canvas.width / 2, this.canvas.height / 2);
    this.show();
  }

  /** The canvas takes the width there is, and the height that the bodies need of it. */
  fit() {
    const width = this.stage.clientWidth, ratio = Math.min(window.devicePixelRatio || 1, 2);
    if (!width) return;
    const box = this.picture.wholeBox(1), shape = (box[3] - box[1]) / Math.max(box[2] - box[0], 1e-12);
    const height = Math.round(Math.min(Math.max(width * shape, 190), 480, 0.62 * Math.max(window.innerHeight, 500)));
    if (!this.picture.view) {
      this.picture.lookAt(this.picture.wholeBox(Number(this.scale.value)));
      this.whole = true;
    }
    this.canvas.style.height = `${height}px`;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    this.show();
  }

  show() {
    if (this.frame < 0 || !this.canvas.width || !this.picture.view) return;
    const k = Number(this.field.value), field = this.fields[k], values = this.table(k).values[this.frame];
    let { low, high } = field;
    if (this.own.checked) [low, high] = extent(values);
    const scale = Number(this.scale.value), arrows = Number(this.arrows.value);
    this.picture.draw(this.frame, { values, onCells: field.on === "cells", map: field.map, low, high, scale,
      lines: this.lines.checked, names: this.names.checked, arrows: arrows < 0 ? null : this.arrowsOf(arrows) });
    [low, (low + high) / 2, high].forEach((v, i) => { this.barWords[i].textContent = shownNumber(v, 4); });
    this.barWords[0].textContent = (field.clipped[0] && !this.own.checked ? "≤ " : "") + this.barWords[0].textContent;
    this.barWords[2].textContent = `${field.clipped[1] && !this.own.checked ? "≥ " : ""}${this.barWords[2].textContent} ${field.unit}`;
    this.time.textContent = `t = ${shownNumber(this.times[this.frame], 7)} s`;
    const [least, largest] = extent(values);
    const about = `${field.title} at t = ${shownNumber(this.times[this.frame], 7)} s: ${shownNumber(least)} to `
      + `${shownNumber(largest)} ${field.unit}`;
    const drawn = scale === 1 ? "" : ` Deformations are drawn ${scale} times as large as they are: gaps and overlaps of the`
      + " picture are not those of the bodies.";
    this.said.textContent = `${about}. Picture ${this.frame + 1} of ${this.times.length}.${drawn}`;
    this.canvas.setAttribute("aria-label", about);
    this.keepChoices(field, arrows);
  }

  keepChoices(field, arrows) {
    const choices = { field: field === this.fields[0] ? null : field.name,
      arrows: arrows < 0 ? null : this.fields[arrows].name, scale: this.scale.value === "1" ? null : this.scale.value,
      lines: this.lines.checked ? "1" : null, names: this.names.checked ? null : "0", own: this.own.checked ? "1" : null };
    for (const [key, value] of Object.entries(choices)) {
      if ((this.clock.state[key] ?? null) !== value) this.clock.keep(key, value);
    }
  }

  arrowsOf(k) {
    const [u, v] = this.table(k).parts.map((rows) => rows[this.frame]);
    let largest = 0;
    for (let i = 0; i < u.length; i++) {
      const size = Math.hypot(u[i], v[i]);
      if (size > largest) largest = size;
    }
    return { parts: [u, v], onCells: this.fields[k].on === "cells", largest };
  }

  pointed([px, py]) {
    const found = this.picture.raster && this.picture.raster.at(px * this.picture.ratio, py * this.picture.ratio);
    this.tip.hidden = !found;
    if (!found) return;
    const field = this.fields[Number(this.field.value)];
    this.tip.replaceChildren(element("strong", { text: `${shownNumber(found.value, 5)} ${field.unit}` }),
      element("div", { text: this.picture.bodies[found.body] }));
    const right = px > this.stage.clientWidth / 2;
    this.tip.style.left = `${right ? px - this.tip.offsetWidth - 12 : px + 12}px`;
    this.tip.style.top = `${Math.max(0, py - 20)}px`;
  }
}

function extent(values) {
  let low = Infinity, high = -Infinity;
  for (const v of values) {
    if (v < low) low = v;
    if (v > high) high = v;
  }
  return low > high ? [0, 1] : [low, high];
}

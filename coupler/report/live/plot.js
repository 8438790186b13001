// A chart of curves in SVG: axes, a legend that hides curves, values under the pointer, a cursor, zoom by dragging.

const SPACE = { left: 58, right: 14, top: 12, bottom: 40 };
const TITLE = 28, LETTER = 7; // pixels: beside the axis' name, and of a digit
const COLOURS = ["var(--c0)", "var(--c1)", "var(--c2)", "var(--c3)", "var(--c4)", "var(--c5)", "var(--c6)"];
const DASHES = ["", "7 4", "2 3", "8 3 2 3"];
const PAPER = 700; // pixels between the margins of a sheet
let plotsMade = 0;

/**
 * options: {x, xLabel, yLabel, series: [{name, y, band}], marks: [x], height, label,
 *           pick(x), zoom([a, b] or null), keys(event)}
 * A band is the half width of what surrounds a curve, per point.  `pick` is called with the x that was clicked.
 */
class Plot {
  constructor(host, options) {
    Object.assign(this, { height: 260, marks: [], digits: 5 }, options);
    this.id = `plot${plotsMade++}`;
    this.hidden = new Set();
    this.cursor = null;
    this.given = null;
    this.range = [this.x[0], this.x[this.x.length - 1]];
    this.svg = drawn("svg", { class: "plot", role: "img", tabindex: 0, "aria-label": this.label });
    this.tip = element("div", { class: "tip", hidden: true });
    this.legend = element("div", { class: "legend" });
    this.left = SPACE.left;
    host.append(element("div", { class: "plotbox" }, this.svg, this.tip), this.legend);
    this.makeLegend();
    this.listen();
    new ResizeObserver(() => this.draw()).observe(host);
    this.draw();
  }

  makeLegend() {
    this.values = this.series.map(() => element("span", { class: "value" }));
    this.legend.replaceChildren(...this.series.map((s, k) => {
      const line = drawn("svg", { width: 26, height: 10, "aria-hidden": true });
      line.append(drawn("line", { x1: 0, x2: 26, y1: 5, y2: 5, ...this.look(k) }));
      const entry = element("button", { type: "button", "aria-pressed": true, title: "Show or hide this curve",
        onclick: () => this.toggle(k, entry) }, line, element("span", { text: s.name }), this.values[k]);
      return entry;
    }));
  }

  toggle(k, entry) {
    if (this.hidden.has(k)) this.hidden.delete(k); else this.hidden.add(k);
    entry.setAttribute("aria-pressed", !this.hidden.has(k));
    this.draw();
  }

  look(k) {
    return { stroke: COLOURS[k % COLOURS.length], "stroke-dasharray": DASHES[k % DASHES.length],
      "stroke-width": k % DASHES.length ? 1.6 : 2.2, fill: "none" };
  }

  /** Shows other curves over other x, with the same look. */
  setData(x, ys) {
    this.x = x;
    this.series.forEach((s, k) => { s.y = ys[k]; });
    this.draw();
  }

  setRange(range) {
    this.range = range;
    this.draw();
  }

  setCursor(x) {
    this.cursor = x;
    this.drawCursor();
  }

  shownSeries() {
    return this.series.map((s, k) => ({ ...s, k })).filter((s) => !this.hidden.has(s.k));
  }

  /** Least and largest value in view; with some room, and never without height. */
  heights() {
    if (this.fixed) return this.fixed;
    let low = Infinity, high = -Infinity;
    for (const { y, band } of this.shownSeries()) {
      for (let i = 0; i < this.x.length; i++) {
        if (this.x[i] < this.range[0] || this.x[i] > this.range[1] || !Number.isFinite(y[i])) continue;
        const wide = band && Number.isFinite(band[i]) ? band[i] : 0;
        low = Math.min(low, y[i] - wide);
        high = Math.max(high, y[i] + wide);
      }
    }
    if (low > high) return [0, 1];
    const room = 0.06 * (high - low) || 0.05 * Math.abs(high) || 1;
    return [low - room, high + room];
  }

  /** Draws with a width in pixels, null: that of its place in the page. */
  drawFor(width) {
    this.given = width;
    this.draw();
  }

  draw() {
    const width = this.width = this.given || Math.max(this.svg.parentNode.clientWidth, 200);
    const [low, high] = this.heights();
    // As wide as the longest number beside the axis, so that none is cut off or lies across the axis' name.
    const longest = Math.max(...ticksOf(low, high, 5).map((y) => tickNumber(y).length));
    this.left = Math.max(SPACE.left, TITLE + LETTER * longest);
    const across = width - this.left - SPACE.right, up = this.height - SPACE.top - SPACE.bottom;
    this.toX = (x) => this.left + across * (x - this.range[0]) / (this.range[1] - this.range[0]);
    this.fromX = (px) => this.range[0] + (px - this.left) / across * (this.range[1] - this.range[0]);
    this.toY = (y) => SPACE.top + up * (high - y) / (high - low);
    this.svg.setAttribute("viewBox", `0 0 ${width} ${this.height}`);
    const parts = [...this.axes(low, high)];
    const clip = drawn("clipPath", { id: this.id });
    clip.append(drawn("rect", { x: this.left, y: SPACE.top - 2, width: across, height: up + 4 }));
    const curves = drawn("g", { "clip-path": `url(#${this.id})` });
    for (const mark of this.marks) {
      curves.append(drawn("line", { class: "mark", x1: this.toX(mark), x2: this.toX(mark), y1: SPACE.top,
        y2: this.height - SPACE.bottom }));
    }
    for (const s of this.shownSeries()) {
      if (s.band) curves.append(drawn("path", { d: this.bandOf(s), class: "band", fill: COLOURS[s.k % COLOURS.length] }));
      curves.append(drawn("path", { d: this.pathOf(s.y), class: "curve", ...this.look(s.k) }));
    }
    this.cursorLine = drawn("line", { class: "cursor", y1: SPACE.top, y2: this.height - SPACE.bottom });
    this.hover = drawn("line", { class: "hover", y1: SPACE.top, y2: this.height - SPACE.bottom, visibility: "hidden" });
    this.band = drawn("rect", { class: "picked", y: SPACE.top, height: up, visibility: "hidden" });
    curves.append(this.band, this.hover, this.cursorLine);
    this.svg.replaceChildren(clip, ...parts, curves);
    this.drawCursor();
  }

  *axes(low, high) {
    const bottom = this.height - SPACE.bottom;
    for (const y of ticksOf(low, high, 5)) {
      yield drawn("line", { class: "grid", x1: this.left, x2: this.width - SPACE.right, y1: this.toY(y), y2: this.toY(y) });
      yield drawn("text", { class: "tick", x: this.left - 6, y: this.toY(y) + 4, "text-anchor": "end",
        text: tickNumber(y) });
    }
    const count = Math.max(2, Math.floor((this.width - 80) / 110));
    for (const x of ticksOf(this.range[0], this.range[1], count)) {
      yield drawn("line", { class: "grid", x1: this.toX(x), x2: this.toX(x), y1: SPACE.top, y2: bottom });
      // A number at the very end would stand out of the picture.
      yield drawn("text", { class: "tick", x: this.toX(x), y: bottom + 16, text: shownNumber(x, 7),
        "text-anchor": this.toX(x) > this.width - 40 ? "end" : "middle" });
    }
    yield drawn("text", { class: "name", x: (this.left + this.width - SPACE.right) / 2, y: this.height - 5,
      "text-anchor": "middle", text: this.xLabel });
    yield drawn("text", { class: "name", "text-anchor": "middle", text: this.yLabel,
      transform: `translate(12 ${(SPACE.top + bottom) / 2}) rotate(-90)` });
  }

  pathOf(y) {
    let d = "", pen = "M";
    for (let i = 0; i < this.x.length; i++) {
      if (!Number.isFinite(y[i])) { pen = "M"; continue; }
      d += `${pen}${this.toX(this.x[i]).toFixed(1)} ${this.toY(y[i]).toFixed(1)}`;
      pen = "L";
    }
    return d;
  }

  bandOf({ y, band }) {
    let above = "", below = "";
    for (let i = 0; i < this.x.length; i++) {
      if (!Number.isFinite(y[i]) || !Number.isFinite(band[i])) continue;
      const x = this.toX(this.x[i]).toFixed(1);
      above += `${above ? "L" : "M"}${x} ${this.toY(y[i] + band[i]).toFixed(1)}`;
      below = `L${x} ${this.toY(y[i] - band[i]).toFixed(1)}${below}`;
    }
    return above && `${above}${below}Z`;
  }

  drawCursor() {
    const at = this.cursor, seen = at !== null && at >= this.range[0] && at <= this.range[1];
    this.cursorLine.setAttribute("visibility", seen ? "visible" : "hidden");
    if (seen) for (const end of ["x1", "x2"]) this.cursorLine.setAttribute(end, this.toX(at));
    const i = at === null ? -1 : nearest(this.x, at);
    this.series.forEach((s, k) => { this.values[k].textContent = i < 0 ? "" : shownNumber(s.y[i], this.digits); });
  }

  listen() {
    let from = null;
    const place = (event) => event.clientX - this.svg.getBoundingClientRect().left;
    this.svg.addEventListener("pointerdown", (event) => {
      from = place(event);
      this.svg.setPointerCapture(event.pointerId);
    });
    this.svg.addEventListener("pointermove", (event) => {
      const at = place(event);
      this.showTip(at);
      if (from !== null && this.zoom && Math.abs(at - from) > 4) {
        this.band.setAttribute("visibility", "visible");
        this.band.setAttribute("x", Math.min(at, from));
        this.band.setAttribute("width", Math.abs(at - from));
      }
    });
    this.svg.addEventListener("pointerup", (event) => {
      const at = place(event), begun = from;
      from = null;
      this.band.setAttribute("visibility", "hidden");
      if (begun === null) return;
      if (this.zoom && Math.abs(at - begun) > 8) {
        this.zoom([this.fromX(Math.min(at, begun)), this.fromX(Math.max(at, begun))]);
      } else if (this.pick) {
        this.pick(this.x[nearest(this.x, this.fromX(at))]);
      }
    });
    for (const gone of ["pointerleave", "pointercancel"]) {
      this.svg.addEventListener(gone, () => { from = null; this.hideTip(); });
    }
    this.svg.addEventListener("dblclick", () => this.zoom && this.zoom(null));
    this.svg.addEventListener("keydown", (event) => this.keys && this.keys(event));
  }

  showTip(px) {
    const i = nearest(this.x, this.fromX(px)), at = this.toX(this.x[i]);
    if (at < this.left - 1 || at > this.width - SPACE.right + 1) { this.hideTip(); return; }
    for (const end of ["x1", "x2"]) this.hover.setAttribute(end, at);
    this.hover.setAttribute("visibility", "visible");
    const rows = this.shownSeries().map((s) => {
      const swatch = element("i");
      swatch.style.background = COLOURS[s.k % COLOURS.length];
      return element("div", {}, swatch, `${s.name}: ${shownNumber(s.y[i], this.digits)}`);
    });
    this.tip.replaceChildren(element("strong", { text: `${this.xLabel.split(" [")[0]} ${shownNumber(this.x[i], 7)}` }), ...rows);
    this.tip.hidden = false;
    const left = at > this.width / 2 ? at - this.tip.offsetWidth - 10 : at + 10;
    this.tip.style.left = `${Math.max(0, Math.min(left, this.width - this.tip.offsetWidth))}px`;
  }

  hideTip() {
    this.tip.hidden = true;
    this.hover.setAttribute("visibility", "hidden");
    this.band.setAttribute("visibility", "hidden");
  }
}

// Draws the bodies at one frame: colours of a field, mesh lines, outlines, arrows, names; and where the view looks.

const ARROW_EVERY = 30, ARROW_LONGEST = 34, ARROW_LEAST = 0.12; // pixels, pixels, share of the longest
const EDGE = 0.06; // of the size of what is shown, left free around it

/** The bodies as a picture on a canvas.  data: {meta, numbers} of the page. */
class Picture {
  constructor(canvas, data) {
    this.canvas = canvas;
    const { mesh, frames, maps } = data.meta;
    this.X = data.numbers(mesh.X);
    this.quads = data.numbers(mesh.quads);
    this.triangles = data.numbers(mesh.triangles);
    this.owner = data.numbers(mesh.owner);
    this.nodeBody = data.numbers(mesh.node_body);
    this.outline = data.numbers(mesh.outline);
    this.pairNodes = mesh.pairs.map((ref) => data.numbers(ref));
    this.bodies = mesh.bodies;
    Object.assign(this, trianglesOf(this.quads, this.triangles));
    this.means = data.numbers(frames.means);
    this.own = frames.own.map((table) => tableOf(table, data.numbers));
    this.tables = Object.fromEntries(Object.entries(maps).map(([name, colours]) => [name, colourTable(colours)]));
    // Not the length of frames.t, which is a reference into the numbers of the page.
    this.count = data.numbers(frames.t).length;
    this.view = null;
  }

  /**
   * Where the nodes are drawn, as [x, y] in m: displacements beyond the mean of their body are magnified.
   */
  positions(frame, scale) {
    const n = this.nodeBody.length, x = new Float64Array(n), y = new Float64Array(n);
    const first = frame * this.bodies.length;
    const [ux, uy] = this.own.map((rows) => rows[frame]);
    for (let k = 0; k < n; k++) {
      const b = 2 * (first + this.nodeBody[k]);
      x[k] = this.X[2 * k] + this.means[b] + scale * ux[k];
      y[k] = this.X[2 * k + 1] + this.means[b + 1] + scale * uy[k];
    }
    return [x, y];
  }

  /** Looks at a box [left, low, right, high] in m; null: at all bodies in all frames. */
  lookAt(box) {
    this.view = box && { x: (box[0] + box[2]) / 2, y: (box[1] + box[3]) / 2,
      width: Math.max(box[2] - box[0], 1e-9), height: Math.max(box[3] - box[1], 1e-9) };
  }

  wholeBox(scale) {
    const box = [Infinity, Infinity, -Infinity, -Infinity];
    for (let f = 0; f < this.count; f++) enclose(box, ...this.positions(f, scale));
    return box;
  }

  /** The box around contact at a frame: the pressed nodes of slave surfaces, or all of them where none is pressed. */
  contactBox(frame, scale, pressed) {
    const box = [Infinity, Infinity, -Infinity, -Infinity], [x, y] = this.positions(frame, scale);
    const some = pressed.some((nodes) => nodes.length);
    for (const nodes of some ? pressed : this.pairNodes) {
      enclose(box, Array.from(nodes, (k) => x[k]), Array.from(nodes, (k) => y[k]));
    }
    const room = 0.35 * Math.max(box[2] - box[0], box[3] - box[1], 1e-6);
    return [box[0] - room, box[1] - room, box[2] + room, box[3] + room];
  }

  /** Pixels of the canvas a metre, and the place of x = y = 0. */
  place() {
    const { width, height } = this.canvas, v = this.view;
    const free = 1 + 2 * EDGE;
    const zoom = Math.min(width / (v.width * free), height / (v.height * free));
    return { zoom, x0: width / 2 - v.x * zoom, y0: height / 2 + v.y * zoom };
  }

  zoomBy(factor, px, py) {
    const { zoom, x0, y0 } = this.place();
    const [x, y] = [(px - x0) / zoom, (y0 - py) / zoom], v = this.view;
    this.view = { x: x + (v.x - x) * factor, y: y + (v.y - y) * factor, width: v.width * factor,
      height: v.height * factor };
  }

  moveBy(dx, dy) {
    const { zoom } = this.place();
    this.view = { ...this.view, x: this.view.x - dx / zoom, y: this.view.y + dy / zoom };
  }

  /** Draws a frame.  look: {values, onCells, map, low, high, scale, lines, names, arrows: [x, y] of cells or nodes}. */
  draw(frame, look) {
    const { width, height } = this.canvas, context = this.canvas.getContext("2d", { willReadFrequently: true });
    const [x, y] = this.positions(frame, look.scale), { zoom, x0, y0 } = this.place();
    for (let k = 0; k < x.length; k++) { x[k] = x0 + zoom * x[k]; y[k] = y0 - zoom * y[k]; }
    if (!this.raster || this.raster.width !== width || this.raster.height !== height) {
      this.raster = new Raster(width, height);
      this.image = context.createImageData(width, height);
    }
    this.raster.paint({ x, y, corners: this.corners, cell: this.cell, owner: this.owner, values: look.values,
      onCells: look.onCells });
    this.raster.colour(this.image, this.tables[look.map], look.low, look.high);
    context.putImageData(this.image, 0, 0);
    this.ratio = width / Math.max(this.canvas.clientWidth, 1);
    if (look.lines) this.stroke(context, x, y, this.cellEdges(), "rgba(255,255,255,0.45)", 0.6);
    this.stroke(context, x, y, this.outline, getComputedStyle(this.canvas).color, 1.2);
    if (look.arrows) this.drawArrows(context, x, y, look);
    if (look.names) this.drawNames(context, x, y);
  }

  stroke(context, x, y, edges, colour, wide) {
    context.strokeStyle = colour;
    context.lineWidth = wide * this.ratio;
    context.beginPath();
    for (let k = 0; k < edges.length; k += 2) {
      context.moveTo(x[edges[k]], y[edges[k]]);
      context.lineTo(x[edges[k + 1]], y[edges[k + 1]]);
    }
    context.stroke();
  }

  cellEdges() {
    if (!this.edges) {
      const found = [];
      const add = (cells, corners) => {
        for (let k = 0; k < cells.length; k += corners) {
          for (let i = 0; i < corners; i++) found.push(cells[k + i], cells[k + (i + 1) % corners]);
        }
      };
      add(this.quads, 4);
      add(this.triangles, 3);
      this.edges = Uint32Array.from(found);
    }
    return this.edges;
  }

  /** Arrows as long as their size: one in each square of the picture, of the point nearest to its middle. */
  drawArrows(context, x, y, look) {
    const [u, v] = look.arrows.parts, every = ARROW_EVERY * this.ratio, chosen = new Map();
    const middles = look.arrows.onCells ? this.middles(x, y) : [x, y];
    for (let k = 0; k < u.length; k++) {
      const [px, py] = [middles[0][k], middles[1][k]];
      if (px < 0 || py < 0 || px > this.canvas.width || py > this.canvas.height) continue;
      const i = Math.floor(px / every), j = Math.floor(py / every);
      const off = Math.hypot(px - (i + 0.5) * every, py - (j + 0.5) * every), key = j * 10000 + i;
      if (!chosen.has(key) || chosen.get(key).off > off) chosen.set(key, { off, k, px, py });
    }
    const longest = look.arrows.largest || 1, length = ARROW_LONGEST * this.ratio;
    context.lineCap = "round";
    for (const pass of [{ colour: "rgba(0,0,0,0.75)", wide: 3.2 }, { colour: "#fff", wide: 1.5 }]) {
      context.strokeStyle = pass.colour;
      context.lineWidth = pass.wide * this.ratio;
      context.beginPath();
      for (const { k, px, py } of chosen.values()) {
        const size = Math.hypot(u[k], v[k]);
        if (!(size > ARROW_LEAST * longest)) continue;
        const l = length * Math.min(size / longest, 1), ex = l * u[k] / size, ey = -l * v[k] / size;
        const [tx, ty] = [px + ex / 2, py + ey / 2];
        context.moveTo(px - ex / 2, py - ey / 2);
        context.lineTo(tx, ty);
        for (const side of [-1, 1]) {
          context.moveTo(tx, ty);
          context.lineTo(tx - 0.3 * ex + side * 0.18 * ey, ty - 0.3 * ey - side * 0.18 * ex);
        }
      }
      context.stroke();
    }
  }

  middles(x, y) {
    const nq = this.quads.length / 4, n = nq + this.triangles.length / 3, found = [new Float64Array(n), new Float64Array(n)];
    for (let k = 0; k < n; k++) {
      const nodes = k < nq ? this.quads.subarray(4 * k, 4 * k + 4)
        : this.triangles.subarray(3 * (k - nq), 3 * (k - nq) + 3);
      [x, y].forEach((at, c) => {
        for (const node of nodes) found[c][k] += at[node] / nodes.length;
      });
    }
    return found;
  }

  /** Whether a point is inside the box around a cell. */
  inBox(k, x, y, px, py) {
    const nq = this.quads.length / 4;
    const nodes = k < nq ? this.quads.subarray(4 * k, 4 * k + 4) : this.triangles.subarray(3 * (k - nq), 3 * (k - nq) + 3);
    const within = (at, p) => Math.min(...Array.from(nodes, (n) => at[n])) <= p && p <= Math.max(...Array.from(nodes, (n) => at[n]));
    return within(x, px) && within(y, py);
  }

  /** Names stand in the middle of what is seen of their body, or on its nearest cell where the middle is not in it. */
  drawNames(context, x, y) {
    const [cx, cy] = this.middles(x, y), { width, height } = this.canvas;
    context.font = `600 ${14 * this.ratio}px system-ui, sans-serif`;
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.lineJoin = "round";
    this.bodies.forEach((name, b) => {
      const seen = [];
      for (let k = 0; k < cx.length; k++) {
        if (this.owner[k] === b && cx[k] > 0 && cy[k] > 0 && cx[k] < width && cy[k] < height) seen.push(k);
      }
      if (!seen.length) return;
      const mean = (at) => seen.reduce((sum, k) => sum + at[k], 0) / seen.length, mx = mean(cx), my = mean(cy);
      const far = (k) => Math.hypot(cx[k] - mx, cy[k] - my);
      const best = seen.reduce((a, k) => (far(k) < far(a) ? k : a));
      const half = context.measureText(name).width / 2 + 4 * this.ratio;
      const [nx, ny] = this.inBox(best, x, y, mx, my) ? [mx, my] : [cx[best], cy[best]];
      const px = Math.min(Math.max(nx, half), width - half);
      context.lineWidth = 4 * this.ratio;
      context.strokeStyle = "rgba(0,0,0,0.65)";
      context.strokeText(name, px, ny);
      context.fillStyle = "#fff";
      context.fillText(name, px, ny);
    });
  }
}

function enclose(box, x, y) {
  for (let k = 0; k < x.length; k++) {
    box[0] = Math.min(box[0], x[k]);
    box[1] = Math.min(box[1], y[k]);
    box[2] = Math.max(box[2], x[k]);
    box[3] = Math.max(box[3], y[k]);
  }
}

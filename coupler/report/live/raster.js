// Paints values on triangles, pixel by pixel, and remembers the value and the body of each pixel for the pointer.

/** Returns 256 packed colours from a list of "#rrggbb". */
function colourTable(colours) {
  const table = new Uint32Array(256);
  for (let k = 0; k < 256; k++) {
    const at = k / 255 * (colours.length - 1), i = Math.min(Math.floor(at), colours.length - 2), share = at - i;
    const part = (colour, c) => Number.parseInt(colour.slice(1 + 2 * c, 3 + 2 * c), 16);
    const mixed = [0, 1, 2].map((c) => Math.round((1 - share) * part(colours[i], c) + share * part(colours[i + 1], c)));
    table[k] = (255 << 24 | mixed[2] << 16 | mixed[1] << 8 | mixed[0]) >>> 0;
  }
  return table;
}

const NO_VALUE = 0xff999999;

class Raster {
  constructor(width, height) {
    this.width = width;
    this.height = height;
    this.value = new Float32Array(width * height);
    this.body = new Uint8Array(width * height);
  }

  /**
   * Paints triangles.  x, y: pixels of each node.  corners: three nodes a triangle.  cell: the cell of each triangle.
   * owner: the body of each cell.  values: of nodes, or of cells where onCells.
   */
  paint({ x, y, corners, cell, owner, values, onCells }) {
    this.body.fill(0);
    for (let k = 0; k < cell.length; k++) {
      const [a, b, c] = [corners[3 * k], corners[3 * k + 1], corners[3 * k + 2]];
      const v = onCells ? [values[cell[k]], 0, 0] : [values[a], values[b], values[c]];
      if (onCells) v[1] = v[2] = v[0];
      this.triangle([x[a], x[b], x[c]], [y[a], y[b], y[c]], v, owner[cell[k]] + 1);
    }
  }

  triangle(x, y, v, body) {
    const area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]);
    if (area === 0) return;
    const left = Math.max(0, Math.ceil(Math.min(...x) - 0.5)), right = Math.min(this.width - 1, Math.floor(Math.max(...x)));
    const top = Math.max(0, Math.ceil(Math.min(...y) - 0.5)), bottom = Math.min(this.height - 1, Math.floor(Math.max(...y)));
    // Shares of corners 1 and 2 at a pixel, and how they grow from pixel to pixel.
    const dx = [(y[2] - y[0]) / area, -(y[1] - y[0]) / area], dy = [-(x[2] - x[0]) / area, (x[1] - x[0]) / area];
    const near = -1e-4;
    for (let j = top; j <= bottom; j++) {
      const py = j + 0.5 - y[0];
      for (let i = left; i <= right; i++) {
        const px = i + 0.5 - x[0];
        const s = px * dx[0] + py * dy[0], r = px * dx[1] + py * dy[1];
        if (s < near || r < near || s + r > 1 - near) continue;
        const at = j * this.width + i;
        this.value[at] = v[0] + s * (v[1] - v[0]) + r * (v[2] - v[0]);
        this.body[at] = body;
      }
    }
  }

  /** Turns values into colours of an ImageData of the same size. */
  colour(image, table, low, high) {
    const pixels = new Uint32Array(image.data.buffer), per = 255.999 / (high - low || 1);
    for (let at = 0; at < pixels.length; at++) {
      if (!this.body[at]) { pixels[at] = 0; continue; }
      const v = this.value[at];
      pixels[at] = Number.isNaN(v) ? NO_VALUE : table[Math.max(0, Math.min(255, (v - low) * per | 0))];
    }
  }

  /** Returns {value, body} under a pixel, or null outside of all bodies. */
  at(px, py) {
    if (px < 0 || py < 0 || px >= this.width || py >= this.height) return null;
    const at = Math.floor(py) * this.width + Math.floor(px);
    return this.body[at] ? { value: this.value[at], body: this.body[at] - 1 } : null;
  }
}

/** Returns triangles of a mesh: {corners, cell}; a quad is two of them. */
function trianglesOf(quads, triangles) {
  const nq = quads.length / 4, nt = triangles.length / 3;
  const corners = new Uint32Array(6 * nq + 3 * nt), cell = new Uint32Array(2 * nq + nt);
  for (let k = 0; k < nq; k++) {
    const [a, b, c, d] = quads.subarray(4 * k, 4 * k + 4);
    corners.set([a, b, c, a, c, d], 6 * k);
    cell[2 * k] = cell[2 * k + 1] = k;
  }
  corners.set(triangles, 6 * nq);
  for (let k = 0; k < nt; k++) cell[2 * nq + k] = nq + k;
  return { corners, cell };
}

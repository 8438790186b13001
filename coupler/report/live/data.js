// Reads what the page carries: one block of JSON, and one packed block of numbers that it refers to.

const TYPES = { f8: Float64Array, f4: Float32Array, u4: Uint32Array, u1: Uint8Array };

/** Unpacks base64 of zlib to bytes. */
async function unpacked(text) {
  const packed = Uint8Array.from(atob(text.trim()), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Returns {meta, numbers}: numbers(ref) is the array that a reference [type, first byte, length] names. */
async function readPage() {
  const meta = JSON.parse(document.getElementById("run-data").textContent);
  const bytes = await unpacked(document.getElementById("run-numbers").textContent);
  const numbers = ([type, first, length]) => {
    const Type = TYPES[type];
    return new Type(bytes.slice(first, first + length * Type.BYTES_PER_ELEMENT).buffer);
  };
  return { meta, numbers };
}

/**
 * Returns rows of values (Float32Array each) of a quantised table: high bytes, then low bytes, each row stored as the
 * difference from the row before.  65535 stands for "no value".
 */
function tableOf(table, numbers) {
  const { rows, columns, low, high } = table;
  const bytes = numbers(table.values);
  const n = rows * columns, step = (high - low) / 65534;
  const found = [];
  const code = new Uint16Array(columns);
  for (let r = 0; r < rows; r++) {
    const row = new Float32Array(columns);
    for (let c = 0; c < columns; c++) {
      const k = r * columns + c;
      code[c] = (code[c] + 256 * bytes[k] + bytes[n + k]) & 65535;
      row[c] = code[c] === 65535 ? NaN : low + step * code[c];
    }
    found.push(row);
  }
  return found;
}

/** Returns the number of the entry of an ascending array that is nearest to a value. */
function nearest(sorted, value) {
  let low = 0, high = sorted.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (sorted[middle] <= value) low = middle; else high = middle;
  }
  return value - sorted[low] <= sorted[high] - value ? low : high;
}

/** A number for reading, with so many digits; no exponent where none is needed. */
function shownNumber(value, digits = 4) {
  if (!Number.isFinite(value)) return "none";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-4 || size >= 1e6)) return value.toExponential(digits - 1).replace("e+", "e");
  return String(Number(value.toPrecision(digits)));
}

/** A number as short as it can be on an axis: 2e7, -1.5e-5, 120000. */
function tickNumber(value) {
  return Math.abs(value) < 1e5 ? shownNumber(value, 6).replace(/\.?0+e/, "e")
    : value.toExponential(5).replace(/\.?0+e/, "e").replace("e+", "e");
}

/** Round values for an axis: about `count` of them from low to high. */
function ticksOf(low, high, count) {
  const raw = (high - low) / Math.max(count, 1);
  if (!(raw > 0)) return [low];
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].find((m) => m * power >= raw * 0.999) * power;
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return found;
}

/** Makes an element: element("div", {class: "a", text: "b"}, child, ...). */
function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  apply(made, attributes);
  made.append(...children);
  return made;
}

/** The same in the namespace of SVG. */
function drawn(name, attributes = {}) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  apply(made, attributes);
  return made;
}

function apply(made, attributes) {
  for (const [key, value] of Object.entries(attributes)) {
    if (key === "text") made.textContent = value;
    else if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (value !== false && value !== null) made.setAttribute(key, value === true ? "" : value);
  }
}

// Small PNGs, read and written: the textures in the file and the images of strokes that were
// changed.

const PNG_HEAD = [137, 80, 78, 71, 13, 10, 26, 10];
const CRC = Int32Array.from({ length: 256 }, (_, n) => {
  for (let k = 0; k < 8; k++) n = n & 1 ? (n >>> 1) ^ 0xedb88320 : n >>> 1;
  return n;
});

async function piped(bytes, stream) {
  return new Uint8Array(
    await new Response(new Blob([bytes]).stream().pipeThrough(stream)).arrayBuffer(),
  );
}

function bytesOf(base64) {
  return Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
}

function base64Of(bytes) {
  let text = "";
  for (let i = 0; i < bytes.length; i += 0x8000)
    text += String.fromCharCode(...bytes.subarray(i, i + 0x8000));
  return btoa(text);
}

/**
 * A grey or palette PNG without interlace -> {width, height, index (w * h,), levels, palette}; grey
 * has palette null.
 */
async function readPng(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
  if (PNG_HEAD.some((byte, i) => bytes[i] !== byte)) throw new Error("a texture is no PNG");
  let [width, height, bits, type] = [0, 0, 0, 0];
  let [colors, alphas] = [null, new Uint8Array()];
  const packed = [];
  for (let at = 8; at + 12 <= bytes.length;) {
    const size = view.getUint32(at);
    const name = String.fromCharCode(...bytes.subarray(at + 4, at + 8));
    const body = bytes.subarray(at + 8, at + 8 + size);
    if (name === "IHDR")
      [width, height, bits, type] = [
        view.getUint32(at + 8),
        view.getUint32(at + 12),
        body[8],
        body[9],
      ];
    if (name === "PLTE") colors = body;
    if (name === "tRNS") alphas = body;
    if (name === "IDAT") packed.push(body);
    at += 12 + size;
  }
  if ((type !== 0 && type !== 3) || ![1, 2, 4, 8].includes(bits))
    throw new Error("a texture is neither grey nor palette");
  const raw = await piped(new Blob(packed), new DecompressionStream("deflate"));
  const stride = Math.ceil((width * bits) / 8);
  const index = new Uint8Array(width * height);
  const above = new Uint8Array(stride);
  for (let row = 0; row < height; row++) {
    const line = raw.subarray(row * (stride + 1) + 1, (row + 1) * (stride + 1));
    unfilter(raw[row * (stride + 1)], line, above);
    above.set(line);
    for (let c = 0; c < width; c++) {
      const bit = c * bits;
      index[row * width + c] = (line[bit >> 3] >> (8 - bits - (bit & 7))) & ((1 << bits) - 1);
    }
  }
  let palette = null;
  if (type === 3) {
    palette = Array.from({ length: colors.length / 3 }, (_, k) => [
      ...colors.subarray(3 * k, 3 * k + 3),
      alphas[k] ?? 255,
    ]);
  }
  return { width, height, index, levels: (1 << bits) - 1, palette };
}

function unfilter(kind, line, above) {
  for (let i = 0; kind && i < line.length; i++) {
    const [a, b, c] = [i ? line[i - 1] : 0, above[i], i ? above[i - 1] : 0];
    // no texture has more than 8 bits a pixel, so that the pixel before is the byte before
    if (kind === 1) line[i] += a;
    else if (kind === 2) line[i] += b;
    else if (kind === 3) line[i] += (a + b) >> 1;
    else {
      const p = a + b - c;
      const [pa, pb, pc] = [Math.abs(p - a), Math.abs(p - b), Math.abs(p - c)];
      line[i] += pa <= pb && pa <= pc ? a : pb <= pc ? b : c;
    }
  }
}

/**
 * Indices (h rows of w) and straight RGBA colours, at most 256, -> PNG bytes; `palette` null writes
 * grey, 8 bits.
 */
async function writePng(width, height, index, palette) {
  const bits = !palette || palette.length <= 16 ? 4 : 8;
  const stride = Math.ceil((width * bits) / 8);
  const raw = new Uint8Array(height * (stride + 1));
  for (let row = 0; row < height; row++) {
    for (let c = 0; c < width; c++) {
      const value = index[row * width + c];
      if (bits === 8) raw[row * (stride + 1) + 1 + c] = value;
      else raw[row * (stride + 1) + 1 + (c >> 1)] |= c & 1 ? value : value << 4;
    }
  }
  const head = new Uint8Array(13);
  const view = new DataView(head.buffer);
  view.setUint32(0, width);
  view.setUint32(4, height);
  head.set([bits, palette ? 3 : 0, 0, 0, 0], 8);
  const parts = [Uint8Array.from(PNG_HEAD), pngChunk("IHDR", head)];
  if (palette) {
    parts.push(pngChunk("PLTE", Uint8Array.from(palette.flatMap((color) => color.slice(0, 3)))));
    parts.push(
      pngChunk(
        "tRNS",
        Uint8Array.from(palette, (color) => color[3]),
      ),
    );
  }
  parts.push(
    pngChunk("IDAT", await piped(raw, new CompressionStream("deflate"))),
    pngChunk("IEND", new Uint8Array()),
  );
  return new Uint8Array(await new Blob(parts).arrayBuffer());
}

function pngChunk(name, body) {
  const out = new Uint8Array(body.length + 12);
  const view = new DataView(out.buffer);
  view.setUint32(0, body.length);
  for (let i = 0; i < 4; i++) out[4 + i] = name.charCodeAt(i);
  out.set(body, 8);
  let crc = -1;
  for (let i = 4; i < body.length + 8; i++) crc = CRC[(crc ^ out[i]) & 255] ^ (crc >>> 8);
  view.setUint32(body.length + 8, ~crc >>> 0);
  return out;
}

/**
 * At most `count` straight RGBA colours for premultiplied pixels, a plane a channel: {palette,
 * index of each}.
 */
function quantised([r, g, b, a], count) {
  const cells = new Map(); // pixels alike to 5 bits a channel
  const cellOf = new Int32Array(a.length);
  for (let i = 0; i < a.length; i++) {
    const five = (value) => (value * 31 + 0.5) | 0;
    const key = (five(r[i]) << 15) | (five(g[i]) << 10) | (five(b[i]) << 5) | five(a[i]);
    let cell = cells.get(key);
    if (!cell) cells.set(key, (cell = { k: cells.size, n: 0, sum: [0, 0, 0, 0] }));
    cellOf[i] = cell.k;
    cell.n++;
    cell.sum[0] += r[i];
    cell.sum[1] += g[i];
    cell.sum[2] += b[i];
    cell.sum[3] += a[i];
  }
  // median cut: the box with the widest axis, weighted, is halved until there are enough
  const list = Array.from(cells.values(), (cell) => ({
    ...cell,
    mean: cell.sum.map((value) => value / cell.n),
  }));
  const boxes = [boxed(list)];
  while (boxes.length < count) {
    const widest = boxes.reduce((best, box, i) => (box.weight > boxes[best].weight ? i : best), 0);
    const box = boxes[widest];
    if (!(box.weight > 0)) break;
    const sorted = box.list.sort((p, q) => p.mean[box.axis] - q.mean[box.axis] || p.k - q.k);
    let half = sorted.reduce((sum, cell) => sum + cell.n, 0) / 2;
    let cut = 0;
    while (cut < sorted.length - 1 && (half -= sorted[cut].n) > 0) cut++;
    cut = Math.min(Math.max(cut, 1), sorted.length - 1);
    boxes.splice(widest, 1, boxed(sorted.slice(0, cut)), boxed(sorted.slice(cut)));
  }
  const boxOfCell = new Uint8Array(list.length);
  const palette = boxes.map((box, i) => {
    const sum = [0, 0, 0, 0];
    let n = 0;
    for (const cell of box.list) {
      boxOfCell[cell.k] = i;
      n += cell.n;
      cell.sum.forEach((value, c) => (sum[c] += value));
    }
    const alpha = sum[3] / n;
    const color = sum
      .slice(0, 3)
      .map((value) => Math.round(Math.min(255 * (value / Math.max(sum[3], 1e-6)), 255)));
    return [...color, Math.round(255 * alpha)];
  });
  return { palette, index: Uint8Array.from(cellOf, (k) => boxOfCell[k]) };
}

function boxed(list) {
  let [axis, weight] = [0, 0];
  if (list.length > 1) {
    for (let c = 0; c < 4; c++) {
      const values = list.map((cell) => cell.mean[c]);
      const range =
        values.reduce((m, v) => Math.max(m, v), -1) - values.reduce((m, v) => Math.min(m, v), 2);
      const heavy = range * Math.sqrt(list.reduce((sum, cell) => sum + cell.n, 0));
      if (heavy > weight) [axis, weight] = [c, heavy];
    }
  }
  return { list, axis, weight };
}

// Textures carried from a stroke to what an edit made of it, as edits.py does it.

const MAX_COLUMNS = 256; // texels across a strip
const STRETCH = 1.3; // the most by which grain is stretched
const GRAIN = 15; // px along a stroke, blur that tells tone from grain
const TONES = 24; // levels of tone
const SAME = 0.01; // px of half width: less is no change

/** Arc length, half width of the ribbon and width at the points of a line. */
function profileOf(line, margin) {
  const s = arcLength(line.x, line.y);
  const half = halfWidths(line, margin);
  let widest = 0;
  for (const h of half) if (h > widest) widest = h;
  const total = s[s.length - 1];
  const caps = line.closed ? [0, 0] : [half[0], half[half.length - 1]];
  return { s, half, width: line.width, widest, total, caps, length: Math.max(total + caps[0] + caps[1], 1e-6) };
}

/**
 * The strip of a stroke on `line`, which was made of it, with `density` times as many texels each way as will be kept.
 *
 * Along, tone and ink lie by the point where they lay; across, they are stretched with the thickness, but for the soft
 * edge beyond it. Grain keeps its own scale: where it would be stretched by more than STRETCH, it is laid anew.
 */
function carried(stroke, line, density = 1) {
  const { strip, margin } = stroke;
  const { rows: n, columns: a } = strip;
  const { closed } = line;
  const old = (stroke.profile ??= profileOf(stroke.line, margin));
  const now = profileOf(line, margin);
  const growth = now.widest / Math.max(old.widest, 1e-9);
  const most = growth < STRETCH ? a : Math.min(Math.ceil(a * growth), MAX_COLUMNS);
  const rows = Math.max(2, Math.round((density * n * now.length) / old.length));
  const columns = Math.max(Math.min(a, most), Math.round(density * most));
  const lie = rowsCarried(stroke, line, old, now, rows);
  const along = grainRows(lie, now.length / rows / (old.length / n));
  const grain = along && (stroke.grain ??= grainOf(strip, (GRAIN * n) / old.length, closed));
  const channels = strip.alpha ? 1 : 4;
  const out = new Uint8Array(channels * rows * columns);
  const [ink, tone] = [new Float32Array(channels * a), new Float32Array(a)]; // of one row
  for (let r = 0; r < rows; r++) {
    const [ratio, half, oldHalf] = [lie.ratio[r], lie.half[r], Math.max(lie.oldHalf[r], 1e-9)];
    rowOf(ink, grain?.ink ?? strip.alpha ?? strip.data, lie.row[r], n, closed);
    if (!grain && columns === a && Math.abs(half - oldHalf) + Math.abs(ratio - 1) < SAME) {
      for (let i = 0; i < ink.length; i++) out[r * ink.length + i] = ink[i] + 0.5;
      continue;
    }
    if (grain) rowOf(tone, grain.tone, lie.row[r], n, closed);
    const ranks = grain ? a * Math.round(mirrored(along[r], n)) : 0;
    const core = Math.max(oldHalf - margin, 0);
    const [stretch, kept] = [Math.max(ratio, 1e-9), Math.min(Math.max(ratio, 1 / STRETCH), STRETCH)];
    const texels = a / (2 * oldHalf); // a px
    for (let c = 0; c < columns; c++) {
      const v = (2 * c + 1) / columns - 1;
      const away = Math.abs(v) * half;
      // across: ink stretched by how much thicker the stroke became, its soft edge as wide as it was
      const source = away <= core * ratio ? away / stretch : core + away - core * ratio;
      // past the old ribbon's edge there is nothing
      const seen = lie.faint[r] * Math.min(oldHalf - source + oldHalf / a, 1);
      if (seen <= 0) continue;
      const place = Math.min(Math.max((v < 0 ? -source : source) * texels + 0.5 * a - 0.5, 0), a - 1);
      const c0 = Math.floor(place);
      const [c1, right] = [c0 + 1 < a ? c0 + 1 : c0, place - c0];
      const at = channels * (r * columns + c);
      let fresh = -1;
      if (grain) {
        const beside = Math.round(mirrored(((v < 0 ? -away : away) / kept) * texels + 0.5 * a - 0.5, a));
        fresh = grainAt(grain, tone[c0] + right * (tone[c1] - tone[c0]), grain.rank[ranks + beside]);
      }
      if (channels === 1) {
        out[at] = seen * (fresh < 0 ? ink[c0] + right * (ink[c1] - ink[c0]) : fresh) + 0.5;
        continue;
      }
      const opacity = ink[4 * c0 + 3] + right * (ink[4 * c1 + 3] - ink[4 * c0 + 3]);
      const most = fresh < 0 ? seen : (seen * fresh) / Math.max(opacity, 1e-6);
      for (let i = 0; i < 4; i++) {
        out[at + i] = most * (ink[4 * c0 + i] + right * (ink[4 * c1 + i] - ink[4 * c0 + i])) + 0.5;
      }
    }
  }
  return { rows, columns, alpha: strip.alpha && out, data: strip.data && out };
}

/** A row of n rows of texels, read between two of them, into `out`. */
function rowOf(out, texels, row, n, closed) {
  const low = Math.floor(row);
  const down = row - low;
  const a = out.length * (low >= 0 ? Math.min(low, n - 1) : closed ? n - 1 : 0);
  const b = out.length * (low + 1 < n ? low + 1 : closed ? 0 : n - 1);
  for (let i = 0; i < out.length; i++) out[i] = texels[a + i] + down * (texels[b + i] - texels[a + i]);
}

/**
 * Where the rows of a new strip lay, each (rows,): `row` of the old strip, `half` width of the ribbon and `oldHalf`, `ratio`
 * of the new width to the old one, and how `faint` the stroke became as it became a hair.
 */
function rowsCarried(stroke, line, old, now, rows) {
  // the same point; in a cap, the same share of it
  const u = new Float64Array(rows);
  for (let r = 0; r < rows; r++) u[r] = ((r + 0.5) / rows) * now.length - now.caps[0];
  const [before, width, half] = interp(u, now.s, atIndex(old.s, line.was), line.width, now.half);
  for (let r = 0; r < rows; r++) {
    if (u[r] < 0) before[r] = (u[r] / Math.max(now.caps[0], 1e-9)) * old.caps[0];
    else if (u[r] > now.total) before[r] = old.total + ((u[r] - now.total) / Math.max(now.caps[1], 1e-9)) * old.caps[1];
  }
  const [oldWidth, oldHalf] = interp(before, old.s, stroke.line.width, old.half);
  const [row, ratio, faint] = [new Float64Array(rows), new Float64Array(rows), new Float64Array(rows)];
  for (let r = 0; r < rows; r++) {
    row[r] = ((before[r] + old.caps[0]) / old.length) * stroke.strip.rows - 0.5;
    ratio[r] = oldWidth[r] > 1e-6 ? width[r] / oldWidth[r] : 1;
    faint[r] = Math.min(width[r] / Math.max(Math.min(oldWidth[r], 1), 1e-6), 1);
  }
  return { row, ratio, faint, half, oldHalf, oldWidth };
}

/** Where grain that is not stretched lies along the old strip, in rows of it; null where it may be stretched as it is. */
function grainRows({ row, ratio, oldWidth }, texel) {
  const rows = row.length;
  const rate = row.map((_, r) => {
    const [a, b] = [Math.max(r - 1, 0), Math.min(r + 1, rows - 1)];
    return rows > 2 ? (row[b] - row[a]) / (b - a) / texel : 1;
  });
  const little = (k) => k >= 1 / STRETCH && k <= STRETCH;
  if (rate.every(little) && ratio.every((k, r) => oldWidth[r] <= 0.5 || little(k))) return null;
  let sum = 0;
  return rate.map((k) => (sum += Math.min(Math.max(k, 1 / STRETCH), STRETCH) * texel));
}

/**
 * A strip as tone, the mean opacity along the stroke, and grain, a texel's rank among those of about its tone: {tone,
 * rank, sorted: opacities by tone and rank, first, count: of each level of tone, ink: its colours, without gaps}.
 */
function grainOf(strip, sigma, closed) {
  const { rows, columns, data } = strip;
  const size = rows * columns;
  const bytes = strip.alpha ?? data.filter((_, i) => i % 4 === 3);
  const tone = spreadOut(bytes, rows, columns, sigma, 1, closed);
  const level = Uint8Array.from(tone, (value) => Math.min(Math.floor((value * TONES) / 255), TONES - 1));
  // sorted by tone, then opacity, by counting
  const place = new Int32Array(256 * TONES + 1);
  for (let i = 0; i < size; i++) place[256 * level[i] + bytes[i] + 1]++;
  for (let i = 0; i < 256 * TONES; i++) place[i + 1] += place[i];
  const first = Int32Array.from({ length: TONES }, (_, k) => place[256 * k]);
  const count = Array.from(first, (from, k) => (k < TONES - 1 ? first[k + 1] : size) - from);
  const [rank, sorted] = [new Float32Array(size), new Uint8Array(size)];
  for (let i = 0; i < size; i++) {
    const at = place[256 * level[i] + bytes[i]]++;
    sorted[at] = bytes[i];
    rank[i] = (at - first[level[i]] + 0.5) / count[level[i]];
  }
  const filled = Array.from(count.keys()).filter((k) => count[k]);
  const nearest = count.map((_, k) => filled.reduce((best, f) => (Math.abs(f - k) < Math.abs(best - k) ? f : best)));
  const ink = data && inkAround(strip, (2 * sigma) / GRAIN, closed);
  return { tone, rank, sorted, first, count: Int32Array.from(count), nearest: Uint8Array.from(nearest), ink };
}

/** Premultiplied colours of a strip, blurred so that there is ink everywhere, for grain that comes to lie elsewhere. */
function inkAround({ rows, columns, data }, sigma, closed) {
  const out = new Float32Array(data.length);
  for (let k = 0; k < 4; k++) {
    const plane = data.filter((_, i) => i % 4 === k);
    const mean = plane.reduce((sum, value) => sum + value, 0) / plane.length;
    spreadOut(plane, rows, columns, sigma, 1, closed).forEach((value, i) => (out[4 * i + k] = value + 1e-4 * mean));
  }
  return out;
}

/** Texels under a Gaussian, of `along` rows and `across` columns; beyond the strip's sides there is nothing. */
function spreadOut(values, rows, columns, along, across, closed) {
  const kernel = (sigma) => {
    const weights = Array.from({ length: Math.round(4 * sigma) + 1 }, (_, k) => Math.exp((-0.5 * k * k) / sigma ** 2));
    const sum = weights.reduce((total, w, k) => total + (k ? 2 * w : w), 0);
    return weights.map((w) => w / sum);
  };
  const [down, aside] = [kernel(along), kernel(across)];
  const inside = (r) => (closed ? ((r % rows) + rows) % rows : Math.min(Math.max(r, 0), rows - 1));
  const [half, out] = [new Float32Array(values.length), new Float32Array(values.length)];
  for (let r = 0; r < rows; r++) {
    for (let k = 1 - down.length; k < down.length; k++) {
      const [from, w] = [inside(r + k) * columns, down[Math.abs(k)]];
      for (let c = 0; c < columns; c++) half[r * columns + c] += w * values[from + c];
    }
  }
  for (let k = 1 - aside.length; k < aside.length; k++) {
    const w = aside[Math.abs(k)];
    for (let r = 0; r < rows; r++) {
      for (let c = Math.max(0, -k); c < Math.min(columns, columns - k); c++) {
        out[r * columns + c] += w * half[r * columns + c + k];
      }
    }
  }
  return out;
}

/** A place on 0 .. n - 1, mirrored at both ends as often as it takes. */
function mirrored(at, n) {
  const period = 2 * (n - 1) || 1;
  return n - 1 - Math.abs(at - period * Math.floor(at / period) - (n - 1));
}

/** The opacity, 0 .. 255, of a tone where the grain has a rank: what is of that tone has at its rank. */
function grainAt({ sorted, first, count, nearest }, tone, rank) {
  // between two levels of tone, texels take one or the other: a blend of two grains is grey
  const place = Math.min(Math.max((tone * TONES) / 255 - 0.5, 0), TONES - 1);
  const dither = rank * 7919;
  const k = nearest[Math.min(Math.floor(place + dither - Math.floor(dither)), TONES - 1)];
  return sorted[first[k] + Math.min(Math.floor(rank * count[k]), count[k] - 1)];
}

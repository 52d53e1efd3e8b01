// Reads the page's data: a JSON header and one deflated stream of whole numbers.
// posse_training/replay/format.py says how they are written.

// A quantity over time: frames rows of `size` numbers each.
class Column {
  constructor(described, frames, series) {
    this.name = described.name;
    this.shape = described.shape;
    this.size = described.shape.reduce((product, n) => product * n, 1);
    this.scale = described.scale;
    this.unit = described.unit;
    this.missing = described.missing;
    this.frames = frames;
    this.series = series;
  }

  // The k-th number of a frame.
  at(frame, k = 0) {
    const whole = this.series[k * this.frames + frame];
    return whole === this.missing ? NaN : whole * this.scale;
  }

  // Between two frames, for drawing.
  between(position, k = 0) {
    const frame = Math.min(Math.floor(position), this.frames - 1);
    const next = Math.min(frame + 1, this.frames - 1);
    const share = Math.min(position - frame, 1);
    return this.at(frame, k) * (1 - share) + this.at(next, k) * share;
  }
}

function unpack(described, frames, bytes, start) {
  const size = described.shape.reduce((product, n) => product * n, 1);
  const count = size * frames;
  const series = new Int32Array(count);
  for (let plane = 0; plane < described.width; plane++) {
    for (let i = 0; i < count; i++) series[i] |= bytes[start + plane * count + i] << (8 * plane);
  }
  for (let i = 0; i < count; i++) series[i] = (series[i] >>> 1) ^ -(series[i] & 1);
  for (let pass = 0; pass < described.order; pass++) {
    for (let k = 0; k < size; k++) {
      for (let i = k * frames + 1; i < (k + 1) * frames; i++) series[i] += series[i - 1];
    }
  }
  return new Column(described, frames, series);
}

// JSON knows no infinite numbers: they come as {"number": "inf"}.
function revive(key, value) {
  if (value === null || typeof value !== "object" || typeof value.number !== "string") return value;
  return { inf: Infinity, "-inf": -Infinity, nan: NaN }[value.number] ?? value;
}

async function inflate(text) {
  const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

export function readJson(id) {
  return JSON.parse(document.getElementById(id).textContent, revive);
}

export async function readReplay() {
  const header = readJson("header");
  const bytes = await inflate(document.getElementById("data").textContent);
  let start = 0;
  const players = header.players.map((player, number) => {
    const columns = new Map();
    for (const described of player.columns) {
      const column = unpack(described, player.frames, bytes, start);
      start += column.size * player.frames * described.width;
      columns.set(described.name, column);
    }
    const events = player.events.map(([step, kind, text, robots]) => ({ step, kind, text, robots }));
    return { ...player, number, events, columns, last: player.frames - 1 };
  });
  return { world: header.world, players };
}

// Reads the page's data: one deflated stream of a JSON header, a newline, and whole numbers.
// posse_training/replay/format.py says how they are written.

const SMOOTHED = 1; // s, over which the present score is averaged
const MISSING = -(2 ** 30);

// A quantity over time: frames rows of `size` numbers each.
class Column {
  constructor(described, frames, series) {
    Object.assign(this, described, { frames, series });
    this.size = series.length / frames;
  }

  // The k-th number of a frame.
  at(frame, k = 0) {
    const whole = this.series[k * this.frames + frame];
    return whole === MISSING ? NaN : whole * this.scale;
  }

  // Between two frames, for drawing; after the last one, its value.
  between(position, k = 0) {
    const frame = Math.min(Math.floor(position), this.frames - 1);
    const next = Math.min(frame + 1, this.frames - 1);
    const share = Math.min(position - frame, 1);
    return this.at(frame, k) * (1 - share) + this.at(next, k) * share;
  }
}

// The series of all columns of a player, one after the other.
function unpack(bytes, frames) {
  const series = new Int32Array(bytes.length / 4);
  for (let i = 0; i < series.length; i++) {
    for (let plane = 0; plane < 4; plane++) series[i] |= bytes[plane * series.length + i] << (8 * plane);
    series[i] = (series[i] >>> 1) ^ -(series[i] & 1);
    if (i % frames) series[i] += series[i - 1];
  }
  return series;
}

// JSON knows no infinite numbers: they come as {"number": "inf"}.
function revive(key, value) {
  return { inf: Infinity, "-inf": -Infinity, nan: NaN }[value?.number] ?? value;
}

// Of each frame: the score of the step, averaged over the last second (the score jumps from step
// to step), and over the steps so far; `safe`: from the first contact on, every step counts 0.
function scoresOf(player, step) {
  const touched = player.events.find((event) => event.kind === "contact")?.step ?? Infinity;
  const score = player.columns.get("score");
  const reach = Math.max(1, Math.round(SMOOTHED / step));
  let [sum, safe, recent] = [0, 0, 0];
  return Array.from({ length: player.frames }, (_, frame) => {
    const value = score.at(frame);
    if (frame) sum += value;
    if (frame && frame < touched) safe += value;
    recent += value - (frame >= reach ? score.at(frame - reach) : 0);
    const steps = frame || 1;
    return { mean: sum / steps, safe: safe / steps, recent: recent / Math.min(frame + 1, reach) };
  });
}

export async function readReplay() {
  const text = atob(document.getElementById("data").textContent);
  const packed = Uint8Array.from(text, (character) => character.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  let start = bytes.indexOf(10); // the newline
  const { world, players } = JSON.parse(new TextDecoder().decode(bytes.subarray(0, start++)), revive);
  players.forEach((player, number) => {
    const { frames } = player;
    const sizes = player.columns.map(({ shape }) => shape.reduce((product, n) => product * n, frames));
    const end = start + 4 * sizes.reduce((sum, size) => sum + size, 0);
    const series = unpack(bytes.subarray(start, end), frames);
    start = end;
    let place = 0;
    const columns = new Map(player.columns.map((described, k) =>
      [described.name, new Column(described, frames, series.subarray(place, (place += sizes[k])))]));
    Object.assign(player, { number, columns, last: frames - 1 });
    player.scores = scoresOf(player, world.settings.control_step);
  });
  return { world, players, last: Math.max(...players.map((player) => player.last)) };
}

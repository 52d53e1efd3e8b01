// The ground that a view shows: floor, grid, walls, obstacles, slots, scale.
import { FOOT } from "./camera.js";
import { colours, disc, line, pen, write } from "./drawing.js";
import { halfSides } from "./state.js";

const GRID = 2; // m

// The slots' places: they stand on the target in a frame of its own.
export function slotPlaces(d) {
  const [x, y, frame] = ["target_x", "target_y", "target_frame"].map((name) => d.value(name));
  const [cosine, sine] = [Math.cos(frame), Math.sin(frame)];
  const place = (sx, sy) => d.look.project(x + sx * cosine - sy * sine, y + sx * sine + sy * cosine);
  const behind = Math.min(0, ...d.world.slots.map(([sx]) => sx));
  return { places: d.world.slots.map((slot) => place(...slot)), axis: [place(behind, 0), place(1, 0)] };
}

export function floor({ ctx, look, settings }) {
  const [halfWidth, halfHeight] = halfSides(settings);
  const walled = Number.isFinite(halfWidth);
  ctx.fillStyle = walled ? colours.PAPER : colours.GROUND;
  ctx.fillRect(0, 0, look.width, look.height);
  if (!walled) return;
  ctx.fillStyle = colours.GROUND;
  ctx.fillRect(...look.project(-halfWidth, halfHeight), 2 * halfWidth * look.scale, 2 * halfHeight * look.scale);
}

// Crosses every two metres (more when zoomed out): how far and how fast, without lines in the way.
export function grid({ ctx, look, settings }) {
  let step = GRID;
  while (step * look.scale < 24) step *= 2;
  const [halfWidth, halfHeight] = halfSides(settings);
  const [left, top] = look.unproject(0, 0);
  const [right, bottom] = look.unproject(look.width, look.height);
  const first = (value, half) => Math.ceil(Math.max(value, -half) / step) * step;
  pen(ctx, colours.GRID, 1);
  for (let x = first(left, halfWidth); x <= Math.min(right, halfWidth); x += step) {
    for (let y = first(bottom, halfHeight); y <= Math.min(top, halfHeight); y += step) {
      const [px, py] = look.project(x, y);
      line(ctx, px - 4, py, px + 4, py);
      line(ctx, px, py - 4, px, py + 4);
    }
  }
}

export function slots(d) {
  const { ctx, settings } = d;
  const { places, axis } = slotPlaces(d);
  const filled = new Set();
  for (let i = 0; i < settings.num_trackers; i++) filled.add(d.at("tracker_slot", i));
  pen(ctx, colours.SLOT, 1, [4, 4]);
  line(ctx, ...axis[0], ...axis[1]);
  pen(ctx, colours.SLOT, 1.5);
  ctx.fillStyle = colours.SLOT_FILLED;
  places.forEach((place, k) => {
    disc(ctx, ...place, settings.tolerance * d.look.scale);
    if (filled.has(k)) ctx.fill();
    ctx.stroke();
  });
}

export function obstacles({ ctx, look, world, settings }) {
  ctx.fillStyle = colours.OBSTACLE;
  pen(ctx, colours.OBSTACLE_RIM, 1.2);
  for (const [x, y, radius] of world.obstacles) {
    disc(ctx, ...look.project(x, y), radius * look.scale);
    ctx.fill();
    ctx.stroke();
  }
  const [halfWidth, halfHeight] = halfSides(settings);
  if (!Number.isFinite(halfWidth)) return;
  const [left, top] = look.project(-halfWidth, halfHeight);
  pen(ctx, colours.WALL, 3);
  ctx.strokeRect(left - 1.5, top - 1.5, 2 * halfWidth * look.scale + 3, 2 * halfHeight * look.scale + 3);
}

export function scaleBar({ ctx, look }) {
  const lengths = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500];
  const length = lengths.findLast((value) => value * look.scale <= 90) ?? 0.1;
  const [left, right] = [12, 12 + length * look.scale];
  const middle = look.height - FOOT / 2;
  pen(ctx, colours.FAINT_INK, 1.4);
  line(ctx, left, middle, right, middle);
  for (const end of [left, right]) line(ctx, end, middle - 3.5, end, middle + 3.5);
  write(ctx, `${length} m`, right + 6, middle, 11, colours.FAINT_INK, "left");
}

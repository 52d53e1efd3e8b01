// The ground that a view shows: floor, grid, walls, obstacles, slots, scale.
import { colours } from "./colours.js";
import { FOOT } from "./camera.js";
import { slotPlaces } from "./geometry.js";

const GRID = 2; // m

export function disc(ctx, x, y, radius) {
  ctx.beginPath();
  ctx.arc(x, y, radius, 0, 2 * Math.PI);
}

// How the next strokes look.
export function pen(ctx, colour, width, dashes = []) {
  ctx.strokeStyle = colour;
  ctx.lineWidth = width;
  ctx.setLineDash(dashes);
}

export function line(ctx, ax, ay, bx, by) {
  ctx.beginPath();
  ctx.moveTo(ax, ay);
  ctx.lineTo(bx, by);
  ctx.stroke();
}

function floor(d) {
  const { ctx, look, settings } = d;
  if (!Number.isFinite(settings.arena)) {
    ctx.fillStyle = colours.GROUND;
    ctx.fillRect(0, 0, look.width, look.height);
    return;
  }
  ctx.fillStyle = colours.PAPER;
  ctx.fillRect(0, 0, look.width, look.height);
  const half = settings.arena / 2;
  const [left, top] = look.project(-half, half);
  const side = settings.arena * look.scale;
  ctx.fillStyle = colours.GROUND;
  ctx.fillRect(left, top, side, side);
}

// Crosses every two metres (more when zoomed out): how far and how fast, without lines in the way.
function grid(d) {
  const { ctx, look, settings } = d;
  let step = GRID;
  while (step * look.scale < 24) step *= 2;
  let [left, top] = look.unproject(0, 0);
  let [right, bottom] = look.unproject(look.width, look.height);
  const half = settings.arena / 2;
  [left, bottom] = [Math.max(left, -half), Math.max(bottom, -half)];
  [right, top] = [Math.min(right, half), Math.min(top, half)];
  pen(ctx, colours.GRID, 1);
  for (let x = Math.ceil(left / step) * step; x <= right; x += step) {
    for (let y = Math.ceil(bottom / step) * step; y <= top; y += step) {
      const [px, py] = look.project(x, y);
      line(ctx, px - 4, py, px + 4, py);
      line(ctx, px, py - 4, px, py + 4);
    }
  }
}

function obstacles(d) {
  const { ctx, look } = d;
  ctx.fillStyle = colours.OBSTACLE;
  pen(ctx, colours.OBSTACLE_RIM, 1.2);
  for (const [x, y, radius] of d.world.obstacles) {
    disc(ctx, ...look.project(x, y), radius * look.scale);
    ctx.fill();
    ctx.stroke();
  }
}

function walls(d) {
  const { ctx, look, settings } = d;
  if (!Number.isFinite(settings.arena)) return;
  const [left, top] = look.project(-settings.arena / 2, settings.arena / 2);
  const side = settings.arena * look.scale;
  pen(ctx, colours.WALL, 3);
  ctx.strokeRect(left - 1.5, top - 1.5, side + 3, side + 3);
}

function slots(d) {
  const { ctx, look, settings } = d;
  const n = settings.num_trackers;
  const [x, y, frame] = [d.value("target_x"), d.value("target_y"), d.value("target_frame")];
  const places = slotPlaces(d.world.slots, x, y, frame);
  const filled = new Set();
  for (let i = 0; i < n; i++) filled.add(d.at("tracker_slot", i));
  const behind = Math.min(0, ...d.world.slots.map(([sx]) => sx));
  const [cosine, sine] = [Math.cos(frame), Math.sin(frame)];
  pen(ctx, colours.SLOT, 1, [4, 4]);
  line(
    ctx,
    ...look.project(x + behind * cosine, y + behind * sine),
    ...look.project(x + cosine, y + sine),
  );
  pen(ctx, colours.SLOT, 1.5);
  ctx.fillStyle = colours.SLOT_FILLED;
  places.forEach(([sx, sy], k) => {
    disc(ctx, ...look.project(sx, sy), settings.tolerance * look.scale);
    if (filled.has(k)) ctx.fill();
    ctx.stroke();
  });
}

export function scaleBar(d) {
  const { ctx, look } = d;
  const lengths = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500];
  const length = lengths.findLast((value) => value * look.scale <= 90) ?? 0.1;
  const [left, right] = [12, 12 + length * look.scale];
  const middle = look.height - FOOT / 2;
  ctx.fillStyle = colours.FAINT_INK;
  pen(ctx, colours.FAINT_INK, 1.4);
  line(ctx, left, middle, right, middle);
  for (const end of [left, right]) line(ctx, end, middle - 3.5, end, middle + 3.5);
  ctx.font = d.font(11);
  ctx.textAlign = "left";
  ctx.textBaseline = "middle";
  ctx.fillText(`${length} m`, right + 6, middle);
}

export const groundLayers = [floor];
export const placeLayers = [grid, slots, obstacles, walls];

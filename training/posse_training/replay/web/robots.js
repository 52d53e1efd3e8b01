// The robots of a view: trails, trackers, target, contacts that have just begun.
import { broken, colours, disc, faded, ghost, label, leader, line, pen, target, tracker, write } from "./drawing.js";

const TRAIL_TIME = 6; // s
const FLASH_TIME = 1; // s
const BANDS = 8; // shades of a trail

export function trails(d) {
  const { ctx, look, settings, player } = d;
  if (!d.layers.trails) return;
  const length = Math.round(TRAIL_TIME / settings.control_step);
  const end = Math.min(d.position, player.last);
  ctx.lineCap = "round";
  for (let i = 0; i <= settings.num_trackers; i++) {
    const [xs, ys, k] = d.columns(i);
    const isTarget = i === settings.num_trackers;
    const chosen = i === d.robot && !isTarget;
    const colour = isTarget ? colours.TARGET : chosen ? colours.INK : colours.TRACKER;
    for (let band = 0; band < BANDS; band++) {
      const to = end - (length * (BANDS - 1 - band)) / BANDS;
      if (to < 0) continue;
      const from = Math.max(0, to - length / BANDS);
      pen(ctx, faded(colour, 0.8 * ((band + 1) / BANDS) ** 1.5), chosen ? 2 : 1.6);
      ctx.beginPath();
      ctx.moveTo(...look.project(xs.between(from, k), ys.between(from, k)));
      for (let frame = Math.ceil(from + 1e-6); frame < to; frame++) {
        ctx.lineTo(...look.project(xs.at(frame, k), ys.at(frame, k)));
      }
      ctx.lineTo(...look.project(xs.between(to, k), ys.between(to, k)));
      ctx.stroke();
    }
  }
}

function parts(colour) {
  return [1, 3, 5].map((k) => Number.parseInt(colour.slice(k, k + 2), 16));
}

// Black or white, whichever reads better on a colour "#rrggbb".
function onTop(colour) {
  const [red, green, blue] = parts(colour);
  return 0.3 * red + 0.59 * green + 0.11 * blue > 125 ? "#15181d" : "#ffffff";
}

// Mixed with the paper, not transparent: what lies below must not shine through a robot.
export function pale(colour) {
  const paper = parts(colours.PAPER);
  const mixed = parts(colour).map((value, k) => Math.round(0.45 * value + 0.55 * paper[k]));
  return `#${mixed.map((value) => value.toString(16).padStart(2, "0")).join("")}`;
}

function colourOf(d, i) {
  const s = d.settings;
  const all = s.field_of_view >= 2 * Math.PI - 1e-9 && !Number.isFinite(s.sensing_range);
  const limited = !all || s.num_obstacles > 0 || s.sensor_outages > 0;
  const colour = colours.TASKS[d.player.columns.get("belief/task")?.at(d.frame, i)] ?? colours.TRACKER;
  return limited && !d.at("tracker_sees", i) ? pale(colour) : colour;
}

// Where poses drift: the pose in which each tracker believes to be, tied to the true one.
export function ghosts(d) {
  if (!d.player.columns.has("believed_x")) return;
  for (let i = 0; i < d.settings.num_trackers; i++) {
    const [x, y, heading] = ["x", "y", "heading"].map((part) => d.value(`believed_${part}`, i));
    const place = d.look.project(x, y);
    ghost(d.ctx, ...place, heading, d.radius);
    line(d.ctx, ...d.place(i), ...place);
  }
}

// Broken ones lie lowest, the selected one on top.
export function trackers(d) {
  const { ctx, radius } = d;
  const isBroken = (i) => d.at("tracker_broken", i);
  const order = [...Array(d.settings.num_trackers).keys()];
  order.sort((a, b) => isBroken(b) - isBroken(a) || (a === d.robot) - (b === d.robot));
  for (const i of order) {
    const [x, y] = d.place(i);
    const fill = isBroken(i) ? colours.BROKEN : colourOf(d, i);
    if (i === d.robot) selection(d, x, y);
    tracker(ctx, x, y, d.pose(i)[2], radius, fill, isBroken(i) ? colours.TRACKER : undefined);
    const ink = isBroken(i) ? colours.FAINT_INK : onTop(fill);
    write(ctx, String(i), x, y + 0.5, Math.min(13, Math.max(9, radius * 1.15)), ink, "center", 600);
    if (isBroken(i)) {
      broken(ctx, x, y, radius * 0.95);
      continue;
    }
    const dead = ["sensor", "radio"].filter((what) => d.at(`tracker_${what}_dead`, i));
    const text = dead.map((what) => `no ${what}`).join(", ");
    if (text) label(ctx, text, x, y + radius + 10, colours.CONTACT);
    if (d.player.columns.get("belief/leader")?.at(d.frame, i) === i) leader(ctx, x, y - radius - 5);
  }
}

function selection({ ctx, radius }, x, y) {
  pen(ctx, colours.INK, 2.5);
  disc(ctx, x, y, radius + 5);
  ctx.stroke();
}

export function quarry(d) {
  const { ctx, radius } = d;
  const n = d.settings.num_trackers;
  const [x, y] = d.place(n);
  const heading = d.pose(n)[2];
  if (d.robot === n) selection(d, x, y);
  target(ctx, x, y, heading, radius);
  if (d.at("target_dart")) {
    const [right, down] = [Math.cos(heading) * (radius + 6), -Math.sin(heading) * (radius + 6)];
    label(ctx, "darts", x + 4 * right, y + 2.6 * down, colours.TARGET);
  }
}

export function flashes(d) {
  const { ctx, look, settings } = d;
  for (const event of d.player.events) {
    const age = (d.position - event.step) * settings.control_step;
    if (event.kind !== "contact" || age < 0 || age > FLASH_TIME) continue;
    for (const i of event.robots) {
      const [xs, ys, k] = d.columns(i);
      pen(ctx, faded(colours.CONTACT, 1 - age / FLASH_TIME), 3);
      const radius = d.radius + 4 + (16 * age) / FLASH_TIME;
      disc(ctx, ...look.project(xs.at(event.step, k), ys.at(event.step, k)), radius);
      ctx.stroke();
    }
  }
}

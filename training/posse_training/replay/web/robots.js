// The robots of a view: trails, trackers, target, contacts that have just begun.
import { colours, faded } from "./colours.js";
import { disc, line, pen } from "./world.js";

const TRAIL_TIME = 6; // s
const FLASH_TIME = 1; // s
const BANDS = 8; // shades of a trail

function trail(d, xs, ys, k, colour, width) {
  const { ctx, look, settings } = d;
  const length = Math.round(TRAIL_TIME / settings.control_step);
  const end = Math.min(d.position, d.player.last);
  const start = Math.max(0, end - length);
  ctx.lineCap = "round";
  for (let band = 0; band < BANDS; band++) {
    const from = end - (length * (BANDS - band)) / BANDS;
    const to = from + length / BANDS;
    if (to < start) continue;
    pen(ctx, faded(colour, 0.8 * ((band + 1) / BANDS) ** 1.5), width);
    ctx.beginPath();
    const first = Math.max(from, start);
    ctx.moveTo(...look.project(xs.between(first, k), ys.between(first, k)));
    for (let frame = Math.ceil(first + 1e-6); frame < to; frame++) {
      ctx.lineTo(...look.project(xs.at(frame, k), ys.at(frame, k)));
    }
    ctx.lineTo(...look.project(xs.between(to, k), ys.between(to, k)));
    ctx.stroke();
  }
}

function trails(d) {
  if (!d.layers.trails) return;
  const { columns } = d.player;
  const [xs, ys] = [columns.get("tracker_x"), columns.get("tracker_y")];
  for (let i = 0; i < d.settings.num_trackers; i++) {
    const chosen = i === d.robot;
    trail(d, xs, ys, i, chosen ? colours.INK : colours.TRAIL, chosen ? 2 : 1.6);
  }
  trail(d, columns.get("target_x"), columns.get("target_y"), 0, colours.TARGET, 1.6);
}

export function leaderMark(ctx, x, y, size) {
  for (const [grow, colour] of [[1.5, colours.PAPER], [0, colours.INK]]) {
    const side = size + grow;
    ctx.fillStyle = colour;
    ctx.beginPath();
    ctx.moveTo(x, y + grow);
    ctx.lineTo(x - side, y - 1.5 * side);
    ctx.lineTo(x + side, y - 1.5 * side);
    ctx.fill();
  }
}

export function wafer(ctx, x, y, heading, radius, fill, rim) {
  pen(ctx, rim, 2);
  line(ctx, x, y, x + Math.cos(heading) * (radius + 5), y - Math.sin(heading) * (radius + 5));
  ctx.fillStyle = fill;
  ctx.lineWidth = 1.4;
  disc(ctx, x, y, radius);
  ctx.fill();
  ctx.stroke();
}

export function cross(ctx, x, y, arm) {
  line(ctx, x - arm, y - arm, x + arm, y + arm);
  line(ctx, x - arm, y + arm, x + arm, y - arm);
}

// Black or white, whichever reads better on a colour "#rrggbb".
function onTop(colour) {
  const part = (k) => Number.parseInt(colour.slice(k, k + 2), 16);
  return 0.3 * part(1) + 0.59 * part(3) + 0.11 * part(5) > 125 ? "#15181d" : "#ffffff";
}

// Mixed with the ground, not transparent: what lies below must not shine through a robot.
function pale(colour) {
  const part = (text, k) => Number.parseInt(text.slice(k, k + 2), 16);
  const mixed = [1, 3, 5].map((k) => 0.45 * part(colour, k) + 0.55 * part(colours.PAPER, k));
  return `#${mixed.map((value) => Math.round(value).toString(16).padStart(2, "0")).join("")}`;
}

function limitedSight(d) {
  const s = d.settings;
  const all = s.field_of_view >= 2 * Math.PI - 1e-9 && !Number.isFinite(s.sensing_range);
  return !all || s.num_obstacles > 0 || s.sensor_outages > 0;
}

export function trackerColour(d, i) {
  const task = d.player.columns.get("belief/task")?.at(d.frame, i) ?? -1;
  const colour = colours.TASKS[task] ?? colours.TRACKER;
  return limitedSight(d) && !d.at("tracker_sees", i) ? pale(colour) : colour;
}

function trackers(d) {
  const { ctx, look, radius } = d;
  const leader = d.player.columns.get("belief/leader");
  const order = [...Array(d.settings.num_trackers).keys()];
  const broken = (i) => d.at("tracker_broken", i);
  order.sort((a, b) => broken(b) - broken(a) || (a === d.robot) - (b === d.robot));
  for (const i of order) {
    const [x, y, heading] = d.pose(i);
    const [px, py] = look.project(x, y);
    if (i === d.robot) {
      pen(ctx, colours.INK, 2.5);
      disc(ctx, px, py, radius + 5);
      ctx.stroke();
    }
    const fill = broken(i) ? colours.BROKEN : trackerColour(d, i);
    wafer(ctx, px, py, heading, radius, fill, broken(i) ? colours.TRACKER : colours.TRACKER_RIM);
    ctx.fillStyle = broken(i) ? colours.FAINT_INK : onTop(fill);
    ctx.font = d.font(Math.min(13, Math.max(9, radius * 1.15)), 600);
    ctx.textAlign = "center";
    ctx.textBaseline = "middle";
    ctx.fillText(String(i), px, py + 0.5);
    faults(d, i, px, py);
    if (leader && leader.at(d.frame, i) === i && !broken(i)) {
      leaderMark(ctx, px, py - radius - 5, 5);
    }
  }
}

// Broken: crossed out. A dead sensor or radio: its letter beside the robot.
function faults(d, i, x, y) {
  const { ctx, radius } = d;
  if (d.at("tracker_broken", i)) {
    pen(ctx, colours.INK, 2);
    cross(ctx, x, y, radius * 0.95);
    return;
  }
  const dead = [
    d.at("tracker_sensor_dead", i) ? "no sensor" : "",
    d.at("tracker_radio_dead", i) ? "no radio" : "",
  ].filter(Boolean);
  if (dead.length) d.label(dead.join(", "), x, y + radius + 10, colours.CONTACT);
}

function target(d) {
  const { ctx, look, radius } = d;
  const [x, y, heading] = d.pose(d.settings.num_trackers);
  const [px, py] = look.project(x, y);
  const end = [Math.cos(heading) * (radius + 6), -Math.sin(heading) * (radius + 6)];
  if (d.robot === d.settings.num_trackers) {
    pen(ctx, colours.INK, 2.5);
    disc(ctx, px, py, radius + 6);
    ctx.stroke();
  }
  ctx.fillStyle = colours.PAPER;
  pen(ctx, colours.PAPER, 6);
  line(ctx, px, py, px + end[0], py + end[1]);
  disc(ctx, px, py, radius + 3);
  ctx.fill();
  ctx.fillStyle = colours.TARGET;
  pen(ctx, colours.TARGET, 2.8);
  line(ctx, px, py, px + end[0], py + end[1]);
  disc(ctx, px, py, radius + 1);
  ctx.fill();
  if (d.at("target_dart")) d.label("darts", px + 4 * end[0], py + 2.6 * end[1], colours.TARGET);
}

function flashes(d) {
  const { ctx, look, settings } = d;
  for (const event of d.player.events) {
    const age = (d.position - event.step) * settings.control_step;
    if (event.kind !== "contact" || age < 0 || age > FLASH_TIME) continue;
    for (const i of event.robots) {
      const x = d.player.columns.get("tracker_x").at(event.step, i);
      const y = d.player.columns.get("tracker_y").at(event.step, i);
      pen(ctx, faded(colours.CONTACT, 1 - age / FLASH_TIME), 3);
      disc(ctx, ...look.project(x, y), d.radius + 4 + (16 * age) / FLASH_TIME);
      ctx.stroke();
    }
  }
}

export const robotLayers = [trackers, target, flashes];
export const trailLayers = [trails];

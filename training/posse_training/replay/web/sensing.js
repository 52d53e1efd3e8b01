// What the selected robot senses and hears, and where it takes the target to be.
import { colours, faded, label, line, pen, robot } from "./drawing.js";
import { slotPlaces } from "./ground.js";
import { halfSides } from "./state.js";

const STEP = Math.PI / 90; // rad, between two rays
const GRAZE = 1e-5; // rad, to either side of an obstacle's rim
const VIEW_SHOWN = 1.5; // m; how far a field of view of unlimited range is drawn
const GHOST_FADES = 10; // s
const LINK_FADES = 3; // s

// How far a ray from (x, y) goes before it meets a disc's rim; Infinity: it passes.
function untilDisc(x, y, cosine, sine, [ox, oy, radius]) {
  const [dx, dy] = [ox - x, oy - y];
  const along = dx * cosine + dy * sine;
  const across = dx * sine - dy * cosine;
  if (along <= 0 || Math.abs(across) >= radius) return Infinity;
  return Math.max(0, along - Math.sqrt(radius * radius - across * across));
}

function untilWall(at, direction, half) {
  return direction ? (Math.sign(direction) * half - at) / direction : Infinity;
}

// The area that a tracker's target sensor covers, with the shadows of obstacles: its corners,
// [x, y] each; null: it is without limit.
export function sightOf(settings, obstacles, x, y, heading) {
  const { field_of_view: view, sensing_range: limit } = settings;
  const [halfWidth, halfHeight] = halfSides(settings);
  const allRound = view >= 2 * Math.PI - 1e-9;
  if (!Number.isFinite(limit) && allRound && obstacles.length === 0) return null;
  const range = Number.isFinite(limit) || Number.isFinite(halfWidth) ? limit : VIEW_SHOWN;
  const edge = allRound ? Math.PI : view / 2;
  const angles = [-edge, edge];
  for (let angle = Math.ceil(-edge / STEP) * STEP; angle < edge; angle += STEP) angles.push(angle);
  // Beside the regular rays: the rims of obstacles, and the corners of the arena.
  const extra = [];
  for (const [ox, oy, radius] of obstacles) {
    const distance = Math.hypot(ox - x, oy - y);
    if (distance <= radius || distance - radius > range) continue;
    const middle = Math.atan2(oy - y, ox - x);
    const spread = Math.asin(radius / distance);
    for (const rim of [-spread, spread]) extra.push(middle + rim - GRAZE, middle + rim + GRAZE);
    extra.push(middle);
  }
  if (Number.isFinite(halfWidth)) {
    for (const cx of [-halfWidth, halfWidth])
      for (const cy of [-halfHeight, halfHeight]) extra.push(Math.atan2(cy - y, cx - x));
  }
  for (const bearing of extra) {
    const angle = bearing - heading - 2 * Math.PI * Math.round((bearing - heading) / (2 * Math.PI));
    if (Math.abs(angle) < edge) angles.push(angle);
  }
  angles.sort((a, b) => a - b);
  const corners = angles.map((angle) => {
    const [cosine, sine] = [Math.cos(heading + angle), Math.sin(heading + angle)];
    const discs = obstacles.map((disc) => untilDisc(x, y, cosine, sine, disc));
    const reach = Math.min(range, untilWall(x, cosine, halfWidth), untilWall(y, sine, halfHeight), ...discs);
    return [x + reach * cosine, y + reach * sine];
  });
  return allRound ? corners : [[x, y], ...corners];
}

export function sight(d) {
  const { ctx, look, settings } = d;
  if (!d.ofTracker || !d.layers.sensing) return;
  if (d.at("tracker_broken", d.robot) || d.at("tracker_sensor_dead", d.robot)) return;
  const corners = sightOf(settings, d.world.obstacles, ...d.pose(d.robot));
  if (corners === null) return;
  ctx.beginPath();
  for (const [x, y] of corners) ctx.lineTo(...look.project(x, y));
  ctx.closePath();
  ctx.fillStyle = colours.SENSING;
  pen(ctx, colours.SENSING_RIM, 1);
  ctx.fill();
  ctx.stroke();
}

export function sonar(d) {
  const { ctx, look, settings } = d;
  const { sonar_beams: beams, robot_radius: rim } = settings;
  const column = d.player.columns.get("observation/sonar");
  if (d.robot === null || !d.layers.sensing || !column || d.robot >= column.shape[0]) return;
  const [x, y, heading] = d.pose(d.robot);
  const [cx, cy] = look.project(x, y);
  for (let k = 0; k < beams; k++) {
    const reading = column.at(d.frame, d.robot * beams + k);
    const meets = reading < settings.sonar_range - column.scale;
    const angle = heading + (2 * Math.PI * k) / beams;
    const at = (radius) => look.project(x + radius * Math.cos(angle), y + radius * Math.sin(angle));
    pen(ctx, faded(meets ? colours.INK : colours.FAINT_INK, meets ? 0.6 : 0.3), meets ? 1.6 : 1);
    line(ctx, ...at(rim), ...at(rim + reading));
    if (meets) {
      const half = (Math.PI / beams) * 0.8;
      ctx.beginPath();
      ctx.arc(cx, cy, (rim + reading) * look.scale, -angle - half, -angle + half);
      ctx.stroke();
    }
  }
}

// Who hears whom: of the selected robot, with the age of what it heard; of all, faintly.
export function links(d) {
  const { ctx, settings } = d;
  const n = settings.num_trackers;
  const heard = d.player.columns.get("heard_step");
  if (!d.layers.links || (!heard && !d.ofTracker)) return;
  const age = (i, j) => {
    if (!heard) return 0;
    const step = heard.at(d.frame, i * n + j);
    return step < 0 ? Infinity : (d.frame - step) * settings.control_step;
  };
  const usual = settings.radio_delay * settings.control_step;
  const strength = (old) => Math.max(0, 1 - (old - usual) / LINK_FADES);
  // A large team has hundreds of links: together they weigh no more than a small team's.
  const weight = 0.5 * Math.max(0.12, Math.min(1, 24 / (n * n)));
  for (let i = 0; i < n; i++) {
    for (let j = 0; j < n; j++) {
      const [[ax, ay], [bx, by]] = [d.place(i), d.place(j)];
      if (d.ofTracker) {
        const old = age(i, j);
        if (i !== d.robot || j === i || old > settings.forget_after) continue;
        pen(ctx, faded(colours.LINK, 0.25 + 0.6 * strength(old)), 1.5, old > usual + 1e-6 ? [3, 4] : []);
        line(ctx, ax, ay, bx, by);
        if (old > usual + 0.05) label(ctx, `${old.toFixed(1)} s`, (ax + bx) / 2, (ay + by) / 2, colours.LINK);
      } else if (j < i) {
        pen(ctx, faded(colours.LINK, weight * Math.max(strength(age(i, j)), strength(age(j, i)))), 1);
        line(ctx, ax, ay, bx, by);
      }
    }
  }
}

// Its last fix of the target, paler with age; where it takes the target to be now; its slot.
export function beliefs(d) {
  const { ctx, look } = d;
  if (!d.ofTracker) return;
  const fix = (name) => d.at(`tracker_fix_${name}`, d.robot);
  const age = (d.frame - fix("step")) * d.settings.control_step;
  const apart = Math.hypot(fix("x") - d.at("target_x"), fix("y") - d.at("target_y"));
  if (fix("step") >= 0 && (age > 0.05 || apart > 0.05)) {
    pen(ctx, faded(colours.TARGET, Math.max(0.35, 1 - age / GHOST_FADES)), 1.8, [4, 3]);
    const [x, y] = look.project(fix("x"), fix("y"));
    robot(ctx, x, y, fix("heading"), d.radius + 3);
    if (age > 0.05) label(ctx, `fix ${age.toFixed(1)} s ago`, x, y + d.radius + 14, colours.TARGET);
  }
  const belief = (name) => d.player.columns.get(`belief/${name}`);
  const estimate = belief("estimate");
  if (estimate?.shape[1] === 3 && !(belief("estimate_age")?.at(d.frame, d.robot) < 0)) {
    const [x, y, heading] = [0, 1, 2].map((k) => estimate.at(d.frame, 3 * d.robot + k));
    pen(ctx, colours.LINK, 1.4, [1.5, 3]);
    robot(ctx, ...look.project(x, y), heading, d.radius + 6);
  }
  const slot = slotPlaces(d).places[belief("slot")?.at(d.frame, d.robot)];
  if (slot) {
    pen(ctx, faded(colours.TARGET, 0.7), 1.2, [2, 4]);
    line(ctx, ...d.place(d.robot), ...slot);
  }
}

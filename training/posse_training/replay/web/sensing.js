// What the selected robot senses and hears, and where it takes the target to be.
import { colours, faded } from "./colours.js";
import { areaInSight, slotPlaces } from "./geometry.js";
import { disc, line, pen } from "./world.js";

const VIEW_SHOWN = 1.5; // m; how far a field of view of unlimited range is drawn
const GHOST_FADES = 10; // s
const LINK_FADES = 3; // s

function path(ctx, look, corners) {
  ctx.beginPath();
  corners.forEach(([x, y], k) => {
    const [px, py] = look.project(x, y);
    if (k) ctx.lineTo(px, py);
    else ctx.moveTo(px, py);
  });
  ctx.closePath();
}

// The area that a tracker's target sensor covers; null: it is without limit, or dead.
export function sightOf(settings, obstacles, x, y, heading) {
  const view = settings.field_of_view;
  const bounded = Number.isFinite(settings.sensing_range);
  const walled = Number.isFinite(settings.arena);
  const allRound = view >= 2 * Math.PI - 1e-9;
  if (!bounded && allRound && obstacles.length === 0) return null;
  const range = bounded ? settings.sensing_range : walled ? Infinity : VIEW_SHOWN;
  return areaInSight(x, y, heading, range, view, obstacles, settings.arena / 2);
}

function sight(d) {
  const { ctx, look, robot, settings } = d;
  if (robot === null || robot >= settings.num_trackers || !d.layers.sensing) return;
  if (d.at("tracker_broken", robot) || d.at("tracker_sensor_dead", robot)) return;
  const [x, y, heading] = d.pose(robot);
  const corners = sightOf(settings, d.world.obstacles, x, y, heading);
  if (corners === null) return;
  path(ctx, look, corners);
  ctx.fillStyle = colours.SENSING;
  pen(ctx, colours.SENSING_RIM, 1);
  ctx.fill();
  ctx.stroke();
}

function sonar(d) {
  const { ctx, look, robot, settings } = d;
  const beams = settings.sonar_beams;
  const column = d.player.columns.get("observation/sonar");
  if (robot === null || !d.layers.sensing || !column || robot >= column.shape[0]) return;
  const [x, y, heading] = d.pose(robot);
  const rim = settings.robot_radius;
  const half = Math.PI / beams;
  for (let k = 0; k < beams; k++) {
    const reading = column.at(d.frame, robot * beams + k);
    const meets = reading < settings.sonar_range - column.scale;
    const angle = heading + (2 * Math.PI * k) / beams;
    const at = (radius, turn) =>
      look.project(x + radius * Math.cos(angle + turn), y + radius * Math.sin(angle + turn));
    const [cx, cy] = look.project(x, y);
    const radius = (rim + reading) * look.scale;
    pen(ctx, faded(meets ? colours.INK : colours.FAINT_INK, meets ? 0.6 : 0.3), meets ? 1.6 : 1);
    line(ctx, ...at(rim, 0), ...at(rim + reading, 0));
    if (meets) {
      ctx.beginPath();
      ctx.arc(cx, cy, radius, -angle - half * 0.8, -angle + half * 0.8);
      ctx.stroke();
    }
  }
}

// Who hears whom: of the selected robot, with the age of what it heard; of all, faintly.
function links(d) {
  const { ctx, look, robot, settings } = d;
  const n = settings.num_trackers;
  if (!d.layers.links) return;
  const heard = d.player.columns.get("heard_step");
  const age = (i, j) => {
    if (!heard) return 0;
    const step = heard.at(d.frame, i * n + j);
    return step < 0 ? Infinity : (d.frame - step) * settings.control_step;
  };
  const usual = settings.radio_delay * settings.control_step;
  const strength = (old) => Math.max(0, 1 - (old - usual) / LINK_FADES);
  ctx.font = d.font(10);
  ctx.textAlign = "center";
  ctx.textBaseline = "middle";
  if (robot !== null && robot < n) {
    const [x, y] = look.project(...d.pose(robot));
    for (let j = 0; j < n; j++) {
      const old = age(robot, j);
      if (j === robot || old > settings.forget_after) continue;
      const [mx, my] = look.project(...d.pose(j));
      pen(ctx, faded(colours.LINK, 0.25 + 0.6 * strength(old)), 1.5, old > usual + 1e-6 ? [3, 4] : []);
      line(ctx, x, y, mx, my);
      if (old > usual + 0.05) {
        d.label(`${old.toFixed(1)} s`, (x + mx) / 2, (y + my) / 2, colours.LINK);
      }
    }
    return;
  }
  // A large team has hundreds of links: together they weigh no more than a small team's.
  if (!heard) return;
  const weight = 0.5 * Math.max(0.12, Math.min(1, 24 / (n * n)));
  for (let i = 0; i < n; i++) {
    for (let j = 0; j < i; j++) {
      const shown = Math.max(strength(age(i, j)), strength(age(j, i)));
      if (shown <= 0) continue;
      pen(ctx, faded(colours.LINK, weight * shown), 1);
      line(ctx, ...look.project(...d.pose(i)), ...look.project(...d.pose(j)));
    }
  }
}

function ghost(d, x, y, heading, radius) {
  const { ctx, look } = d;
  const [px, py] = look.project(x, y);
  disc(ctx, px, py, radius);
  ctx.stroke();
  line(
    ctx,
    px,
    py,
    px + Math.cos(heading) * (radius + 5),
    py - Math.sin(heading) * (radius + 5),
  );
  return [px, py];
}

// Its last fix of the target, paler with age, and where it takes the target to be now.
function beliefs(d) {
  const { ctx, look, robot, settings } = d;
  if (robot === null || robot >= settings.num_trackers) return;
  const step = d.at("tracker_fix_step", robot);
  const age = (d.frame - step) * settings.control_step;
  const [x, y] = [d.at("tracker_fix_x", robot), d.at("tracker_fix_y", robot)];
  const apart = Math.hypot(x - d.at("target_x"), y - d.at("target_y"));
  if (step >= 0 && (age > 0.05 || apart > 0.05)) {
    pen(ctx, faded(colours.TARGET, Math.max(0.35, 1 - age / GHOST_FADES)), 1.8, [4, 3]);
    const [px, py] = ghost(d, x, y, d.at("tracker_fix_heading", robot), d.radius + 3);
    if (age > 0.05) d.label(`fix ${age.toFixed(1)} s ago`, px, py + d.radius + 14, colours.TARGET);
  }
  const estimate = d.player.columns.get("belief/estimate");
  const known = d.player.columns.get("belief/estimate_age");
  if (estimate && estimate.shape[1] === 3 && !(known && known.at(d.frame, robot) < 0)) {
    pen(ctx, colours.LINK, 1.4, [1.5, 3]);
    const [x, y, heading] = [0, 1, 2].map((k) => estimate.at(d.frame, 3 * robot + k));
    ghost(d, x, y, heading, d.radius + 6);
  }
  const slot = d.player.columns.get("belief/slot");
  if (slot && slot.at(d.frame, robot) >= 0) {
    const places = slotPlaces(
      d.world.slots, d.value("target_x"), d.value("target_y"), d.value("target_frame"),
    );
    const place = places[slot.at(d.frame, robot)];
    if (place) {
      pen(ctx, faded(colours.TARGET, 0.7), 1.2, [2, 4]);
      line(ctx, ...look.project(...d.pose(robot)), ...look.project(...place));
    }
  }
}

export const sightLayers = [sight];
export const sensingLayers = [links, sonar, beliefs];

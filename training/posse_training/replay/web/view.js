// One player's picture, on any canvas: the page's own, a saved one, a film's.
import { TITLE } from "./camera.js";
import { colours, label, setFont, write } from "./drawing.js";
import { floor, grid, obstacles, scaleBar, slots } from "./ground.js";
import { flashes, ghosts, quarry, trackers, trails } from "./robots.js";
import { beliefs, links, sight, sonar } from "./sensing.js";
import { app, frameOf, seconds } from "./state.js";

const LEAST_ROBOT = 7; // px
const LAYERS = [
  floor, sight, grid, slots, obstacles, trails, links, sonar, beliefs, ghosts, trackers, quarry, flashes, scaleBar, title,
];

// What every layer draws from, and on.
function drawing(ctx, player, look, position) {
  const { world, selected: robot, layers } = app;
  const n = world.settings.num_trackers;
  const frame = frameOf(player, position);
  const column = (name) => player.columns.get(name);
  const name = (i, part) => `${i < n ? "tracker" : "target"}_${part}`;
  const pose = (i) => ["x", "y", "heading"].map((part) => column(name(i, part)).between(position, i % n));
  return {
    ctx, player, look, frame, position, world, robot, layers, pose,
    settings: world.settings,
    ofTracker: robot !== null && robot < n,
    radius: Math.max(world.settings.robot_radius * look.scale, LEAST_ROBOT),
    at: (what, k = 0) => column(what).at(frame, k),
    value: (what, k = 0) => column(what).between(position, k),
    columns: (i) => [column(name(i, "x")), column(name(i, "y")), i % n],
    place: (i) => look.project(...pose(i)),
  };
}

// The player's name and its scores; where there is little room, the safe score goes first, then the word.
function title({ ctx, look, player, frame, position }) {
  ctx.fillStyle = colours.PAPER;
  ctx.fillRect(0, 0, look.width, TITLE);
  ctx.fillStyle = colours.PLAYERS[player.number];
  ctx.fillRect(0, 0, look.width, 3);
  const middle = TITLE / 2 + 2;
  const { mean, safe } = player.scores[frame];
  let right = look.width - 12;
  const shown = look.width < 320 ? [[look.width < 220 ? "" : "score", mean]] : [["safe", safe], ["score", mean]];
  for (const [name, value] of shown) {
    for (const [text, weight, colour, gap] of [[value.toFixed(2), 600, colours.INK, 6], [name, 400, colours.FAINT_INK, 16]]) {
      write(ctx, text, right, middle, 13, colour, "right", weight);
      right -= ctx.measureText(text).width + gap;
    }
  }
  setFont(ctx, 14, 650);
  const size = 14 * Math.min(1, (right - 12) / ctx.measureText(player.name).width);
  write(ctx, player.name, 12, middle, size, colours.INK, "left", 650);
  if (position > player.last) {
    label(ctx, `ended at ${seconds(player.last).toFixed(1)} s`, look.width / 2, TITLE + 14, colours.INK);
  }
}

export function drawView(ctx, player, look) {
  const d = drawing(ctx, player, look, app.position);
  ctx.save();
  ctx.beginPath();
  ctx.rect(0, 0, look.width, look.height);
  ctx.clip();
  for (const layer of LAYERS) layer(d);
  ctx.restore();
}

// The robot drawn within reach of a pixel, or null.
export function robotAt(player, look, x, y) {
  const d = drawing(null, player, look, app.position);
  let [best, least] = [null, Math.max(20, d.radius + 4)];
  for (let i = 0; i < app.world.agents; i++) {
    const [px, py] = d.place(i);
    const distance = Math.hypot(px - x, py - y);
    if (distance < least) [best, least] = [i, distance];
  }
  return best;
}

// One player's picture, on any canvas: the page's own, a saved one, a film's.
import { TITLE } from "./camera.js";
import { colours, faded } from "./colours.js";
import { robotLayers, trailLayers } from "./robots.js";
import { sensingLayers, sightLayers } from "./sensing.js";
import { app, frameOf, seconds } from "./state.js";
import { groundLayers, pen, placeLayers, scaleBar } from "./world.js";

const LEAST_ROBOT = 7; // px
const LAYERS = [
  ...groundLayers,
  ...sightLayers,
  ...placeLayers,
  ...trailLayers,
  ...sensingLayers,
  ...robotLayers,
  scaleBar,
  title,
];
const FACE = "system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif";

export function font(size, weight = 400) {
  return `${weight} ${size}px ${FACE}`;
}

// What every layer draws from, and on.
function drawing(ctx, player, look, position) {
  const n = app.world.settings.num_trackers;
  const frame = frameOf(player, position);
  const column = (name) => player.columns.get(name);
  return {
    ctx,
    player,
    look,
    frame,
    position,
    world: app.world,
    settings: app.world.settings,
    robot: app.selected,
    layers: app.layers,
    font,
    radius: Math.max(app.world.settings.robot_radius * look.scale, LEAST_ROBOT),
    at: (name, k = 0) => column(name).at(frame, k),
    value: (name, k = 0) => column(name).between(Math.min(position, player.last), k),
    pose(i) {
      const name = i < n ? "tracker" : "target";
      return ["x", "y", "heading"].map((part) => this.value(`${name}_${part}`, i % n));
    },
    label(text, x, y, colour) {
      ctx.font = font(11, 500);
      ctx.textAlign = "center";
      ctx.textBaseline = "middle";
      pen(ctx, faded(colours.PAPER, 0.85), 3.5);
      ctx.lineJoin = "round";
      ctx.strokeText(text, x, y);
      ctx.fillStyle = colour;
      ctx.fillText(text, x, y);
    },
  };
}

// The score so far, and the safe one: from the first contact on, every step counts nothing.
export function scoresOf(player) {
  if (!player.scores) {
    const touched = player.events.find((event) => event.kind === "contact")?.step ?? Infinity;
    const present = player.columns.get("score");
    let [sum, safe] = [0, 0];
    player.scores = Array.from({ length: player.frames }, (_, frame) => {
      const value = frame ? present.at(frame) : 0;
      sum += value;
      safe += frame < touched ? value : 0;
      return { present: present.at(frame), mean: sum / (frame || 1), safe: safe / (frame || 1) };
    });
  }
  return player.scores;
}

// Pixels that both scores, or one, and the margins of a title take.
const [BOTH, ONE] = [204, 122];
function cut(ctx, text, width) {
  if (ctx.measureText(text).width <= width) return text;
  let kept = text;
  while (kept && ctx.measureText(`${kept}…`).width > width) kept = kept.slice(0, -1);
  return `${kept}…`;
}

function title(d) {
  const { ctx, look, player } = d;
  ctx.fillStyle = colours.PAPER;
  ctx.fillRect(0, 0, look.width, TITLE);
  ctx.fillStyle = colours.PLAYERS[player.number];
  ctx.fillRect(0, 0, look.width, 3);
  const middle = TITLE / 2 + 2;
  const score = scoresOf(player)[d.frame];
  ctx.textBaseline = "middle";
  ctx.textAlign = "right";
  let right = look.width - 12;
  ctx.font = font(14, 650);
  const free = look.width - ctx.measureText(player.name).width;
  const words = [[free < ONE ? "" : "score", score.mean]];
  if (free >= BOTH) words.push(["safe", score.safe]);
  for (const [name, value] of words.reverse()) {
    for (const [text, weight, colour, room] of [
      [value.toFixed(2), 600, colours.INK, 6],
      [name, 400, colours.FAINT_INK, 16],
    ]) {
      ctx.font = font(13, weight);
      ctx.fillStyle = colour;
      ctx.fillText(text, right, middle);
      right -= ctx.measureText(text).width + room;
    }
  }
  ctx.textAlign = "left";
  ctx.fillStyle = colours.INK;
  ctx.font = font(14, 650);
  ctx.fillText(cut(ctx, player.name, right - 16), 12, middle);
  if (d.position > player.last) {
    d.label(`ended at ${seconds(player.last).toFixed(1)} s`, look.width / 2, TITLE + 14, colours.INK);
  }
}

export function drawView(ctx, player, look, position = app.position) {
  const d = drawing(ctx, player, look, position);
  ctx.save();
  ctx.beginPath();
  ctx.rect(0, 0, look.width, look.height);
  ctx.clip();
  for (const layer of LAYERS) layer(d);
  ctx.restore();
}

// The robot drawn within reach of a pixel, or null.
export function robotAt(player, look, x, y, reach = 20) {
  const d = drawing(null, player, look, app.position);
  let [best, least] = [null, Math.max(reach, d.radius + 4)];
  for (let i = 0; i < app.world.agents; i++) {
    const [px, py] = look.project(...d.pose(i));
    const distance = Math.hypot(px - x, py - y);
    if (distance < least) [best, least] = [i, distance];
  }
  return best;
}

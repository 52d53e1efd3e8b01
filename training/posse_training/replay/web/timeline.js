// The timeline: a row of ticks and a curve of the score for each player, and their difference.
import { colours, faded } from "./colours.js";
import { eventGlyph } from "./events.js";
import { app, frameOf, seconds, seek, set } from "./state.js";
import { font, scoresOf } from "./view.js";
import { disc, line, pen } from "./world.js";

const LEFT = 58;
const RIGHT = 14;
const ROW = 15; // px, of a player's ticks
const AXIS = 17;
const SMOOTHED = 1; // s, over which the present score is averaged
const DASHES = [[], [7, 3], [2, 3], [9, 3, 2, 3]];
const NEAR = 7; // px within which a click means a tick

// A value of each frame, averaged over the last second: the score jumps from step to step.
function curve(player) {
  if (!player.curve) {
    const scores = scoresOf(player);
    const reach = Math.max(1, Math.round(SMOOTHED / app.world.settings.control_step));
    let sum = 0;
    player.curve = scores.map((score, frame) => {
      sum += score.present - (frame >= reach ? scores[frame - reach].present : 0);
      return sum / Math.min(frame + 1, reach);
    });
  }
  return player.curve;
}

function gap(player, frame) {
  const score = (one) => scoresOf(one)[Math.min(frame, one.last)].mean;
  return score(player) - score(app.players[0]);
}

export function timelineHeight(narrow) {
  const rows = ROW * app.players.length + AXIS + 8;
  return rows + (narrow ? 44 : 62) + (app.players.length > 1 ? (narrow ? 30 : 38) : 0);
}

function layout(width, height) {
  const ticks = ROW * app.players.length + 4;
  const rest = height - ticks - AXIS;
  const difference = app.players.length > 1 ? Math.round(rest * 0.36) : 0;
  return {
    x: (frame) => LEFT + (frame / Math.max(1, app.last)) * (width - LEFT - RIGHT),
    frame: (x) => ((x - LEFT) / (width - LEFT - RIGHT)) * app.last,
    right: width - RIGHT,
    rows: 2,
    score: [ticks + 4, height - AXIS - difference - 4],
    difference: [height - AXIS - difference + 3, height - AXIS - 2],
  };
}

function name(ctx, text, y, colour = colours.FAINT_INK) {
  ctx.font = font(11);
  ctx.fillStyle = colour;
  ctx.textAlign = "right";
  ctx.textBaseline = "middle";
  ctx.fillText(text, LEFT - 8, y);
}

function axis(ctx, at, height) {
  const total = seconds(app.last);
  const steps = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800];
  const step = steps.find((value) => (value / total) * (at.right - LEFT) >= 56) ?? 3600;
  ctx.font = font(10.5);
  ctx.textAlign = "center";
  ctx.textBaseline = "middle";
  for (let time = 0; time <= total + 1e-9; time += step) {
    const x = at.x(time / seconds(1));
    pen(ctx, faded(colours.GRID, 0.6), 1);
    line(ctx, x, at.rows, x, height - AXIS);
    ctx.fillStyle = colours.FAINT_INK;
    ctx.fillText(`${Number(time.toFixed(1))} s`, x, height - AXIS / 2);
  }
}

function ticks(ctx, at) {
  app.players.forEach((player, row) => {
    const y = at.rows + ROW * (row + 0.5);
    ctx.fillStyle = colours.PLAYERS[row];
    disc(ctx, LEFT - 12, y, 4);
    ctx.fill();
    pen(ctx, colours.GRID, 1);
    line(ctx, LEFT, y, at.x(player.last), y);
    for (const event of player.events) eventGlyph(ctx, event.kind, at.x(event.step), y);
  });
}

function stroke(ctx, at, frames, height) {
  ctx.beginPath();
  for (let frame = 0; frame < frames; frame++) ctx.lineTo(at.x(frame), height(frame));
  ctx.stroke();
}

function scores(ctx, at) {
  const [top, bottom] = at.score;
  const height = (value) => bottom - value * (bottom - top);
  name(ctx, "score", (top + bottom) / 2);
  ctx.font = font(9.5);
  for (const value of [0, 1]) ctx.fillText(String(value), LEFT - 4, height(value));
  pen(ctx, colours.GRID, 1);
  for (const value of [0, 1]) line(ctx, LEFT, height(value), at.right, height(value));
  app.players.forEach((player, k) => {
    const values = curve(player);
    pen(ctx, colours.PLAYERS[k], 1.8, DASHES[k]);
    stroke(ctx, at, player.frames, (frame) => height(values[frame]));
  });
}

// How far each is ahead of the first in score so far.
function differences(ctx, at) {
  if (app.players.length < 2) return;
  const [top, bottom] = at.difference;
  const middle = (top + bottom) / 2;
  const frames = app.last + 1;
  let most = 0.05;
  for (const player of app.players.slice(1)) {
    for (let frame = 0; frame < frames; frame++) most = Math.max(most, Math.abs(gap(player, frame)));
  }
  const height = (value) => middle - (value / most) * ((bottom - top) / 2);
  name(ctx, "lead", middle);
  ctx.font = font(9.5);
  if (bottom - top > 24) ctx.fillText(`±${most.toFixed(2)}`, LEFT - 4, top + 3);
  pen(ctx, colours.FAINT_INK, 1);
  line(ctx, LEFT, middle, at.right, middle);
  app.players.slice(1).forEach((player, k) => {
    const colour = (ahead) => colours.PLAYERS[ahead ? k + 1 : 0];
    if (app.players.length === 2) {
      for (const ahead of [true, false]) {
        ctx.fillStyle = faded(colour(ahead), 0.45);
        ctx.beginPath();
        ctx.moveTo(at.x(0), middle);
        for (let frame = 0; frame < frames; frame++) {
          const value = gap(player, frame);
          ctx.lineTo(at.x(frame), height(ahead ? Math.max(0, value) : Math.min(0, value)));
        }
        ctx.lineTo(at.x(frames - 1), middle);
        ctx.fill();
      }
    }
    pen(ctx, colour(true), 1.4, DASHES[k + 1]);
    stroke(ctx, at, frames, (frame) => height(gap(player, frame)));
  });
}

function cursor(ctx, at, height, hover) {
  const x = at.x(app.position);
  pen(ctx, colours.INK, 1.6);
  line(ctx, x, 0, x, height - AXIS);
  ctx.fillStyle = colours.INK;
  ctx.beginPath();
  ctx.moveTo(x - 5, 0);
  ctx.lineTo(x + 5, 0);
  ctx.lineTo(x, 7);
  ctx.fill();
  if (!hover) return;
  const { event, frame } = hover;
  const text = event
    ? `${seconds(event.step).toFixed(1)} s: ${event.text}`
    : [
        `${seconds(frame).toFixed(1)} s`,
        ...app.players.map((one) => curve(one)[frameOf(one, frame)].toFixed(2)),
      ].join("   ");
  ctx.font = font(11.5, 500);
  const width = ctx.measureText(text).width + 16;
  const left = Math.max(LEFT, Math.min(at.right - width, at.x(event?.step ?? frame) + 10));
  const top = at.score[0] + 2;
  ctx.fillStyle = colours.INK;
  ctx.fillRect(left, top, width, 21);
  ctx.fillStyle = colours.PAPER;
  ctx.textAlign = "left";
  ctx.textBaseline = "middle";
  ctx.fillText(text, left + 8, top + 11);
}

export function drawTimeline(ctx, width, height, hover = null) {
  const at = layout(width, height);
  ctx.fillStyle = colours.PAPER;
  ctx.fillRect(0, 0, width, height);
  axis(ctx, at, height);
  ticks(ctx, at);
  scores(ctx, at);
  differences(ctx, at);
  cursor(ctx, at, height, hover);
}

// What lies at a pixel: a frame, and the tick that is meant, if any.
export function timelineAt(x, y, width, height) {
  const at = layout(width, height);
  const frame = Math.max(0, Math.min(app.last, Math.round(at.frame(x))));
  const player = app.players[Math.floor((y - at.rows) / ROW)];
  let event = null;
  for (const one of player?.events ?? []) {
    const distance = Math.abs(at.x(one.step) - x);
    if (distance <= NEAR && (!event || distance <= Math.abs(at.x(event.step) - x))) event = one;
  }
  return { frame: event ? event.step : frame, event };
}

export function connectTimeline(element, redraw) {
  let held = false;
  const found = (pointer) => {
    const box = element.getBoundingClientRect();
    return timelineAt(pointer.clientX - box.x, pointer.clientY - box.y, box.width, box.height);
  };
  element.addEventListener("pointerdown", (pointer) => {
    held = true;
    element.setPointerCapture(pointer.pointerId);
    const { frame, event } = found(pointer);
    seek(frame);
    if (event?.robots.length) set({ selected: event.robots[0] });
  });
  element.addEventListener("pointermove", (pointer) => {
    const at = found(pointer);
    if (held) seek(at.frame);
    redraw(at);
  });
  for (const end of ["pointerup", "pointercancel"]) {
    element.addEventListener(end, () => (held = false));
  }
  element.addEventListener("pointerleave", () => redraw(null));
}

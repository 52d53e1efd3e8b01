// The timeline: a row of ticks and a curve of the score for each player, and their difference.
import { EVENTS, colours, disc, faded, line, pen, setFont, write } from "./drawing.js";
import { app, frameOf, seconds, seek, set } from "./state.js";

const LEFT = 58;
const RIGHT = 14;
const ROW = 15; // px, of a player's ticks
const AXIS = 17;
const DASHES = [[], [7, 3], [2, 3], [9, 3, 2, 3]];
const NEAR = 7; // px within which a click means a tick

// How far a player is ahead of the first in score so far.
function lead(player, frame) {
  const score = (one) => one.scores[Math.min(frame, one.last)].mean;
  return score(player) - score(app.players[0]);
}

export function timelineHeight(narrow) {
  const rows = ROW * app.players.length + AXIS + 8;
  return rows + (narrow ? 44 : 62) + (app.players.length > 1 ? (narrow ? 30 : 38) : 0);
}

function layout(width, height) {
  const ticks = ROW * app.players.length + 4;
  const leads = app.players.length > 1 ? Math.round((height - ticks - AXIS) * 0.36) : 0;
  return {
    height,
    x: (frame) => LEFT + (frame / Math.max(1, app.last)) * (width - LEFT - RIGHT),
    frame: (x) => Math.round(((x - LEFT) / (width - LEFT - RIGHT)) * app.last),
    right: width - RIGHT,
    rows: 2,
    score: [ticks + 4, height - AXIS - leads - 4],
    lead: [height - AXIS - leads + 3, height - AXIS - 2],
  };
}

function axis(ctx, at) {
  const total = seconds(app.last);
  const steps = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800];
  const step = steps.find((value) => (value / total) * (at.right - LEFT) >= 56) ?? 3600;
  for (let time = 0; time <= total + 1e-9; time += step) {
    const x = at.x(time / seconds(1));
    pen(ctx, faded(colours.GRID, 0.6), 1);
    line(ctx, x, at.rows, x, at.height - AXIS);
    write(ctx, `${Number(time.toFixed(1))} s`, x, at.height - AXIS / 2, 10.5, colours.FAINT_INK);
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
    for (const event of player.events) EVENTS[event.kind]?.draw(ctx, at.x(event.step), y);
  });
}

function trace(ctx, at, frames, height) {
  ctx.beginPath();
  for (let frame = 0; frame < frames; frame++) ctx.lineTo(at.x(frame), height(frame));
}

function scores(ctx, at) {
  const [top, bottom] = at.score;
  const height = (value) => bottom - value * (bottom - top);
  write(ctx, "score", LEFT - 8, height(0.5), 11, colours.FAINT_INK, "right");
  for (const value of [0, 1]) {
    write(ctx, String(value), LEFT - 4, height(value), 9.5, colours.FAINT_INK, "right");
    pen(ctx, colours.GRID, 1);
    line(ctx, LEFT, height(value), at.right, height(value));
  }
  app.players.forEach((player, k) => {
    pen(ctx, colours.PLAYERS[k], 1.8, DASHES[k]);
    trace(ctx, at, player.frames, (frame) => height(player.scores[frame].recent));
    ctx.stroke();
  });
}

function leads(ctx, at) {
  const [others, frames] = [app.players.slice(1), app.last + 1];
  if (!others.length) return;
  const [top, bottom] = at.lead;
  const middle = (top + bottom) / 2;
  let most = 0.05;
  for (const player of others) {
    for (let frame = 0; frame < frames; frame++) most = Math.max(most, Math.abs(lead(player, frame)));
  }
  const height = (value) => middle - (value / most) * ((bottom - top) / 2);
  write(ctx, "lead", LEFT - 8, middle, 11, colours.FAINT_INK, "right");
  if (bottom - top > 24) write(ctx, `±${most.toFixed(2)}`, LEFT - 4, top + 3, 9.5, colours.FAINT_INK, "right");
  pen(ctx, colours.FAINT_INK, 1);
  line(ctx, LEFT, middle, at.right, middle);
  if (others.length === 1) {
    // The area is in the colour of who is ahead.
    for (const [k, limit] of [[1, Math.max], [0, Math.min]]) {
      ctx.fillStyle = faded(colours.PLAYERS[k], 0.45);
      trace(ctx, at, frames, (frame) => height(limit(0, lead(others[0], frame))));
      ctx.lineTo(at.x(frames - 1), middle);
      ctx.lineTo(at.x(0), middle);
      ctx.fill();
    }
  }
  others.forEach((player, k) => {
    pen(ctx, colours.PLAYERS[k + 1], 1.4, DASHES[k + 1]);
    trace(ctx, at, frames, (frame) => height(lead(player, frame)));
    ctx.stroke();
  });
}

function cursor(ctx, at) {
  const x = at.x(app.position);
  pen(ctx, colours.INK, 1.6);
  line(ctx, x, 0, x, at.height - AXIS);
  ctx.fillStyle = colours.INK;
  ctx.beginPath();
  ctx.moveTo(x - 5, 0);
  ctx.lineTo(x + 5, 0);
  ctx.lineTo(x, 7);
  ctx.fill();
}

// The moment below the pointer: its time, and the event or everyone's score.
function tip(ctx, at, { event, frame }) {
  const values = app.players.map((one) => one.scores[frameOf(one, frame)].recent.toFixed(2));
  const time = `${seconds(frame).toFixed(1)} s`;
  const text = event ? `${time}: ${event.text}` : [time, ...values].join("   ");
  setFont(ctx, 11.5, 500);
  const width = ctx.measureText(text).width + 16;
  const left = Math.max(LEFT, Math.min(at.right - width, at.x(frame) + 10));
  ctx.fillStyle = colours.INK;
  ctx.fillRect(left, at.score[0] + 2, width, 21);
  write(ctx, text, left + 8, at.score[0] + 13, 11.5, colours.PAPER, "left", 500);
}

export function drawTimeline(ctx, width, height, hover = null) {
  const at = layout(width, height);
  ctx.fillStyle = colours.PAPER;
  ctx.fillRect(0, 0, width, height);
  for (const draw of [axis, ticks, scores, leads, cursor]) draw(ctx, at);
  if (hover) tip(ctx, at, hover);
}

// What lies at a pixel: a frame, and the tick that is meant, if any.
function timelineAt(x, y, width, height) {
  const at = layout(width, height);
  const events = app.players[Math.floor((y - at.rows) / ROW)]?.events ?? [];
  const distance = (event) => Math.abs(at.x(event.step) - x);
  const near = events.filter((event) => distance(event) <= NEAR).sort((a, b) => distance(a) - distance(b));
  return { frame: near[0]?.step ?? Math.max(0, Math.min(app.last, at.frame(x))), event: near[0] };
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

// The help: keys, and everything that is drawn.
import { colours, faded } from "./colours.js";
import { EVENT_KINDS, eventGlyph } from "./events.js";
import { cross, leaderMark, wafer } from "./robots.js";
import { app } from "./state.js";
import { button, element } from "./values.js";
import { disc, line, pen } from "./world.js";

const KEYS = [
  ["Space", "play or pause"],
  ["← →", "one step; with Shift, one second"],
  ["Home, End", "to the start, to the end"],
  ["N, B", "next tick, tick before"],
  ["[ ]", "slower, faster (0.25× to 8×)"],
  ["0 to 9", "select a tracker; Esc: none"],
  ["F", "follow what is selected"],
  ["C", "move views together, or one by one"],
  ["R", "show everything again (double click)"],
  ["wheel, drag", "zoom, move; on a touch screen pinch, drag"],
  ["L, S, T", "links, sensing, trails"],
  ["P, V", "save a picture; record a film"],
];

function robot(colour, rim = colours.TRACKER_RIM) {
  return (ctx) => wafer(ctx, 22, 13, 0, 8, colour, rim);
}

function dashed(colour, dashes, width = 1.6) {
  return (ctx) => {
    pen(ctx, colour, width, dashes);
    line(ctx, 4, 13, 42, 13);
  };
}

function ring(colour, fill, dashes = []) {
  return (ctx) => {
    pen(ctx, colour, 1.6, dashes);
    disc(ctx, 22, 13, 9);
    if (fill) {
      ctx.fillStyle = fill;
      ctx.fill();
    }
    ctx.stroke();
  };
}

function entries() {
  const c = colours;
  const told = app.players.some((player) => player.columns.has("belief/task"));
  const tasks = told ? app.world.tasks.map((task, k) => [robot(c.TASKS[k]), task]) : [];
  return [
    [robot(c.TRACKER), told ? "tracker whose policy tells no task" : "tracker, its line ahead"],
    ...tasks,
    [(ctx) => {
      robot(c.TRACKER)(ctx);
      ctx.globalAlpha = 0.55;
      ctx.fillStyle = c.PAPER;
      disc(ctx, 22, 13, 7);
      ctx.fill();
      ctx.globalAlpha = 1;
    }, "pale: it does not see the target"],
    [(ctx) => {
      robot(c.BROKEN, c.TRACKER)(ctx);
      pen(ctx, c.INK, 2);
      cross(ctx, 22, 13, 7);
    }, "broken"],
    [(ctx) => leaderMark(ctx, 22, 18, 6), "leader"],
    [robot(c.TARGET, c.TARGET), "target"],
    [ring(c.SLOT), "slot, as wide as the tolerance"],
    [ring(c.SLOT, c.SLOT_FILLED), "slot that is occupied"],
    [ring(c.TARGET, null, [4, 3]), "selected: its last fix of the target, where that is off; paler with age"],
    [ring(c.LINK, null, [1.5, 3]), "selected: where it takes the target to be"],
    [ring(c.SENSING_RIM, c.SENSING), "selected: where it would see the target"],
    [dashed(faded(c.INK, 0.6), []), "selected: sonar beam that meets something"],
    [dashed(c.LINK, []), "radio: heard; selected: dashed and dated if it is old"],
    [dashed(faded(c.TARGET, 0.7), [2, 4]), "selected: the slot that it is bound for"],
    ...Object.entries(EVENT_KINDS).map(([kind, text]) => [
      (ctx) => eventGlyph(ctx, kind, 22, 13), `tick: ${text}`,
    ]),
  ];
}

function glyph(draw) {
  const canvas = element("canvas");
  const ratio = devicePixelRatio || 1;
  [canvas.width, canvas.height] = [46 * ratio, 26 * ratio];
  const ctx = canvas.getContext("2d");
  ctx.scale(ratio, ratio);
  draw(ctx);
  return canvas;
}

export function toggleLegend() {
  const dialog = document.getElementById("legend");
  if (dialog.open) {
    dialog.close();
    return;
  }
  const keys = KEYS.map(([key, text]) =>
    element("tr", [element("th", [element("kbd", key)]), element("td", text)]),
  );
  const drawn = entries().map(([draw, text]) =>
    element("tr", [element("td", [glyph(draw)]), element("td", text)]),
  );
  const note =
    "Score: slots occupied per working tracker, averaged over the steps so far. Safe score: from " +
    "the first contact on, every step counts 0. The curves show the last second; lead is the score " +
    "so far less that of the first player.";
  dialog.replaceChildren(
    button("×", () => dialog.close(), "close"),
    element("h2", "Keys"), element("table", keys),
    element("h2", "What is drawn"), element("table", drawn, "drawn"),
    element("p", note, "note"),
  );
  dialog.showModal();
}
